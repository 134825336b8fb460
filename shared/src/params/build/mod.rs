//! The configuration that the parameters make: SI values become the control's coefficients, once.

mod flux;
mod inductance;
mod input;
mod observer;
mod outer;
mod regulator;
mod sensing;
mod si;
mod six_step;
mod start;
mod tone;

pub use flux::FluxSettings;
pub use input::input;
pub use si::{BuildError, scale};
use si::{Si, TEST_SHARE};

use core::cell::Cell;
use core::f32::consts::TAU;

use super::board::Board;
use super::choice::{CtlDrive, CtlModulation, CtlObsCure, CtlObserver, Inp3d, MotDir, MotStop};
use super::table::ParamId;
use super::values::Params;
use crate::control::low_speed;
use crate::control::modulator::{self, Modulation};
use crate::control::sensing::Shunts;
use crate::drive::{Config, Direction, Stop};
use crate::input::signal::Signal;
use crate::math::Real;
use crate::protection;
use crate::units::{AdcCounts, Current, Scale, Voltage, stated_emf};

/// Fastest rotor, turns a period, that is followed by six edges a turn: two periods for each.
const EDGES_TURNS: f32 = 1.0 / 12.0;

/// The supply may be at most this many units of voltage, of the eight that the type holds.
const BUS_UNITS_MAX: f32 = 6.0;

/// The supply must be at least so many units, where the modulator's reciprocal of it ends.
const BUS_UNITS_MIN: f32 = 0.125;

/// Time for which ξ̂ may be at the end of its range, s: far longer than any transient that the
/// observer recovers from.
const LOST_S: f32 = 0.1;

/// Time for which zero throttle must hold before a fault ends, s.
const CLEAR_S: f32 = 0.3;

/// Time for which a motor whose sensors know its position may be slow before it counts as stuck, s.
const SENSED_S: f32 = 0.8;

/// Time for which the observer must have led before a start counts as done, s.
const PROVEN_S: f32 = 0.3;

/// i_d at standstill over `STA_RAMP_A`.
const BIAS_SHARE: f32 = 0.3;

/// Back-EMF over the resistive drop of i_d at standstill, at the speed at which i_d ends: 2000 rad/s
/// on the bench.
const BIAS_END: f32 = 16.0;

/// The same over the dead time's voltage, at least: 1937 rad/s on the bench.
const BIAS_DEAD_END: f32 = 5.5;

/// Least bound of i_q over `STA_RAMP_A`.
const TORQUE_LEAST_SHARE: f32 = 0.5;

/// Greatest resistive drop of i_q as a share of the back-EMF: with R stated 30 % too high, three times
/// that leaves no estimate; and with more, the start accelerates faster than the loop can follow.
const TORQUE_DROP_SHARE: f32 = 0.5;

/// Time constant with which the reported speed falls while the bridge is off, s. The bench's
/// propeller takes 1.1 s.
const COAST_S: f32 = 2.0;

/// Greatest current bandwidth of the PWM frequency: the observer's poles at (−1 ± i) times it are
/// stepped by Euler's rule, and there is a period of delay in the loop.
const BANDWIDTH_SHARE: f32 = 0.05;

/// Greatest speed bandwidth of the current bandwidth: nested loops need that distance.
const SPEED_SHARE: f32 = 0.2;

/// Software trip over `LIM_PHASE_A`.
pub(crate) const TRIP_SHARE: f32 = 1.4;

/// Share of the converter's range that a trip may take: offsets and the uneven ends of the range stay
/// below the rest.
const SHOWN_SHARE: f32 = 0.97;

/// Volts below `LIM_BUS_V_MAX` over which the returned current is brought to zero.
const RETURN_BAND_V: f32 = 1.0;

/// Rate at which the bounds of i_q follow the bus current, 1/s.
const BOUND_RATE: f32 = 600.0;

/// Computes the drive's coefficients from SI values.
///
/// # Errors
/// A [`BuildError`] names the parameter that makes a coefficient leave its range.
pub fn build(params: &Params, board: &Board) -> Result<Config, BuildError> {
    let mut config = Config::default();
    build_in(params, board, &mut config)?;
    Ok(config)
}

/// As [`build`], in a place that the caller has for it: on the chip a copy takes 0.9 KB of stack.
///
/// # Errors
/// As [`build`]; what is in its place then is no configuration.
pub fn build_in(params: &Params, board: &Board, place: &mut Config) -> Result<(), BuildError> {
    let refused = Cell::new(None);
    let made = params.in_force();
    let p = Si::new(&made, board, &refused);
    if let Some(unknown) = params.unknown() {
        p.refuse_if(
            p.chosen(CtlDrive::FieldOriented),
            unknown,
            "not known; set it, or CTL_DRIVE to 2",
        );
    }
    refuse_contradictions(&p);
    let modulation = match p.choice() {
        CtlModulation::SpaceVector => Modulation::SpaceVector,
        CtlModulation::Sine => Modulation::Sine,
    };
    let (duty_max, window) = sensing::duty_max(&p, modulation);
    p.verdict()?;
    place.scale = p.scale;
    place.bus = p.factor(
        ParamId::LimBusVMax,
        board.bus_v_per_count / p.scale.voltage_v,
    );
    place.direction = match p.choice() {
        MotDir::Normal => Direction::Normal,
        MotDir::Reversed => Direction::Reversed,
    };
    place.stop = match p.choice() {
        MotStop::Coast => Stop::Coast,
        MotStop::Brake => Stop::Brake,
    };
    place.delay = board.delay;
    place.observer = observer::observer(&p);
    place.regulator = regulator::regulator(&p);
    place.speed = outer::speed(&p);
    place.torque = outer::torque(&p);
    place.adapt_l = inductance::inductance(&p);
    place.low_speed = low_speed(&p);
    start::attempts(&p, &mut place.start);
    if !p.chosen(CtlDrive::FieldOriented) {
        // What the six-step drive never runs with need not fit: its motor may be any.
        refused.set(None);
    }
    place.test_current = test_current(params, &p.scale);
    place.both_ways = p.chosen(Inp3d::On);
    place.slow = p.slow();
    place.coast = p.gain(ParamId::PwmFreqHz, p.period_s / COAST_S);
    place.modulator = modulator::Config::new(
        modulation,
        duty_max,
        match board.shunts {
            // The dead time's compensation comes on top of what the vector makes.
            Shunts::Three => window - p.dead_time_s / p.period_s,
            Shunts::Two => 0.0,
        },
    );
    place.sensing = sensing::sensing(&p, window);
    place.catch = sensing::catch(&p);
    place.charge = sensing::charge(&p);
    place.dead_time = sensing::dead_time(&p);
    place.protection = limits(&p);
    place.tone = tone::tone(&p);
    place.six_step = match p.choice() {
        CtlDrive::FieldOriented => None,
        // What is in force is never automatic.
        CtlDrive::SixStep | CtlDrive::Automatic => Some(six_step::six_step(&p, duty_max)),
    };
    place.clear_periods = p.periods(CLEAR_S);
    place.slow_periods = if p.chosen(CtlObserver::Hall) {
        p.periods(SENSED_S)
    } else {
        0
    };
    place.proven_periods = p.periods(PROVEN_S);
    place.lost_periods = lost_periods(&p.scale);
    place.least_u_q = least_u_q(&p);
    p.verdict()
}

/// Greatest current of a test of the motor.
pub(crate) fn test_current(params: &Params, scale: &Scale) -> Current {
    scale.current_from_a(TEST_SHARE * params.get(ParamId::LimPhaseA))
}

/// Periods in a row for which the observer's state may be out of its range.
pub(crate) fn lost_periods(scale: &Scale) -> u32 {
    (LOST_S / scale.period_s) as u32
}

/// Refuses values that are wrong whatever the coefficients are.
fn refuse_contradictions(p: &Si) {
    let get = |id| p.get(id);
    let unit_v = p.scale.voltage_v;
    p.refuse_if(
        get(ParamId::LimBusVMax) > BUS_UNITS_MAX * unit_v,
        ParamId::PwmFreqHz,
        "too low for this flux and LIM_BUS_V_MAX",
    );
    p.refuse_if(
        get(ParamId::LimBusVMax) < BUS_UNITS_MIN * unit_v,
        ParamId::PwmFreqHz,
        "too high for this flux and LIM_BUS_V_MAX",
    );
    p.refuse_if(
        get(ParamId::LimBusVMin) >= get(ParamId::LimBusVMax),
        ParamId::LimBusVMin,
        "not below LIM_BUS_V_MAX",
    );
    p.refuse_if(
        p.from_motor.least_rpm > get(ParamId::CtlRpmMax),
        ParamId::CtlRpmMin,
        "above CTL_RPM_MAX",
    );
    p.refuse_if(
        p.from_motor.run_rpm > get(ParamId::CtlRpmMax),
        ParamId::StaRunRpm,
        "above CTL_RPM_MAX",
    );
    p.refuse_if(
        p.from_motor.current_hz > BANDWIDTH_SHARE * get(ParamId::PwmFreqHz),
        ParamId::CtlBwCurHz,
        "above a twentieth of PWM_FREQ_HZ",
    );
    p.refuse_if(
        p.from_motor.speed_hz > SPEED_SHARE * p.from_motor.current_hz,
        ParamId::CtlBwSpdHz,
        "above a fifth of CTL_BW_CUR_HZ",
    );
    p.refuse_if(
        get(ParamId::LimPhaseA) * TRIP_SHARE > SHOWN_SHARE * p.board.current_range_a,
        ParamId::LimPhaseA,
        "the trip at 1.4 times this is beyond the board",
    );
    p.refuse_if(
        get(ParamId::PwmDeadtimeNs) < p.board.least_dead_time.ns,
        ParamId::PwmDeadtimeNs,
        p.board.least_dead_time.refusal,
    );
    let turns = get(ParamId::CtlRpmMax) * p.pole_pairs * p.period_s / 60.0;
    p.refuse_if(
        turns > 0.25,
        ParamId::PwmFreqHz,
        "less than four periods a turn at CTL_RPM_MAX",
    );
    let by_edges = p.chosen(CtlObserver::FluxCrossings) || p.chosen(CtlObserver::Hall);
    p.refuse_if(
        by_edges && turns > EDGES_TURNS,
        ParamId::PwmFreqHz,
        "less than twelve periods a turn at CTL_RPM_MAX",
    );
    let protocol = get(ParamId::InpProto);
    p.refuse_if(
        protocol != 0.0 && Signal::from_number(protocol as u8).is_none(),
        ParamId::InpProto,
        "neither 0, 1 to 4, 10 to 13 nor 20 to 23",
    );
}

/// True for an observer that is helped where there is little back-EMF. The first paper's is as published, and
/// sensors give the position at any speed.
fn is_helped(p: &Si) -> bool {
    let published = p.chosen(CtlObserver::BackEmf) && p.chosen(CtlObsCure::Published);
    !published && !p.chosen(CtlObserver::Hall)
}

/// Least voltage along q in voltage mode.
fn least_u_q(p: &Si) -> Voltage {
    if is_helped(p) {
        stated_emf(p.scale.speed_from_rpm(p.from_motor.least_rpm))
    } else {
        Voltage::ZERO
    }
}

/// Keeps an observer that lives by the back-EMF in lock where there is little of it.
fn low_speed(p: &Si) -> low_speed::Config {
    let limit_a = p.get(ParamId::LimPhaseA);
    let phase = p.scale.current_from_a(limit_a);
    if !is_helped(p) {
        return low_speed::Config::none(phase);
    }
    let ramp_a = p.from_motor.ramp_a.min(limit_a);
    let bias_a = BIAS_SHARE * ramp_a;
    let rad_per_unit = TAU / p.period_s;
    let end_v = BIAS_END * p.resistance_ohm * bias_a;
    let end_v = end_v.max(BIAS_DEAD_END * p.from_motor.dead_v);
    let end_rad_s = end_v / p.flux_wb;
    let drop_a_s = TORQUE_DROP_SHARE * p.flux_wb / p.resistance_ohm;
    let i_d = p.scale.current_from_a(bias_a);
    let i_d_slope = bias_a / p.scale.current_a / end_rad_s * rad_per_unit;
    let i_q = p.scale.current_from_a(TORQUE_LEAST_SHARE * ramp_a);
    let i_q_slope = drop_a_s * rad_per_unit / p.scale.current_a;
    low_speed::Config::new(
        (i_d, p.gain(ParamId::StaRampA, i_d_slope)),
        (i_q, p.gain(ParamId::MotRMohm, i_q_slope)),
        phase,
    )
}

fn limits(p: &Si) -> protection::Config {
    let current = |id| p.scale.current_from_a(p.get(id));
    let bus_max_v = p.get(ParamId::LimBusVMax);
    let return_a = p.get(ParamId::LimRegenA);
    protection::Config {
        trip: AdcCounts::from_f32(
            TRIP_SHARE * p.get(ParamId::LimPhaseA) / p.board.current_a_per_count,
        ),
        bus_min: p.voltage(p.get(ParamId::LimBusVMin)),
        bus_max: p.voltage(bus_max_v),
        phase: current(ParamId::LimPhaseA),
        bus_draw: current(ParamId::LimBusA),
        bus_return: current(ParamId::LimRegenA),
        bus_return_v: p.voltage(bus_max_v - RETURN_BAND_V),
        bus_return_slope: p.gain(
            ParamId::LimRegenA,
            return_a / RETURN_BAND_V * p.scale.voltage_v / p.scale.current_a,
        ),
        bound_rate: p.factor(ParamId::PwmFreqHz, BOUND_RATE * p.period_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::delay::Delay;
    use crate::params::BOSSO_MOTOR;
    use crate::params::board::LeastDeadTime;

    #[test]
    fn the_defaults_make_a_drive() {
        build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit the bench");
    }

    #[test]
    fn nothing_stays_of_what_was_in_the_place_before() {
        let mut others = Params::of(&BOSSO_MOTOR);
        for (id, value) in [
            (ParamId::CtlObserver, 2.0),
            (ParamId::CtlRegulator, 2.0),
            (ParamId::CtlSpeed, 1.0),
            (ParamId::CtlAdaptL, 1.0),
            (ParamId::CtlDrive, 1.0),
            (ParamId::CtlModulation, 1.0),
            (ParamId::MotDir, 1.0),
            (ParamId::MotStop, 0.0),
            (ParamId::MotToneA, 0.0),
            (ParamId::MotRMohm, 54.0),
            (ParamId::MotLUh, 20.0),
            (ParamId::MotFluxMwb, 1.5),
            (ParamId::Inp3d, 1.0),
            (ParamId::LimPhaseA, 15.0),
            (ParamId::PwmFreqHz, 30_000.0),
            (ParamId::PwmDeadtimeNs, 700.0),
            (ParamId::StaRampA, 3.0),
            (ParamId::StaRunRpm, 400.0),
        ] {
            others.set(id, value).expect("in range");
        }
        let board = Board {
            shunts: Shunts::Two,
            delay: Delay::Half,
            ..Board::BENCH
        };
        let mut place = build(&others, &board).expect("it makes a drive");
        let wanted = build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit");
        build_in(&Params::of(&BOSSO_MOTOR), &Board::BENCH, &mut place).expect("the defaults fit");
        assert_eq!(place, wanted);
    }

    #[test]
    fn each_parameter_at_its_ends_makes_a_drive_or_a_reason() {
        for id in ParamId::ALL {
            for value in [id.entry().min, id.entry().max] {
                let mut params = Params::of(&BOSSO_MOTOR);
                if params.set(id, value).is_ok()
                    && let Err(error) = build(&params, &Board::BENCH)
                {
                    assert!(!error.reason.is_empty(), "{}", id.entry().name);
                }
            }
        }
    }

    #[test]
    fn a_dead_time_below_the_boards_is_refused_and_raised_at_the_start() {
        let board = Board {
            least_dead_time: LeastDeadTime {
                ns: 750.0,
                refusal: "below this board's 750 ns",
            },
            ..Board::BENCH
        };
        let mut params = Params::of(&BOSSO_MOTOR);
        for short_ns in [0.0, 500.0, 749.0] {
            params
                .set(ParamId::PwmDeadtimeNs, short_ns)
                .expect("in range");
            let error = build(&params, &board).expect_err("too short");
            assert_eq!(error.param, ParamId::PwmDeadtimeNs);
            assert_eq!(error.reason, "below this board's 750 ns");
        }
        // The emulator's bench takes any.
        params.set(ParamId::PwmDeadtimeNs, 0.0).expect("in range");
        build(&params, &Board::BENCH).expect("an ideal inverter");

        // A value that was chosen is named; the table's default, which nobody chose, is not.
        assert!(params.fit(&board));
        assert_eq!(params.get(ParamId::PwmDeadtimeNs), 750.0);
        let mut params = Params::of(&BOSSO_MOTOR);
        assert!(!params.fit(&board));
        assert_eq!(params.get(ParamId::PwmDeadtimeNs), 750.0);
        build(&params, &board).expect("the board's default");
        // What is long enough stays.
        params.set(ParamId::PwmDeadtimeNs, 900.0).expect("in range");
        assert!(!params.fit(&board));
        assert_eq!(params.get(ParamId::PwmDeadtimeNs), 900.0);
    }

    #[test]
    fn contradictions_are_refused_with_the_parameter() {
        let mut params = Params::of(&BOSSO_MOTOR);
        params.set(ParamId::CtlRpmMin, 7000.0).expect("in range");
        let error = build(&params, &Board::BENCH).expect_err("above the maximum");
        assert_eq!(error.param, ParamId::CtlRpmMin);
    }
}
