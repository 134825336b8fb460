//! Builds the configuration from the parameters: SI values become the control's coefficients, once.
//!
//! `Si` holds the quantities that several blocks share; each block computes its coefficients from them, in single
//! precision, in SI and in the order in which they are written, so that chip and PC find the same bits. A coefficient
//! that leaves its range refuses the parameter to change, and the first refusal counts.

use core::f32::consts::TAU;

mod base;
#[cfg(test)]
mod by_hand;
mod flux;
mod inductance;
mod observer;
mod outer;
mod regulator;
mod sensing;
mod si;
mod six_step;
mod start;
#[cfg(test)]
mod tests;
mod tone;

pub use flux::FluxSettings;
pub(crate) use sensing::unbalance_max;
pub use si::{BuildError, scale};
use si::{OVERMODULATION_HZ, Si, TEST_SHARE, TOO_FEW_PERIODS};

use crate::control::low_speed;
use crate::control::modulator::{self, Modulation};
use crate::drive::{Config, Direction, Drift, Stop, Thresholds};
use crate::protection;
use siskin_params::choice::{
    CtlDrive, CtlModulation, CtlObserver, Inp3d, LimPolicy, MotDir, MotStop,
};
use siskin_params::{BUS_UNITS_MIN, Board, ParamId, Params, Shunts, TRIP_SHARE, parts};
use siskin_units::math::Real;
use siskin_units::{AdcCounts, Current, Scale, Speed, Voltage, stated_emf};

/// Fastest rotor that six edges per turn can follow, turns per period: two periods per edge.
const EDGES_TURNS: f32 = 1.0 / 12.0;

/// Highest supply in units of voltage; the type holds eight.
const BUS_UNITS_MAX: f32 = 6.0;

/// Time for which ξ̂ may stay at the end of its range, s: far longer than any transient that the observer recovers
/// from.
const LOST_S: f32 = 0.1;

/// Time for which zero throttle must hold before a fault clears, s.
const CLEAR_S: f32 = 0.3;

/// Time without its cause after which a fault clears for the first retry, s: by then the tasks have seen it, and the
/// terminals have shown how the shaft turns.
const RETRY_S: f32 = 0.02;

/// Time for which a motor with position sensors may be slow before it counts as stuck, s.
const SENSED_S: f32 = 0.8;

/// Time for which the observer must lead before a start counts as done, s.
const PROVEN_S: f32 = 0.3;

/// i_d at standstill over `STA_RAMP_A`, and its resistive drop over what the dead time takes beyond the back-EMF at the
/// least speed.
const BIAS_SHARE: f32 = 0.3;

/// Back-EMF over the resistive drop of i_d at standstill, at the speed where i_d ends: 2000 rad/s on the bench.
const BIAS_END: f32 = 16.0;

/// Least back-EMF there over the dead time's voltage: 1937 rad/s on the bench.
const BIAS_DEAD_END: f32 = 5.5;

/// Least bound of i_q over `STA_RAMP_A`.
const TORQUE_LEAST_SHARE: f32 = 0.5;

/// Greatest resistive drop of i_q over the back-EMF: with R stated 30 % too high, three times that leaves no estimate.
const TORQUE_DROP_SHARE: f32 = 1.0;

/// Greatest driving current over the one whose flux is the rotor's: an error of 30 % of that L turns the flux by asin 0.45,
/// 27°.
const DRIVING_SHARE: f32 = 1.5;

/// Time constant with which the reported speed decays while the bridge is off, s. The bench's propeller takes 1.1 s.
const COAST_S: f32 = 2.0;

/// Greatest current bandwidth over the PWM frequency: the observer's poles at (−1 ± i) times it are stepped by Euler's
/// rule, and the loop has a period of delay.
const BANDWIDTH_SHARE: f32 = 0.05;

/// Greatest speed bandwidth over the current bandwidth: nested loops need that separation.
const SPEED_SHARE: f32 = 0.2;

/// Volts below `LIM_BUS_V_MAX` at which the returned current starts to be reduced.
const RETURN_BAND_V: f32 = 1.0;

/// Volts over which the returned current is reduced to zero; measuring it and the voltage takes the rest of the band.
const RETURN_V: f32 = 0.5;

/// `LIM_BUS_V_MIN` over which the drawn current is reduced, 0.2 V of a lithium cell's 3.3 V, and the least such voltage, V.
const DRAW_SHARE: f32 = 0.0625;
const DRAW_LEAST_V: f32 = 0.25;

/// Share of that below which nothing more is drawn: the ripple of the supply's voltage is smaller.
const DRAW_NONE_SHARE: f32 = 0.25;

/// i_d at `LIM_BUS_V_MAX` over `LIM_PHASE_A`: 4 W on the bench, where zero i_q returns 1 W.
const BURN_SHARE: f32 = 0.25;

/// Rate at which the bounds of i_q follow the bus current, 1/s.
const BOUND_RATE: f32 = 600.0;

/// The reason for refusing a speed.
const ABOVE_FASTEST: &str = "above CTL_RPM_MAX";

/// Computes the drive's coefficients from SI values.
///
/// # Errors
/// A [`BuildError`] names the parameter that takes a coefficient out of its range.
pub fn build(params: &Params, board: &Board) -> Result<Config, BuildError> {
    let mut config = Config::default();
    build_in(params, board, Drift::NONE, &mut config)?;
    Ok(config)
}

/// Like [`build`], but for a motor that has drifted from the parameters' one, and in the caller's place: on the chip a
/// copy takes 0.9 KB of stack. The units, and the settings that follow from the motor, stay those of the stated motor.
///
/// # Errors
/// As [`build`]; the place then holds no valid configuration.
pub fn build_in(
    params: &Params,
    board: &Board,
    drift: Drift,
    place: &mut Config,
) -> Result<(), BuildError> {
    let made = params.in_force();
    let p = Si::new(&made, board, drift);
    if let Some(unknown) = params.unknown() {
        p.refuse_if(
            p.chosen(CtlDrive::FieldOriented),
            unknown,
            "not known; set it, or CTL_DRIVE to 2",
        );
    }
    refuse_contradictions(&p);
    let modulation = match (p.choice(), parts::Sine::get()) {
        (CtlModulation::Sine, Some(part)) => Modulation::Sine(part),
        _ => Modulation::SpaceVector,
    };
    let (duty_max, window) = sensing::duty_max(&p, modulation);
    if p.refused.get().is_some() {
        // Not by `?`: the chip would copy the refusal field by field.
        return p.verdict();
    }
    place.scale = p.scale;
    place.direction = match p.choice() {
        MotDir::Normal => Direction::Normal,
        MotDir::Reversed => Direction::Reversed,
    };
    place.stop = match p.choice() {
        MotStop::Coast => Stop::Coast,
        MotStop::Brake => Stop::Brake,
    };
    place.delay = board.delay;
    place.bus = p.factor(ParamId::LimBusVMax, board.bus_v_per_count / p.unit_v);
    observer::observer(&p, &mut place.observer);
    regulator::regulator(&p, &mut place.regulator);
    outer::speed(&p, &mut place.speed);
    outer::torque(&p, &mut place.torque);
    inductance::inductance(&p, &mut place.adapt_l);
    place.low_speed = low_speed(&p);
    outer::weakening(&p, &mut place.weakening);
    start::attempts(&p, &mut place.start);
    if !p.chosen(CtlDrive::FieldOriented) {
        // Six-step never uses the coefficients above, so they need not fit: its motor may be any.
        p.refused.set(None);
    }
    place.test_current = test_current(params, &p.scale);
    place.both_ways = p.chosen(Inp3d::On);
    place.slow = p.scale.speed_from_rpm(p.slow_rpm);
    place.coast = p.gain(ParamId::PwmFreqHz, p.t / COAST_S);
    place.clear_periods = p.periods(CLEAR_S);
    place.proven_periods = p.periods(PROVEN_S);
    place.lost_periods = p.periods(LOST_S);
    place.modulator = modulator::Config::new(
        modulation,
        duty_max,
        match board.shunts {
            // The dead-time compensation adds to what the vector takes.
            Shunts::Three => window.min(duty_max) - p.dead_share,
            Shunts::Two => 0.0,
        },
    );
    if modulation == Modulation::SpaceVector && place.weakening.most != Current::ZERO {
        let from = Speed::from_f32(TAU * OVERMODULATION_HZ / p.rad_per_unit);
        place.modulator =
            core::mem::take(&mut place.modulator).overmodulating(board.shunts, window, from);
    }
    place.start_bus = start::bus(&p);
    sensing::sensing(&p, window, &mut place.sensing);
    sensing::catch(&p, &mut place.catch);
    place.charge = sensing::charge(&p);
    sensing::dead_time(&p, &mut place.dead_time);
    limits(&p, &mut place.protection);
    tone::tone(&p, &mut place.tone);
    match p.choice() {
        CtlDrive::FieldOriented => place.six_step = None,
        // Parameters in force are never automatic.
        CtlDrive::SixStep | CtlDrive::Automatic => {
            six_step::six_step(
                &p,
                duty_max.min(window),
                place.six_step.insert(Default::default()),
            );
        }
    }
    place.slow_periods = if p.chosen(CtlObserver::Hall) {
        p.periods(SENSED_S)
    } else {
        0
    };
    place.retry_periods = match p.choice() {
        LimPolicy::Bench => 0,
        LimPolicy::Flight => p.periods(RETRY_S),
    };
    place.least_u_q = least_u_q(&p);
    p.verdict()
}

/// Returns the greatest current of a motor test.
pub(crate) fn test_current(params: &Params, scale: &Scale) -> Current {
    scale.current_from_a(TEST_SHARE * params.get(ParamId::LimPhaseA))
}

/// Returns the thresholds at which limits bind.
pub(crate) fn thresholds(params: &Params, scale: &Scale) -> Thresholds {
    let return_v = params.get(ParamId::LimBusVMax) - RETURN_BAND_V;
    let draw_v = params.get(ParamId::LimBusVMin) + (1.0 + DRAW_NONE_SHARE) * draw_v(params);
    Thresholds {
        phase: scale.current_from_a(params.get(ParamId::LimPhaseA)),
        bus_return_v: Voltage::from_f32(return_v / scale.voltage_v),
        bus_draw_v: Voltage::from_f32(draw_v / scale.voltage_v),
        fastest: if params.drives_by_six_step() {
            six_step::fastest()
        } else {
            Speed::MAX
        },
    }
}

/// Returns the volts over which the drawn current is reduced.
fn draw_v(params: &Params) -> f32 {
    (DRAW_SHARE * params.get(ParamId::LimBusVMin)).max(DRAW_LEAST_V)
}

/// Returns the number of consecutive periods for which the observer's state may be out of range.
pub(crate) fn lost_periods(scale: &Scale) -> u32 {
    (LOST_S / scale.period_s) as u32
}

/// Refuses values that are wrong whatever the coefficients.
fn refuse_contradictions(p: &Si) {
    let above = |value, limit, param, reason| p.refuse_above(value, limit, param, reason);
    let (settings, supply_max_v) = (&p.settings, p.supply_max_v);
    p.refuse_if(
        p.get(ParamId::LimBusVMin) >= supply_max_v,
        ParamId::LimBusVMin,
        "not below LIM_BUS_V_MAX",
    );
    above(
        supply_max_v,
        BUS_UNITS_MAX * p.unit_v,
        ParamId::PwmFreqHz,
        "too low for flux and LIM_BUS_V_MAX",
    );
    above(
        p.unit_v,
        supply_max_v / BUS_UNITS_MIN,
        ParamId::PwmFreqHz,
        "too high for flux and LIM_BUS_V_MAX",
    );
    above(
        settings.least_rpm,
        p.fastest_rpm,
        ParamId::CtlRpmMin,
        ABOVE_FASTEST,
    );
    above(
        settings.run_rpm,
        p.fastest_rpm,
        ParamId::StaRunRpm,
        ABOVE_FASTEST,
    );
    above(
        settings.current_hz,
        BANDWIDTH_SHARE * p.get(ParamId::PwmFreqHz),
        ParamId::CtlBwCurHz,
        "above a twentieth of PWM_FREQ_HZ",
    );
    above(
        settings.speed_hz,
        SPEED_SHARE * settings.current_hz,
        ParamId::CtlBwSpdHz,
        "above a fifth of CTL_BW_CUR_HZ",
    );
    for id in [
        ParamId::LimPhaseA,
        ParamId::LimBusVMax,
        ParamId::PwmDeadtimeNs,
        ParamId::InpProto,
    ] {
        if let Some(refusal) = id.beyond(p.get(id), p.board) {
            p.refuse_if(true, id, refusal);
        }
    }
    above(p.fastest_turns, 0.25, ParamId::PwmFreqHz, TOO_FEW_PERIODS);
    if p.chosen(CtlObserver::FluxCrossings) || p.chosen(CtlObserver::Hall) {
        above(
            p.fastest_turns,
            EDGES_TURNS,
            ParamId::PwmFreqHz,
            TOO_FEW_PERIODS,
        );
    }
    if let Some(bound) = p.params.pwm_bound(p.board) {
        let pwm_hz = p.get(ParamId::PwmFreqHz);
        above(pwm_hz, bound.hz, ParamId::PwmFreqHz, bound.refusal);
    }
}

/// Returns the least voltage along q in voltage mode.
fn least_u_q(p: &Si) -> Voltage {
    if p.is_helped() {
        stated_emf(p.scale.speed_from_rpm(p.settings.least_rpm))
    } else {
        Voltage::ZERO
    }
}

/// Keeps a back-EMF-based observer in lock where there is little back-EMF.
fn low_speed(p: &Si) -> low_speed::Config {
    let current = |amperes| p.scale.current_from_a(amperes);
    let limit = current(p.limit_a);
    if !p.is_helped() {
        return low_speed::Config::none(limit);
    }
    // A current whose flux exceeds the rotor's takes more voltage than the rotor induces: the supply cannot hold it in
    // braking.
    let winding_a = p.flux / p.l;
    let braking_a = winding_a.min(p.limit_a);
    let driving_a = (DRIVING_SHARE * winding_a).min(p.limit_a);
    // At the least speed each phase current has a clear sign except briefly: it exceeds the PWM ripple, and the more
    // the dead time costs, the shorter it is without one.
    let dead_v = p.settings.dead_v;
    let slow_v = p.settings.least_rpm * p.pole_pairs * TAU / 60.0 * p.flux;
    let ripple_a = slow_v * p.t / p.l;
    let hidden_a = (dead_v - slow_v) / p.r * BIAS_SHARE;
    let bias_a = (BIAS_SHARE * p.start_a)
        .max(ripple_a)
        .max(hidden_a)
        .min(p.start_a);
    let end_v = (BIAS_END * p.r * bias_a).max(BIAS_DEAD_END * dead_v);
    let end_rad_s = end_v / p.flux;
    let i_d_slope = bias_a / p.unit_a / end_rad_s * p.rad_per_unit;
    let i_q_slope = TORQUE_DROP_SHARE * p.flux / p.r * p.rad_per_unit / p.unit_a;
    low_speed::Config::new(
        (current(bias_a), p.gain(ParamId::StaRampA, i_d_slope)),
        (
            current(TORQUE_LEAST_SHARE * p.start_a),
            p.gain(ParamId::MotRMohm, i_q_slope),
        ),
        ([current(braking_a), current(driving_a)], limit),
    )
}

fn limits(p: &Si, place: &mut protection::Config) {
    let current = |id| p.scale.current_from_a(p.get(id));
    let regen_a = p.get(ParamId::LimRegenA);
    place.trip = AdcCounts::from_f32(TRIP_SHARE * p.limit_a / p.board.current_a_per_count);
    place.bus_min = p.voltage(p.get(ParamId::LimBusVMin));
    place.bus_max = p.voltage(p.supply_max_v);
    place.phase = current(ParamId::LimPhaseA);
    place.bus_draw = current(ParamId::LimBusA);
    let draw_v = draw_v(p.params);
    let draw_a = p.get(ParamId::LimBusA).min(p.limit_a);
    let least_v = p.get(ParamId::LimBusVMin);
    place.bus_empty_v = p.voltage(least_v + DRAW_NONE_SHARE * draw_v);
    place.bus_draw_v = p.voltage(least_v + (1.0 + DRAW_NONE_SHARE) * draw_v);
    place.bus_draw_slope = p.gain(ParamId::LimBusA, draw_a / draw_v * p.unit_v / p.unit_a);
    place.bus_return = current(ParamId::LimRegenA);
    place.bus_return_v = p.voltage(p.supply_max_v - RETURN_BAND_V);
    place.bus_return_slope = p.gain(ParamId::LimRegenA, regen_a / RETURN_V * p.unit_v / p.unit_a);
    place.burn_slope = p.gain(
        ParamId::LimPhaseA,
        BURN_SHARE / RETURN_BAND_V * p.limit_a * p.unit_v / p.unit_a,
    );
    place.bound_rate = p.factor(ParamId::PwmFreqHz, BOUND_RATE * p.t);
}
