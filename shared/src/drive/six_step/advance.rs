//! The commutation's advance: by how much sooner than half a sextant after its crossing a sextant ends.
//!
//! Two things ask for it, and the larger counts. Beyond the duty of a leg that switches, it lets the current, which lags by
//! L/R, reach the rotor in time, and with all of the supply in use weakens the flux. And where a sextant has few samples, the
//! released phase's current may hide the back-EMF until the crossing is past: sooner released, it has decayed by then.

use siskin_units::Angle;
use siskin_units::math::Held;

use super::state::State;
use crate::control::six_step::commutation::HALF_SEXTANT;
use crate::drive::config::six_step::Config;

/// Greatest number of hidden samples that counts: slower rotors have enough others.
const HIDDEN_MOST: u16 = 5;

/// Notes whether this sample shows back-EMF. A sextant that hides more of it than the one before ends sooner.
pub(super) fn note(six_step: &Config, s: &mut State) {
    if s.crossing.blind() {
        s.hidden[0] = s.crossing.samples;
        if s.hidden[0] > s.hidden[1] {
            s.end = HALF_SEXTANT.minus(angle(six_step, s));
        }
    }
}

/// Begins a sextant: decides where it ends.
pub(super) fn begin(six_step: &Config, s: &mut State) {
    s.hidden = [0, s.hidden[0]];
    s.end = HALF_SEXTANT.minus(angle(six_step, s));
}

/// Returns the advance, at most half a sextant. A rotor whose motion is not known has none.
#[inline(never)] // two callers
fn angle(six_step: &Config, s: &State) -> Angle {
    if !s.tracking.is_known() {
        return Angle::ZERO;
    }
    let [now, before] = s.hidden;
    let omega = s.tracking.omega_bar;
    let hidden = omega.saturating_mul_int(i32::from(now.max(before).min(HIDDEN_MOST)));
    let decays = hidden.over_period().plus(omega.over_half_period());
    let beyond = six_step.advance.held(s.duty.beyond(&six_step.duty));
    beyond.max(decays.minus(HALF_SEXTANT)).min(HALF_SEXTANT)
}

#[cfg(test)]
mod tests {
    use siskin_units::Speed;
    use siskin_units::math::Gain;

    use super::*;
    use fixed::types::I1F31;

    /// The advance in degrees of a rotor with so many periods per sextant, so many hidden samples and this duty.
    fn degrees(sextant_periods: f64, hidden: u16, duty: f64) -> f64 {
        let mut six_step = Config {
            advance: Gain::new(30.0 / 360.0 / 0.1).expect("in range"),
            ..Config::default()
        };
        six_step.duty.duty_max = I1F31::from_num(0.9);
        let mut s = State {
            hidden: [0, hidden],
            ..State::default()
        };
        s.tracking.crossings = crate::control::six_step::tracking::KNOWN;
        s.tracking.omega_bar = Speed::from_num(1.0 / 6.0 / sextant_periods);
        s.duty.duty = I1F31::from_num(duty);
        360.0 * angle(&six_step, &s).to_num::<f64>()
    }

    #[test]
    fn it_grows_with_the_duty_that_no_leg_can_switch() {
        for (duty, wanted) in [(0.5, 0.0), (0.9, 0.0), (0.95, 15.0), (0.9999999, 30.0)] {
            assert!((degrees(12.0, 1, duty) - wanted).abs() < 0.01, "{duty}");
        }
    }

    #[test]
    fn a_current_that_hides_the_crossing_is_released_sooner_by_what_it_takes() {
        // Half a period after the last hidden sample is the crossing: 30 degrees after the commutation without advance.
        for (sextant_periods, hidden, wanted) in [
            (4.0, 1, 0.0),
            (4.0, 2, 7.5),
            (4.0, 3, 22.5),
            (4.0, 9, 30.0),
            (12.0, 5, 0.0),
            (40.0, 39, 0.0),
        ] {
            let found = degrees(sextant_periods, hidden, 0.5);
            assert!(
                (found - wanted).abs() < 0.01,
                "{sextant_periods} {hidden}: {found}"
            );
        }
    }

    #[test]
    fn a_rotor_that_is_not_known_has_none() {
        let mut s = State {
            hidden: [5, 5],
            ..State::default()
        };
        s.tracking.omega_bar = Speed::from_num(0.04);
        assert_eq!(angle(&Config::default(), &s), Angle::ZERO);
    }
}
