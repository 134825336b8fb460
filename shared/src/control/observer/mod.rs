//! Position observers: from voltages and currents to the rotor's angle and speed.
//!
//! Each is called once per period with the same [`Input`] and returns the same [`Estimate`].

pub mod back_emf;
pub mod compensated;
pub mod crossing;
pub mod edges;
mod estimate;
pub mod flux_linkage;
pub mod given;
pub mod hall;
pub mod limits;
pub mod position;
pub mod sector;

use siskin_params::parts;
use siskin_units::math::{EIGHTH_PI, SinCos, TopProduct};
use siskin_units::trace::Trace;
use siskin_units::{Angle, Current, FLUX_NOMINAL, Flux, Speed, Voltage, WideVoltage, wide};

use super::inductance::Factor;
use super::regulator::Feedback;
use super::transform::{AlphaBeta, Dq, phases};
pub use estimate::{Estimate, Input, SlowEstimate};

/// The selected observer (`CTL_OBSERVER`) and its coefficients.
#[derive(Clone, Debug, PartialEq)]
pub enum Config {
    /// Adaptive back-EMF.
    BackEmf(back_emf::Config, parts::BackEmf),
    /// Crossings of the flux linkages, Hall sensors, or both.
    Edges(edges::Config),
    /// Compensated flux with a phase-locked loop.
    Compensated(compensated::Config),
    /// None: the caller supplies the rotor's position, see [`drive::State::place`](crate::drive::State::place).
    Given(parts::Bench),
}

impl Default for Config {
    fn default() -> Self {
        Self::Compensated(compensated::Config::default())
    }
}

/// The observers' states; only the selected one's changes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Adaptive back-EMF.
    pub back_emf: back_emf::State,
    /// Crossings of the flux linkages, Hall sensors, or both.
    pub edges: edges::State,
    /// Compensated flux with a phase-locked loop.
    pub compensated: compensated::State,
    /// The position reported to the drive for this period.
    pub given: given::State,
    /// The slow part of the estimate; [`schedule_gains`] updates it for the compensated flux observer.
    pub slow_estimate: SlowEstimate,
}

impl Config {
    /// Advances the observer from the last sample to this one. `imposed` is the speed that an open-loop start
    /// imposes on the rotor.
    #[inline(always)] // in each period
    pub fn estimate(&self, state: &mut State, input: &Input, imposed: Option<Speed>) -> Estimate {
        match self {
            Self::BackEmf(config, _) => {
                let (estimate, slow) =
                    back_emf::estimate(config, &mut state.back_emf, imposed, input.reference_step);
                state.slow_estimate = slow;
                estimate
            }
            Self::Edges(config) => {
                let (v, i) = (phases(input.v), phases(input.i));
                let position = edges::estimate(config, &mut state.edges, v, i, input.hall);
                state.slow_estimate = SlowEstimate {
                    omega_bar_step: position.omega_step,
                    lost: !position.known,
                    ..SlowEstimate::default()
                };
                Estimate {
                    theta: position.theta,
                    frame: SinCos::of(position.theta),
                    omega: position.omega,
                    omega_bar: position.omega,
                }
            }
            Self::Compensated(config) => {
                compensated::estimate(config, &mut state.compensated, input, imposed)
            }
            Self::Given(_) => {
                let (estimate, slow) = given::estimate(&state.given, input.swapped);
                state.slow_estimate = slow;
                estimate
            }
        }
    }

    /// Returns true if observation during alignment counts; otherwise [`begin_aligned`] restarts the observer.
    pub fn follows_park(&self) -> bool {
        !matches!(self, Self::Compensated(_))
    }

    /// Returns the current regulator's feedback: the speed of the control's frame, the measured current in it, and
    /// the observer's estimates.
    #[inline(always)] // in each period
    pub fn feedback(
        &self,
        state: &State,
        (omega, i): (Speed, Dq<Current>),
        inductance: Factor,
    ) -> Feedback {
        let (i_hat, h_hat) = match self {
            Self::BackEmf(..) => {
                let h = state.back_emf.h;
                let (d, q) = (wide(h.d), wide(h.q));
                (state.back_emf.i, Dq { d, q })
            }
            Self::Edges(_) | Self::Given(_) => (i, emf(omega, FLUX_NOMINAL)),
            Self::Compensated(_) => {
                let d = WideVoltage::ZERO;
                let q = state.compensated.emf().wrapping_neg();
                (i, Dq { d, q })
            }
        };
        Feedback {
            omega,
            i,
            i_hat,
            h_hat,
            inductance,
        }
    }

    /// Tells the observer the voltage `u` commanded in this period, in the feedback's frame. Only the adaptive
    /// back-EMF observer works in that frame.
    #[inline(always)] // in each period
    pub fn advance(&self, state: &mut State, fb: &Feedback, u: Dq<Voltage>) {
        if let Self::BackEmf(config, _) = self {
            back_emf::advance(config, &mut state.back_emf, fb, u);
        }
    }

    /// Returns true if [`Config::advance`] has any effect: only the adaptive back-EMF observer works in the control's
    /// frame.
    pub fn works_in_frame(&self) -> bool {
        matches!(self, Self::BackEmf(..))
    }
}

/// Updates the gains every `periods` periods, by the speed and the requested current `i_q`, and refreshes
/// [`State::slow_estimate`].
pub fn schedule_gains(
    config: &Config,
    state: &mut State,
    (inductance, i_q): (Factor, Current),
    periods: u32,
) {
    if let Config::Compensated(config) = config {
        state.slow_estimate = compensated::slow_estimate(config, &state.compensated, periods);
        compensated::schedule_gains(config, &mut state.compensated, inductance, i_q);
    }
}

/// Begins a start: the rotor stands where this sample's position sensors say. Returns false if there are none to
/// tell; the rotor must then be parked, by the control's frame, which is at angle `frame`.
pub fn begin_at_rest(config: &Config, state: &mut State, frame: Angle, hall: u8) -> bool {
    state.clear(config);
    match config {
        Config::BackEmf(config, _) => {
            state.back_emf = back_emf::begin(config, frame, Speed::ZERO);
            false
        }
        Config::Edges(config) => edges::begin_at_rest(config, &mut state.edges, hall),
        Config::Compensated(_) => false,
        Config::Given(_) => true,
    }
}

/// Returns true if a position sensor has failed.
pub fn sensor_fault(state: &State) -> bool {
    state.edges.hall.fault
}

/// Returns ĥ of a flux along d: −ω·φ along q.
#[inline(always)] // in each period
fn emf(omega: Speed, flux: Flux) -> Dq<WideVoltage> {
    // A speed in turns takes 2π: 16·π/8, and the sixteenth is the difference in fraction bits.
    let length = omega.top(flux).top(EIGHTH_PI).to_bits();
    Dq {
        d: WideVoltage::ZERO,
        q: WideVoltage::from_bits(-length),
    }
}

/// Returns φ̂, the rotor's flux along d.
pub fn flux(config: &Config, state: &State) -> Flux {
    match config {
        Config::BackEmf(..) => back_emf::flux(&state.back_emf),
        Config::Edges(_) => state.edges.flux.amplitude,
        Config::Compensated(_) => state.compensated.phi,
        Config::Given(_) => FLUX_NOMINAL,
    }
}

/// Begins with a rotor known to turn at `omega` and to be at `theta` at the next sample, with the current `i`. Call
/// [`schedule_gains`] first.
pub fn begin(
    config: &Config,
    state: &mut State,
    (theta, omega): (Angle, Speed),
    i: AlphaBeta<Current>,
) {
    state.clear(config);
    match config {
        Config::BackEmf(config, _) => state.back_emf = back_emf::begin(config, theta, omega),
        Config::Edges(config) => {
            // Its state is that of the previous sample.
            let before = theta.wrapping_sub(omega.over_period());
            edges::begin(config, &mut state.edges, before, omega, phases(i));
        }
        Config::Compensated(config) => {
            compensated::begin(config, &mut state.compensated, (theta, omega), i);
        }
        Config::Given(_) => {}
    }
}

/// Begins with the aligned rotor, which turns at `omega`, if at all, and is at `theta` at the next sample, with the
/// current `i`.
pub fn begin_aligned(
    config: &Config,
    state: &mut State,
    (theta, omega): (Angle, Speed),
    i: AlphaBeta<Current>,
) {
    match config {
        // The former works in the frame that the start imposes, the latter needs no start.
        Config::BackEmf(..) | Config::Given(_) => {}
        Config::Edges(config) => {
            edges::begin(config, &mut state.edges, theta, omega, phases(i));
        }
        Config::Compensated(config) => {
            compensated::begin(config, &mut state.compensated, (theta, omega), i);
        }
    }
}

/// Hands over from the open-loop start, whose frame turns at `omega_s` and is at `frame`: returns the angle by
/// which the rotor leads that frame, from where the observer continues. `None` if the rotor has not followed.
pub fn take_over(
    config: &Config,
    state: &mut State,
    frame: Angle,
    omega_s: Speed,
) -> Option<Angle> {
    match config {
        Config::BackEmf(config, _) => back_emf::take_over(config, &mut state.back_emf, omega_s),
        Config::Edges(_) => {
            edges::locked_angle(&state.edges).map(|theta| theta.wrapping_sub(frame))
        }
        Config::Compensated(_) => {
            compensated::locked_angle(&state.compensated).map(|theta| theta.wrapping_sub(frame))
        }
        // Never started by an imposed frame.
        Config::Given(_) => None,
    }
}

impl State {
    /// Resets the selected observer, except for what it knows of its sensors.
    fn clear(&mut self, config: &Config) {
        self.slow_estimate = SlowEstimate::default();
        match config {
            // A start or a catch sets its whole state.
            Config::BackEmf(..) | Config::Given(_) => {}
            Config::Edges(_) => {
                let hall = self.edges.hall.clone();
                self.edges = edges::State {
                    hall,
                    ..edges::State::default()
                };
            }
            Config::Compensated(_) => self.compensated = compensated::State::default(),
        }
    }

    /// Emits every word of the selected observer's state; the others are idle.
    pub fn trace(&self, config: &Config, out: &mut impl FnMut(u32)) {
        let Self {
            back_emf,
            edges,
            compensated,
            given,
            slow_estimate,
        } = self;
        slow_estimate.trace(out);
        match config {
            Config::BackEmf(..) => back_emf.trace(out),
            Config::Edges(_) => edges.trace(out),
            Config::Compensated(_) => compensated.trace(out),
            Config::Given(_) => given.trace(out),
        }
    }
}
