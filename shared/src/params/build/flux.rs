//! The coefficients of the second paper's position estimation.

use core::f32::consts::TAU;

use fixed::types::{I0F32, U0F32};

use super::si::{SLOW_SHARE, Si};
use crate::control::observer::edges::{Config, Sensors};
use crate::control::observer::flux_linkage::HighPass;
use crate::control::observer::{crossing, flux_linkage, hall, position};
use crate::math::{Real, settled, square_root};
use crate::params::choice::{CtlFluxForm, CtlHall, CtlObserver};
use crate::params::{FromMotor, ParamId, Params};
use crate::units::{Angle, Flux, Speed};

/// τ_int·ω where Run ends with the defaults, at half of `STA_RUN_RPM`: there the first-order integrator
/// leads by 10° (2.2.2).
///
/// A `CTL_RPM_MIN` below `STA_RUN_RPM` does not lengthen it. What a start leaves in the integrals, and
/// what one period of them winds up behind an angle that is wrong, must be forgotten within some turns
/// of the speed at which Run begins, or neither ever goes: with three times the time constant the drive
/// swings about 640 rpm whatever is asked for. The greater lead at such speeds is known, and taken off.
const TAU_INT: f32 = 5.671;

/// τ_HPFS over τ_int, much above 1 (figure 21): to a lead of 10° it adds 1°.
const HIGH_PASS_SHARE: f32 = 10.0;

/// Half the deadband of the flux, as a share of its amplitude: 3° of the rotor (2.3.2).
const DEADBAND: f32 = 0.05;

/// Hold-off, as a share of the sixth of a turn between crossings (2.3.2).
const HOLD_OFF: f32 = 0.05;

/// Time for which the next edge may be missing, in sixths of a turn at the least speed.
const PATIENCE: f32 = 2.0;

/// Time for which all Hall sensors may be alike, s: far longer than their edges differ.
const HALL_PATIENCE_S: f32 = 1e-3;

/// The position error that an acceleration of `CTL_SLEW_RPM_S` may make, turns: 10°.
const ERROR_TURNS: f32 = 10.0 / 360.0;

/// A, the angle of extrapolation: 60°.
const A_TURNS: f32 = 1.0 / 6.0;

/// Greatest K of appendix A for that error while braking, 1/√(1 − K) − 1 of A; accelerating, where
/// the paper has 0.44 for it, it is smaller.
const K_MAX: f32 = 0.265;

/// The second paper's time constants and filters from the parameters: the input of its Table 1
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
    /// Electrical speed below which it is measured from edge to edge, turns/s: N is 1/6 there.
    pub whole_turns_above_hz: f32,
    /// A_e, the share of the extrapolated angle that a crossing leaves (2.4.2).
    pub a_e: f32,
    /// Electrical speed above which A_e counts, turns/s.
    pub filter_above_hz: f32,
}

impl FluxSettings {
    /// Those of a drive with these parameters.
    ///
    /// The speeds from which whole turns and the filter are used follow from the errors that the paper
    /// gives for the greatest acceleration that the drive asks for.
    pub fn new(params: &Params) -> Self {
        let from_motor = FromMotor::new(params);
        let get = |id| params.get(id);
        let tau_int_s = TAU_INT / rad_s(params, SLOW_SHARE * from_motor.run_rpm);
        let (n, a_e) = (get(ParamId::CtlPosN), get(ParamId::CtlAe));
        let alpha = from_motor.slew_rpm_s * get(ParamId::MotPolePairs) / 60.0;
        // In turns and seconds, K = 2·(3N + 0.5)·α·A/ω², as every edge measures again, and
        // θ_ef = (α·A/ω²)·(A_e/(1 − A_e))·6N·A.
        let lag = a_e / (1.0 - a_e) * 6.0 * n * A_TURNS;
        Self {
            tau_int_s,
            tau_hpfs_s: match params.choice() {
                CtlFluxForm::FirstOrder | CtlFluxForm::FirstOrderStated => None,
                CtlFluxForm::SecondOrder | CtlFluxForm::SecondOrderStated => {
                    Some(HIGH_PASS_SHARE * tau_int_s)
                }
            },
            hold_off_turns: HOLD_OFF * A_TURNS,
            turns: n,
            whole_turns_above_hz: square_root((6.0 * n + 1.0) * alpha * A_TURNS / K_MAX),
            a_e,
            filter_above_hz: square_root(alpha * A_TURNS * lag / ERROR_TURNS),
        }
    }
}

/// The electrical speed of mechanical rpm, rad/s.
fn rad_s(params: &Params, rpm: f32) -> f32 {
    rpm * params.get(ParamId::MotPolePairs) * TAU / 60.0
}

/// Sections 2.2 to 2.4.
pub(super) fn edges(p: &Si) -> Config {
    let get = |id| p.get(id);
    let settings = FluxSettings::new(p.params);
    let flux_per_current = p.inductance_h * p.scale.current_a / p.scale.flux_wb();
    // In a period, a filter of this time constant goes this share of its way.
    let share = |tau_s: f32| settled(p.period_s / tau_s);
    let corner = |tau_s: f32| Speed::from_f32(p.period_s / (TAU * tau_s));
    let high_pass = settings.tau_hpfs_s.map(|tau_s| HighPass {
        share: p.gain(ParamId::StaRunRpm, share(tau_s)),
        corner: corner(tau_s),
    });
    Config {
        sensors: match (p.choice(), p.choice()) {
            (CtlObserver::Hall, CtlHall::Alone) => Sensors::Hall,
            (CtlObserver::Hall, CtlHall::Merged) => Sensors::Merged,
            _ => Sensors::None,
        },
        flux: flux_linkage::Config {
            resistance: p.gain(
                ParamId::MotRMohm,
                p.resistance_ohm * p.scale.current_a / p.scale.voltage_v,
            ),
            inductance: p.gain(ParamId::MotLUh, flux_per_current),
            forget: p.gain(ParamId::StaRunRpm, share(settings.tau_int_s)),
            corner: corner(settings.tau_int_s),
            high_pass,
            stator_max: Flux::from_f32(
                get(ParamId::LimPhaseA) / p.scale.current_a * flux_per_current,
            ),
            adaptive: matches!(
                p.choice(),
                CtlFluxForm::FirstOrder | CtlFluxForm::SecondOrder
            ),
        },
        crossing: crossing::Config {
            deadband: I0F32::from_f32(DEADBAND),
            deadband_angle: Angle::from_f32(libm::asinf(DEADBAND) / TAU),
            hold_off: U0F32::from_f32(settings.hold_off_turns),
            patience: (PATIENCE * A_TURNS * TAU / (rad_s(p.params, p.slow_rpm()) * p.period_s))
                as u32,
        },
        position: estimator(p, &settings),
        hall: hall::Config {
            patience: (HALL_PATIENCE_S / p.period_s) as u32,
        },
        flux_above: p.scale.speed_from_rpm(p.from_motor.run_rpm),
        hall_below: p.slow(),
    }
}

/// Section 2.4.
fn estimator(p: &Si, settings: &FluxSettings) -> position::Config {
    let speed = |turns_per_s: f32| p.scale.speed_from_rpm(turns_per_s * 60.0 / p.pole_pairs);
    position::Config {
        turns: settings.turns as u8,
        whole_turns_above: speed(settings.whole_turns_above_hz),
        a_e: p.gain(ParamId::CtlAe, settings.a_e),
        filter_above: speed(settings.filter_above_hz),
        compensates: true,
    }
}
