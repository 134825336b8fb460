//! Coefficients of the second paper's position estimation.

use core::f32::consts::TAU;

use fixed::types::{I0F32, U0F32};

use super::formula::{fill, formulas};
use super::quantity::Quantity;
use super::si::{SLOW_SHARE, Si};
use crate::control::observer::edges::{Config, Sensors};
use crate::control::observer::flux_linkage::HighPass;
use crate::control::observer::{flux_linkage, position};
use crate::drive::Drift;
use crate::math::{Real, settled, square_root};
use crate::params::choice::{CtlFluxForm, CtlHall, CtlObserver};
use crate::params::from_motor::LEAST_SHARE;
use crate::params::{Board, ParamId, Params};
use crate::parts;
use crate::units::Angle;

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
        let quantities = Si::quantities();
        // They are the same on any board.
        let p = Si::new(params, &Board::BENCH, Drift::NONE, &quantities);
        p.prepare(Drift::NONE);
        Self::of(&p)
    }

    fn of(p: &Si) -> Self {
        p.set(Quantity::Turns, p.get(ParamId::CtlPosN));
        p.set(Quantity::Ae, p.get(ParamId::CtlAe));
        let formulas = formulas!(p, {
            define SlowRadS([LEAST_SHARE] * FastestRpm max RunRpm * [SLOW_SHARE] * PolePairs * Tau / [60.0]),
            define TauInt([TAU_INT] / SlowRadS),
            define Acceleration(SlewRpmS * PolePairs / [60.0]),
            // In turns and seconds, K = 2·(3N + 0.5)·α·A/ω², since every edge measures anew, and θ_ef =
            // (α·A/ω²)·(A_e/(1 − A_e))·6N·A.
            define Edges([6.0] * Turns + [1.0]),
            value whole_turns_above(Edges * Acceleration * [A_TURNS] / [K_MAX]),
            define Known([1.0] - Ae),
            define Lag(Ae / Known * [6.0] * Turns * [A_TURNS]),
            value filter_above(Acceleration * [A_TURNS] * Lag / [ERROR_TURNS]),
        });
        let whole_turns_above_hz = square_root(formulas.value());
        let filter_above_hz = square_root(formulas.value());
        let tau_int_s = p.of(Quantity::TauInt);
        Self {
            tau_int_s,
            tau_hpfs_s: match p.choice() {
                CtlFluxForm::FirstOrder | CtlFluxForm::FirstOrderStated => None,
                CtlFluxForm::SecondOrder | CtlFluxForm::SecondOrderStated => {
                    Some(HIGH_PASS_SHARE * tau_int_s)
                }
            },
            hold_off_turns: HOLD_OFF * A_TURNS,
            turns: p.of(Quantity::Turns),
            whole_turns_above_hz,
            a_e: p.of(Quantity::Ae),
            filter_above_hz,
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
    fill!(p, crossing, {
        define SlowRadS(SlowRpm * PolePairs * Tau / [60.0] * T),
        count patience([PATIENCE * A_TURNS * TAU] / SlowRadS),
    });
    estimator(p, &settings, &mut place.position);
    place.hall.patience = p.periods(HALL_PATIENCE_S);
    fill!(p, place, {
        number flux_above(RunRpm * TurnsPerRpm),
        number hall_below(SlowRpm * TurnsPerRpm),
    });
}

/// Sets up the flux integrators: sections 2.2 and 2.3.
fn integrators(p: &Si, settings: &FluxSettings, place: &mut flux_linkage::Config) {
    define_filter(p, settings.tau_int_s);
    fill!(p, place, {
        gain resistance(MotRMohm, R * UnitA / UnitV),
        gain inductance(MotLUh, L * UnitA / UnitWb),
        gain forget(StaRunRpm, Share),
        number corner(T / CornerS),
        define StatorFlux(L * UnitA / UnitWb),
        number stator_max(LimitA / UnitA * StatorFlux),
    });
    if let Some(tau_s) = settings.tau_hpfs_s {
        define_filter(p, tau_s);
        let high_pass = place.high_pass.insert(HighPass::default());
        fill!(p, high_pass, {
            gain share(StaRunRpm, Share),
            number corner(T / CornerS),
        });
    }
    place.adaptive = matches!(
        p.choice(),
        CtlFluxForm::FirstOrder | CtlFluxForm::SecondOrder
    );
}

/// Defines a filter by its time constant: its share of a step per period, and 2π times that constant.
fn define_filter(p: &Si, tau_s: f32) {
    p.set(Quantity::Share, settled(p.scale.period_s / tau_s));
    p.set(Quantity::CornerS, TAU * tau_s);
}

/// Sets up the position estimator: section 2.4.
fn estimator(p: &Si, settings: &FluxSettings, place: &mut position::Config) {
    place.turns = p.params.number(ParamId::CtlPosN);
    p.set(Quantity::WholeTurnsHz, settings.whole_turns_above_hz);
    p.set(Quantity::FilterHz, settings.filter_above_hz);
    fill!(p, place, {
        define WholeTurnsRpm(WholeTurnsHz * [60.0] / PolePairs),
        number whole_turns_above(WholeTurnsRpm * TurnsPerRpm),
        gain a_e(CtlAe, Ae),
        define FilterRpm(FilterHz * [60.0] / PolePairs),
        number filter_above(FilterRpm * TurnsPerRpm),
    });
    place.compensates = true;
}
