//! The top speed of a motor without a propeller, and what bounds it.
//!
//! The voltage is that of the machine's steady equations with no current along q. The most i_d, the speed where
//! weakening ends and the fastest one that samples follow are the control's own, as built from the parameters for a
//! board with three shunts. What the control has no public name for is repeated below, each with its place there;
//! `test_top_speed.py` fails where one no longer is the control's.

use std::f64::consts::{FRAC_2_PI, TAU};

use siskin_control::build::{BuildError, build};
use siskin_control::control::six_step::duty::WHOLE;
use siskin_control::control::voltage;
use siskin_control::drive::Config;
use siskin_params::choice::CtlMode;
use siskin_params::{Board, ParamId, Params};
use siskin_units::{Current, Voltage};

/// Fundamental of the voltage over the supply: of six-step, by its waveform, and of a vector to the hexagon's corners
/// (`LONGEST` of `control::modulator`).
const SIX_STEP: f64 = FRAC_2_PI;
const OVERMODULATED: f64 = 0.609;

/// Share of that fundamental which flux weakening uses; the rest keeps the current regulated (`MARGIN` of
/// `control::weakening`).
const RESERVED: f64 = 0.98;

/// Units of i_d for each turn a period that is left to the speed where weakening ends (`Config::weaken` of
/// `control::weakening`).
const TAPER: f64 = 128.0;

/// A speed that is not exceeded.
pub(crate) struct Bound {
    /// The parameter that sets it, the supply or the throttle.
    pub(crate) name: &'static str,
    pub(crate) rpm: f64,
    /// What happens there.
    pub(crate) reason: &'static str,
}

/// What bounds the speed of a motor.
pub(crate) struct TopSpeed {
    /// The lowest first.
    pub(crate) bounds: Vec<Bound>,
    /// PWM periods in an electrical turn at the lowest.
    pub(crate) turn_periods: f64,
}

impl TopSpeed {
    /// Computes the bounds at a supply voltage.
    ///
    /// # Errors
    /// The parameters make no drive.
    pub(crate) fn new(stated: &Params, supply_v: f64) -> Result<Self, BuildError> {
        let made = stated.in_force();
        let get = |id| f64::from(made.get(id));
        let config = build(stated, &any_board(&made))?;
        let per_rpm = get(ParamId::MotPolePairs) / 60.0;
        let mut bounds = Vec::new();
        if made.chosen(CtlMode::Speed) {
            bounds.push(Bound {
                name: "CTL_RPM_MAX",
                rpm: get(ParamId::CtlRpmMax),
                reason: "full throttle asks for it",
            });
        }
        if let Some(six_step) = &config.six_step {
            bounds.push(Bound {
                name: "PWM_FREQ_HZ",
                rpm: f64::from(config.scale.rpm(six_step.fastest)),
                reason: "the samples follow no faster commutation",
            });
        }
        let flux_wb = 1e-3 * f64::from(stated.get(ParamId::MotFluxMwb));
        if flux_wb > 0.0 {
            let motor = Motor {
                flux_wb,
                inductance_h: 1e-6 * get(ParamId::MotLUh),
                resistance_ohm: 1e-3 * get(ParamId::MotRMohm),
                pole_pairs: get(ParamId::MotPolePairs),
            };
            bounds.push(motor.bound(&config, supply_v));
            if made.chosen(CtlMode::Voltage) && config.six_step.is_none() {
                bounds.push(motor.throttle(&config, supply_v));
            }
        }
        bounds.sort_by(|a, b| a.rpm.total_cmp(&b.rpm));
        // There is one: six-step has that of its samples, and field orientation is refused without the flux.
        let turn_periods = get(ParamId::PwmFreqHz) / (per_rpm * bounds[0].rpm);
        Ok(Self {
            bounds,
            turn_periods,
        })
    }
}

/// A motor in SI units.
struct Motor {
    flux_wb: f64,
    inductance_h: f64,
    resistance_ohm: f64,
    pole_pairs: f64,
}

impl Motor {
    /// Converts an electrical speed.
    fn rpm(&self, rad_s: f64) -> f64 {
        60.0 * rad_s / (TAU * self.pole_pairs)
    }

    /// Returns the speed at which the voltage is used up.
    fn bound(&self, config: &Config, supply_v: f64) -> Bound {
        let modulator = &config.modulator;
        let share = if let Some(six_step) = &config.six_step {
            SIX_STEP * six_step.whole.to_num::<f64>()
        } else if overmodulates(config) {
            OVERMODULATED
        } else {
            modulator.vector_max.to_num()
        };
        let most_v = share * supply_v;
        let unweakened = Bound {
            name: "supply",
            rpm: self.rpm(most_v / self.flux_wb),
            reason: "its voltage is used up",
        };
        let weakened = weakens(config).then(|| self.weakened(config, RESERVED * most_v));
        weakened
            .filter(|weakened| weakened.rpm > unweakened.rpm)
            .unwrap_or(unweakened)
    }

    /// Returns the speed that full throttle asks for in voltage mode.
    fn throttle(&self, config: &Config, supply_v: f64) -> Bound {
        let switched: f64 = config.modulator.vector_max.to_num();
        let beyond: f64 = if config.weakening.most > Current::ZERO {
            voltage::beyond(WHOLE, Voltage::from_num(1.0)).to_num()
        } else {
            0.0
        };
        Bound {
            name: "throttle",
            rpm: self.rpm((1.0 + beyond) * switched * supply_v / self.flux_wb),
            reason: "in voltage mode the full one asks for no more",
        }
    }

    /// Returns the speed at which the flux cannot be weakened further.
    fn weakened(&self, config: &Config, most_v: f64) -> Bound {
        let (scale, weakening) = (&config.scale, &config.weakening);
        let end_rpm = f64::from(scale.rpm(weakening.end));
        let most_a = f64::from(scale.amperes(weakening.most));
        let a_per_rpm = TAPER * f64::from(scale.current_a * scale.period_s) / self.rpm(TAU);
        let left_a = |rpm: f64| (a_per_rpm * (end_rpm - rpm)).min(most_a);
        let is_reached = |rpm: f64| {
            let i_d = left_a(rpm);
            let induced_v = rpm / self.rpm(1.0) * (self.flux_wb - self.inductance_h * i_d);
            induced_v.hypot(self.resistance_ohm * i_d) <= most_v
        };
        let (mut low, mut high) = (0.0, end_rpm);
        while high - low > 0.1 {
            let middle = f64::midpoint(low, high);
            if is_reached(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let (name, reason) = if left_a(low) < most_a {
            (
                "LIM_BUS_V_MAX",
                "a bridge that turns off would rectify more",
            )
        } else {
            (
                "CTL_WEAKEN",
                "it or LIM_PHASE_A allows no further weakening of the flux",
            )
        };
        Bound {
            name,
            rpm: low,
            reason,
        }
    }
}

/// Returns whether the longest vectors exceed the length up to which every phase switches.
fn overmodulates(config: &Config) -> bool {
    config.modulator.over.vector_max > config.modulator.vector_max
}

/// Returns whether the drive weakens the flux: only longer vectors tell it how much voltage is missing.
fn weakens(config: &Config) -> bool {
    config.six_step.is_none() && config.weakening.most > Current::ZERO && overmodulates(config)
}

/// Returns the emulator's board with sensors that reach beyond the limits, so that it refuses nothing.
fn any_board(made: &Params) -> Board {
    let range_a = 2.0 * made.get(ParamId::LimPhaseA);
    Board {
        current_a_per_count: range_a / 2048.0,
        current_range_a: range_a,
        greatest_phase: Board::greatest_phase(range_a),
        ..Board::BENCH
    }
}
