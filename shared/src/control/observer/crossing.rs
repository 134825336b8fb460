//! The flux comparator (second paper, section 2.3): zero crossings of the three fluxes, with hysteresis, hold-off
//! and commutation order. Forward rotation only.

use fixed::types::{I0F32, U0F32};
use siskin_units::math::{Held, TopProduct, divide};
use siskin_units::{Angle, Flux, Speed, traced};

use super::flux_linkage::{AMPLITUDE_MAX, AMPLITUDE_MIN, measure};
use super::position::{Periods, turned};
use super::sector::Sector;

/// Limits that keep noise from passing for a crossing (2.3.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// How far beyond zero a flux must be, as a share of the amplitude: half the deadband, below 0.5.
    pub deadband: I0F32,
    /// The rotor angle at which a flux is that far: its arcsine.
    pub deadband_angle: Angle,
    /// Hold-off after each crossing, as an angle at the estimated speed.
    pub hold_off: U0F32,
    /// Periods without a crossing after which the rotor counts as lost.
    pub patience: u32,
}

traced! {
    /// The comparator's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// The sector that the last crossing began.
        pub sector: Sector,
        /// Periods since that crossing's sample.
        pub since: u32,
        /// Confidence in the crossings, 0 to 12: a sound one adds one, any other takes three.
        pub sound: u8,
        /// The crossings tell where the rotor is.
        pub tracks: bool,
    }
}

/// A crossing of the phase and direction that was due next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The sector it begins.
    pub sector: Sector,
    /// How long before the sample the flux passed the deadband, at most one period.
    pub late: Periods,
    /// Amplitude of the flux.
    pub amplitude: Flux,
}

/// Maximum of [`State::sound`].
const SOUND_MAX: u8 = 12;
/// From here the crossings are trusted: one turn's worth.
const SOUND: u8 = 6;
/// Confidence lost by an implausible crossing.
const UNSOUND: u8 = 3;

/// A crossing is unsound if the rotor has turned less than this since the last: a third of the sixth of a
/// turn it should have. (Arriving late is no sign of noise.)
const LEAST_TURNED: u64 = (1 << 32) / 18;

/// Begins in the sector of the flux angle, trusting the crossings to come.
pub fn begin(state: &mut State, lambda_angle: Angle) {
    *state = State {
        sector: Sector::of(lambda_angle),
        since: 0,
        sound: SOUND,
        tracks: true,
    };
}

/// Looks for the next crossing in the fluxes of this sample and the previous one.
///
/// Compares only the flux that is next in commutation order, by level: it catches up a missed crossing, and from a
/// wrong sector finds the right one.
pub fn detect(
    config: &Config,
    state: &mut State,
    before: &[Flux; 3],
    now: &[Flux; 3],
    amplitude: Flux,
    omega: Speed,
) -> Option<Crossing> {
    state.since = state.since.saturating_add(1);
    let next = state.sector.next();
    let edge = next.edge();
    let beyond = |fluxes: &[Flux; 3]| {
        let flux = fluxes[edge.phase];
        let forwards = if edge.rising {
            flux
        } else {
            flux.saturating_neg()
        };
        forwards.minus(config.deadband.top(amplitude))
    };
    let excess = beyond(now);
    if excess > Flux::ZERO {
        return accept(config, state, next, (beyond(before), excess), now, omega);
    }
    if state.since >= config.patience {
        state.sound = 0;
        state.tracks = false;
    }
    None
}

/// Handles a flux beyond the deadband: a crossing, unless held off.
fn accept(
    config: &Config,
    state: &mut State,
    sector: Sector,
    (before, excess): (Flux, Flux),
    now: &[Flux; 3],
    omega: Speed,
) -> Option<Crossing> {
    let turned = turned(state.since, omega);
    let knows_speed = omega > Speed::ZERO;
    if knows_speed && turned < u64::from(config.hold_off.to_bits()) {
        return None;
    }
    let amplitude = measure(now, sector);
    let sound = (!knows_speed || turned >= LEAST_TURNED)
        && (AMPLITUDE_MIN..=AMPLITUDE_MAX).contains(&amplitude);
    state.sound = if sound {
        (state.sound + 1).min(SOUND_MAX)
    } else {
        state.sound.saturating_sub(UNSOUND)
    };
    state.tracks = state.sound >= SOUND || (state.tracks && state.sound > 0);
    state.sector = sector;
    state.since = 0;
    // If it was already beyond, the hold-off delayed the crossing, or it came out of order.
    let late = if before < Flux::ZERO {
        ratio(excess, excess.minus(before))
    } else {
        Periods::ONE
    };
    Some(Crossing {
        sector,
        late,
        amplitude,
    })
}

/// Returns the time, in periods, in which a flux covers `part` when it covers `whole` per period; at most one
/// period.
fn ratio(part: Flux, whole: Flux) -> Periods {
    let (part, whole) = (part.to_bits().max(0), whole.to_bits().max(1));
    let share = divide((part as u64) << Periods::FRAC_NBITS, whole as u32);
    Periods::from_bits(share as u32).min(Periods::ONE)
}

impl State {
    /// Returns true if a whole turn of crossings has been sound.
    pub fn trusted(&self) -> bool {
        self.tracks && self.sound >= SOUND
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_2_PI, TAU};
    use std::vec::Vec;

    use siskin_units::FLUX_NOMINAL;

    fn config() -> Config {
        Config {
            deadband: I0F32::from_num(0.1),
            deadband_angle: Angle::from_num(0.1_f64.asin() / TAU),
            hold_off: U0F32::from_num(0.05 / 6.0),
            patience: 1000,
        }
    }

    fn fluxes(turns: f64) -> [f64; 3] {
        [0.0, -1.0, 1.0].map(|third| FRAC_2_PI * (TAU * (turns + third / 3.0)).cos())
    }

    struct Run {
        config: Config,
        state: State,
        before: [Flux; 3],
        omega: Speed,
    }

    impl Run {
        fn new(turns: f64, omega: f64) -> Self {
            let mut state = State::default();
            begin(&mut state, Angle::wrapping_from_num(turns));
            Self {
                config: config(),
                state,
                before: fluxes(turns).map(Flux::from_num),
                omega: Speed::from_num(omega),
            }
        }

        fn step(&mut self, now: [f64; 3]) -> Option<Crossing> {
            let now = now.map(Flux::from_num);
            let found = detect(
                &self.config,
                &mut self.state,
                &self.before,
                &now,
                FLUX_NOMINAL,
                self.omega,
            );
            self.before = now;
            found
        }
    }

    #[test]
    fn crossings_come_in_order_at_the_deadband_with_their_time() {
        let omega = 0.0137;
        let mut run = Run::new(0.0, omega);
        let mut sector = run.state.sector;
        let mut count = 0;
        for k in 1..1000 {
            let turns = omega * f64::from(k);
            let Some(found) = run.step(fluxes(turns)) else {
                continue;
            };
            count += 1;
            assert_eq!(found.sector, sector.next());
            sector = found.sector;
            // The rotor was at the edge plus the deadband angle that long before.
            let edge = sector.begin().to_num::<f64>() + 0.1_f64.asin() / TAU;
            let error = turns - omega * found.late.to_num::<f64>() - edge;
            let degrees = ((error + 0.5).rem_euclid(1.0) - 0.5) * 360.0;
            assert!(degrees.abs() < 0.1, "{degrees}");
            let amplitude = found.amplitude.to_num::<f64>();
            assert!((0.6..0.65).contains(&amplitude), "{amplitude}");
        }
        assert_eq!(count, 82, "six a turn");
        assert!(run.state.trusted());
    }

    #[test]
    fn noise_within_the_deadband_crosses_once() {
        let omega = 0.0005;
        let mut run = Run::new(0.0, omega);
        let mut sign = 1.0;
        let mut count = 0;
        for k in 1..8000 {
            sign = -sign;
            let noisy = fluxes(omega * f64::from(k)).map(|flux| flux + sign * 0.06);
            count += u32::from(run.step(noisy).is_some());
        }
        assert_eq!(count, 24, "six a turn, four turns");
    }

    #[test]
    fn a_crossing_within_the_hold_off_is_kept_back() {
        // 5 % of a sixth of a turn is four periods at this speed.
        let mut run = Run::new(0.0, 1.0 / 480.0);
        run.state.since = 1000;
        // Phases b and a at once: the first two in order.
        let both = [-0.3, 0.3, -0.3];
        assert!(run.step(both).is_some());
        let held = (1..).find(|_| run.step(both).is_some());
        assert_eq!(held, Some(4));
        assert!(run.step(both).is_none());
    }

    #[test]
    fn a_crossing_out_of_order_is_ignored() {
        let mut run = Run::new(0.0, 0.001);
        run.state.since = 1000;
        // In the first sector only b may rise next.
        for other in [[-0.3, -0.3, -0.3], [0.6, -0.3, 0.3]] {
            assert_eq!(run.step(other), None);
        }
        assert!(run.step([0.6, 0.3, -0.3]).is_some());
    }

    #[test]
    fn from_a_wrong_sector_it_comes_to_the_right_one() {
        for wrong in 0..6 {
            let omega = 0.01;
            let mut run = Run::new(f64::from(wrong) / 6.0, omega);
            for k in 0..100 {
                run.step(fluxes(omega * f64::from(k)));
            }
            let sector = Sector::of(Angle::from_num(-0.01 - 0.016));
            assert_eq!(run.state.sector, sector, "{wrong}");
        }
    }

    #[test]
    fn without_crossings_the_rotor_is_lost_and_found_after_a_turn_of_them() {
        let mut run = Run::new(0.0, 0.01);
        for _ in 0..999 {
            run.step([0.6, -0.3, -0.3]);
            assert!(run.state.tracks);
        }
        run.step([0.6, -0.3, -0.3]);
        assert!(!run.state.tracks);
        let mut crossings = 0;
        for k in 0..110 {
            crossings += u32::from(run.step(fluxes(0.01 * f64::from(k))).is_some());
            assert_eq!(run.state.tracks, crossings >= 6);
        }
    }

    #[test]
    fn a_flux_that_no_motor_has_is_not_trusted() {
        let mut run = Run::new(0.0, 0.01);
        for k in 0..400 {
            let small = fluxes(0.01 * f64::from(k)).map(|flux| flux * 0.2);
            run.step(small);
        }
        assert!(!run.state.tracks);
    }

    proptest! {
        #[test]
        fn any_input_is_survived(words in prop::collection::vec(any::<[i32; 5]>(), 1..60)) {
            let mut state = State::default();
            let mut before = [Flux::ZERO; 3];
            for [a, b, c, amplitude, omega] in words {
                let now = [a, b, c].map(Flux::from_bits);
                let omega = Speed::from_bits(omega);
                let found: Vec<_> =
                    detect(&config(), &mut state, &before, &now, Flux::from_bits(amplitude), omega)
                        .into_iter()
                        .collect();
                prop_assert!(found.iter().all(|crossing| crossing.late <= Periods::ONE));
                before = now;
            }
        }
    }
}
