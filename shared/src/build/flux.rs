//! Coefficients of the second paper's position estimation.

use core::f32::consts::TAU;

use fixed::types::{I0F32, U0F32};
use siskin_params::choice::{CtlFluxForm, CtlHall, CtlObserver};
use siskin_params::{Board, LEAST_SHARE, ParamId, Params, parts};
use siskin_units::math::{Real, settled, square_root};
use siskin_units::{Angle, Flux, Speed};

use super::si::{SLOW_SHARE, Si};
use crate::control::observer::edges::{Config, Sensors};
use crate::control::observer::flux_linkage::HighPass;
use crate::control::observer::{flux_linkage, position};
use crate::drive::Drift;

/// τ_int·ω at half of `STA_RUN_RPM`, where Run ends with the defaults: there the first-order integrator leads by 10°
/// (2.2.2).
///
/// A `CTL_RPM_MIN` below `STA_RUN_RPM` does not lengthen it, nor does a `STA_RUN_RPM` below the least that follows from
/// the motor. What a start leaves in the integrals, and what one period of integration winds up behind a wrong angle,
/// must decay before the drive has accelerated far beyond it, or neither does for seconds: with one and a half times
/// the time constant the bench swings about 640 rpm whatever the command. The larger lead at low speed is known and
/// subtracted.
const TAU_INT: f32 = 5.671;

/// τ_HPFS over τ_int, much above 1 (figure 21): it adds 1° to a lead of 10°.
const HIGH_PASS_SHARE: f32 = 10.0;

/// Half the flux deadband over the flux amplitude: 3° of the rotor (2.3.2).
const DEADBAND: f32 = 0.05;

/// Hold-off over the sixth of a turn between crossings (2.3.2).
const HOLD_OFF: f32 = 0.05;

/// Time for which the next edge may be missing, in sixths of a turn at the least speed.
const PATIENCE: f32 = 2.0;

/// Time for which all Hall sensors may read alike, s: far longer than their edges differ.
const HALL_PATIENCE_S: f32 = 1e-3;

/// Position error allowed at an acceleration of `CTL_SLEW_RPM_S`, turns: 10°.
const ERROR_TURNS: f32 = 10.0 / 360.0;

/// A, the extrapolated angle: 60°.
const A_TURNS: f32 = 1.0 / 6.0;

/// Greatest K of appendix A for that error while braking, 1/√(1 − K) − 1 of A. Accelerating, where the paper has K =
/// 0.44, the error is smaller.
const K_MAX: f32 = 0.265;

/// The second paper's time constants and filters, from the parameters: the input of its Table 1
/// ([`limits`](crate::control::observer::limits)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxSettings {
    /// τ_int, s (2.2.2).
    pub tau_int_s: f32,
    /// τ_HPFS of the second-order form, s.
    pub tau_hpfs_s: Option<f32>,
    /// Hold-off after a crossing, electrical turns at the estimated speed (2.3.2).
    pub hold_off_turns: f32,
    /// N, electrical turns over which the speed is measured (2.4.1).
    pub turns: f32,
    /// Electrical speed below which N is 1/6, turns/s: the speed is then measured from edge to edge.
    pub whole_turns_above_hz: f32,
    /// A_e, the share of the extrapolated angle that a crossing leaves (2.4.2).
    pub a_e: f32,
    /// Electrical speed above which A_e applies, turns/s.
    pub filter_above_hz: f32,
}

impl FluxSettings {
    /// Creates the settings of a drive with these parameters.
    ///
    /// The speeds above which whole turns and the filter are used follow from the paper's errors at the greatest
    /// acceleration that the drive commands.
    pub fn new(params: &Params) -> Self {
        // They are the same on any board.
        Self::of(&Si::new(params, &Board::BENCH, Drift::NONE))
    }

    fn of(p: &Si) -> Self {
        let (turns, a_e) = (p.get(ParamId::CtlPosN), p.get(ParamId::CtlAe));
        let slow_rpm = (LEAST_SHARE * p.fastest_rpm).max(p.settings.run_rpm) * SLOW_SHARE;
        let tau_int_s = TAU_INT / (slow_rpm * p.pole_pairs * TAU / 60.0);
        // In turns and seconds, K = 2·(3N + 0.5)·α·A/ω², since every edge measures anew, and θ_ef =
        // (α·A/ω²)·(A_e/(1 − A_e))·6N·A.
        let acceleration = p.settings.slew_rpm_s * p.pole_pairs / 60.0;
        let edges = 6.0 * turns + 1.0;
        let lag = a_e / (1.0 - a_e) * 6.0 * turns * A_TURNS;
        Self {
            tau_int_s,
            tau_hpfs_s: match p.choice() {
                CtlFluxForm::FirstOrder | CtlFluxForm::FirstOrderStated => None,
                CtlFluxForm::SecondOrder | CtlFluxForm::SecondOrderStated => {
                    Some(HIGH_PASS_SHARE * tau_int_s)
                }
            },
            hold_off_turns: HOLD_OFF * A_TURNS,
            turns,
            whole_turns_above_hz: square_root(edges * acceleration * A_TURNS / K_MAX),
            a_e,
            filter_above_hz: square_root(acceleration * A_TURNS * lag / ERROR_TURNS),
        }
    }
}

/// Returns the source of the edges, if this build has it.
pub(super) fn sensors(p: &Si) -> Option<Sensors> {
    let (crossings, hall) = (parts::FluxCrossings::get(), parts::Hall::get());
    match (p.choice(), p.choice()) {
        (CtlObserver::Hall, CtlHall::Alone) => hall.map(Sensors::Hall),
        (CtlObserver::Hall, CtlHall::Merged) => Some(Sensors::Merged(hall?, crossings?)),
        _ => crossings.map(Sensors::None),
    }
}

/// Sets up the edge-based position estimation: sections 2.2 to 2.4.
pub(super) fn edges(p: &Si, place: &mut Config) {
    let settings = FluxSettings::of(p);
    integrators(p, &settings, &mut place.flux);
    let crossing = &mut place.crossing;
    crossing.deadband = I0F32::from_f32(DEADBAND);
    crossing.deadband_angle = Angle::from_f32(libm::asinf(DEADBAND) / TAU);
    crossing.hold_off = U0F32::from_f32(settings.hold_off_turns);
    // In radians per period.
    let slowest = p.slow_rpm * p.pole_pairs * TAU / 60.0 * p.t;
    crossing.patience = (PATIENCE * A_TURNS * TAU / slowest) as u32;
    estimator(p, &settings, &mut place.position);
    place.hall.patience = p.periods(HALL_PATIENCE_S);
    place.flux_above = p.scale.speed_from_rpm(p.settings.run_rpm);
    place.hall_below = p.scale.speed_from_rpm(p.slow_rpm);
}

/// Sets up the flux integrators: sections 2.2 and 2.3.
fn integrators(p: &Si, settings: &FluxSettings, place: &mut flux_linkage::Config) {
    let stator_flux = p.l * p.unit_a / p.unit_wb;
    let tau_s = settings.tau_int_s;
    place.resistance = p.gain(ParamId::MotRMohm, p.r * p.unit_a / p.unit_v);
    place.inductance = p.gain(ParamId::MotLUh, stator_flux);
    place.forget = p.gain(ParamId::StaRunRpm, settled(p.t / tau_s));
    place.corner = corner(p, tau_s);
    place.stator_max = Flux::from_f32(p.limit_a / p.unit_a * stator_flux);
    if let Some(tau_s) = settings.tau_hpfs_s {
        let high_pass = place.high_pass.insert(HighPass::default());
        high_pass.share = p.gain(ParamId::StaRunRpm, settled(p.t / tau_s));
        high_pass.corner = corner(p, tau_s);
    }
    place.adaptive = matches!(
        p.choice(),
        CtlFluxForm::FirstOrder | CtlFluxForm::SecondOrder
    );
}

/// Returns the corner of a filter with this time constant.
fn corner(p: &Si, tau_s: f32) -> Speed {
    Speed::from_f32(p.t / (TAU * tau_s))
}

/// Sets up the position estimator: section 2.4.
fn estimator(p: &Si, settings: &FluxSettings, place: &mut position::Config) {
    place.turns = p.params.number(ParamId::CtlPosN);
    let speed = |hz: f32| p.scale.speed_from_rpm(hz * 60.0 / p.pole_pairs);
    place.whole_turns_above = speed(settings.whole_turns_above_hz);
    place.a_e = p.gain(ParamId::CtlAe, settings.a_e);
    place.filter_above = speed(settings.filter_above_hz);
    place.compensates = true;
}
