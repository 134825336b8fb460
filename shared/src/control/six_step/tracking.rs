//! Tracking from crossing to crossing: the rotor's angle and speed, and when the next commutation is due.

use fixed::types::I16F16;
use siskin_params::Delay;
use siskin_units::math::{Held, divide};
use siskin_units::{Angle, Speed, traced};

use super::commutation::{HALF_SEXTANT, SEXTANT};

/// Consecutive crossings after which the rotor's motion is known well enough to smooth.
pub const KNOWN: u8 = 6;

traced! {
    /// The rotor estimate.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// Angle past mid-sextant.
        pub delta: Angle,
        /// ω: turns per period.
        pub omega: Speed,
        /// ω̄, smoothed over some four sextants. Commutations fall on period boundaries; how that shifts the next
        /// crossing is not in the rotor's speed.
        pub omega_bar: Speed,
        /// Periods since the last crossing, or since standstill.
        pub elapsed: I16F16,
        /// Sextants since then.
        pub sextants: u8,
        /// No crossing since standstill.
        pub from_rest: bool,
        /// Consecutive crossings, up to [`KNOWN`].
        pub crossings: u8,
    }
}

/// At least three periods per sextant: with fewer no reading is left between the decaying current and the crossing.
pub const FASTEST: Speed = Speed::from_bits(SEXTANT.to_bits() / 3);

/// Speed from which a sextant has fewer than five periods: a crossing's instant, known to a fraction of a period, is then
/// only a part of what tells the rotor's angle and speed.
pub const FEW_PERIODS: Speed = Speed::from_bits(SEXTANT.to_bits() / 5);

impl State {
    /// Creates the state of a rotor at rest, anywhere.
    pub fn at_rest() -> Self {
        Self {
            from_rest: true,
            ..Self::default()
        }
    }

    /// Returns true once the rotor's motion is known.
    pub fn is_known(&self) -> bool {
        self.crossings >= KNOWN
    }

    /// Advances by one period.
    pub fn advance(&mut self) {
        self.delta = self.delta.plus(self.omega.over_period());
        self.elapsed = self.elapsed.plus(I16F16::ONE);
    }

    /// Takes a crossing found to be `age` periods old, 60° after the one before.
    pub fn crossed(&mut self, age: I16F16) {
        let interval = self.elapsed.minus(age).max(I16F16::ONE);
        let turned = u64::from(self.sextants.max(1)) * SEXTANT.to_bits() as u64;
        let mean = over(turned, interval);
        let mut overdue = false;
        if self.from_rest {
            // It may have come from anywhere.
            self.omega = Speed::ZERO;
            self.omega_bar = self.omega;
        } else if !self.is_known() {
            let off = i64::from(self.delta.to_bits()) - times(self.omega, age);
            let half_sextant = i64::from(HALF_SEXTANT.to_bits());
            overdue = off > half_sextant;
            if off.abs() > half_sextant / 2 {
                // It was not where it was taken to be, or the load differs.
                self.omega = mean;
            } else {
                // At low speed a crossing may be seen some degrees early or late, so only half the correction is
                // applied.
                self.omega += mean.minus(self.omega) >> 1;
            }
            self.omega_bar = self.omega;
        } else if self.omega >= FEW_PERIODS {
            self.omega += mean.minus(self.omega) >> 3;
            self.omega_bar = self.omega;
        } else {
            self.omega += mean.minus(self.omega) >> 1;
            self.omega_bar += mean.minus(self.omega_bar) >> 2;
        }
        self.omega = self.omega.max(Speed::ZERO).min(FASTEST);
        self.delta = if overdue {
            // It may be faster than the long interval suggests: better early than late.
            HALF_SEXTANT
        } else {
            let measured = bounded(times(self.omega, age));
            if self.is_known() && self.omega >= FEW_PERIODS {
                self.delta.plus(measured.minus(self.delta) >> 1)
            } else {
                measured
            }
        };
        self.elapsed = age;
        self.sextants = 0;
        self.from_rest = false;
        self.crossings = (self.crossings + 1).min(KNOWN);
    }

    /// Returns how many consecutive readings must agree on the floating phase's side of zero: one per 40th of a
    /// sextant, up to four, because the back-EMF shrinks with the speed.
    pub fn certain(&self) -> u16 {
        match self.omega.to_bits() >> 21 {
            // Below 2^-11 turns per period, 341 periods per sextant; then 171, and 85.
            ..1 => 4,
            1 => 3,
            2..4 => 2,
            _ => 1,
        }
    }

    /// Returns true if a commutation commanded now takes effect closest to `angle` past mid-sextant.
    pub fn reaches(&self, angle: Angle, delay: Delay) -> bool {
        // Half a period plus the delay, which is also the advance to the middle of a voltage.
        self.delta.plus(delay.advance(self.omega)) >= angle
    }

    /// Begins the next sextant by the extrapolated angle.
    pub fn commutated(&mut self) {
        self.delta = self.delta.minus(SEXTANT);
        self.sextants = self.sextants.saturating_add(1);
    }

    /// Begins the next sextant without knowing more than that the rotor should be there. A rotor tracked so far is
    /// slower than assumed.
    pub fn forced(&mut self) {
        self.commutated();
        if self.crossings > 0 {
            self.omega -= self.omega >> 2;
        }
        self.delta = -HALF_SEXTANT;
        self.crossings = 0;
    }
}

/// Returns a quantity with 32 fraction bits over a time, at most [`FASTEST`].
fn over(bits: u64, periods: I16F16) -> Speed {
    let quotient = divide(bits << 16, periods.to_bits().unsigned_abs());
    Speed::from_bits(quotient.min(FASTEST.to_bits() as u64) as i32)
}

/// Returns a step per period times a time, in bits of a turn.
fn times(step: Speed, periods: I16F16) -> i64 {
    (i64::from(step.to_bits()) * i64::from(periods.to_bits())) >> 16
}

/// Clamps to one sextant either way.
fn bounded(turn_bits: i64) -> Angle {
    let sextant = i64::from(SEXTANT.to_bits());
    Angle::from_bits(turn_bits.clamp(-sextant, sextant) as i32)
}

#[cfg(test)]
mod tests {
    use siskin_params::parts;

    use super::*;

    const NONE: Delay = Delay::None(parts::Bench::HERE);
    const HALF: Delay = Delay::Half(parts::Bench::HERE);

    /// Converts periods between crossings to turns per period.
    fn speed(sextant_periods: f64) -> f64 {
        1.0 / 6.0 / sextant_periods
    }

    /// Runs the tracker on crossings of a rotor `turned(period)` sextants past the first crossing; returns each
    /// commutation's lateness in degrees.
    fn lateness(turned: impl Fn(f64) -> f64, periods: u32, delay: Delay) -> std::vec::Vec<f64> {
        let lead = match delay {
            Delay::None(_) => 0.0,
            Delay::Half(_) => 0.5,
            Delay::One => 1.0,
        };
        let mut state = State::at_rest();
        let mut late = std::vec::Vec::new();
        let mut found = false;
        let mut sextant = 0.0;
        for period in 0..periods {
            let now = f64::from(period);
            state.advance();
            if !found && turned(now) >= sextant {
                found = true;
                // The crossing's instant, by bisection between samples.
                let (mut a, mut b) = (now - 1.0, now);
                for _ in 0..40 {
                    let m = 0.5 * (a + b);
                    if turned(m) < sextant { a = m } else { b = m }
                }
                state.crossed(I16F16::from_num(now - b));
            }
            if found && (!state.is_known() || state.reaches(HALF_SEXTANT, delay)) {
                late.push((turned(now + lead) - sextant - 0.5) * 60.0);
                state.commutated();
                found = false;
                sextant += 1.0;
            }
        }
        late
    }

    #[test]
    fn at_a_constant_speed_commutation_is_within_half_a_period_of_thirty_degrees() {
        // 5.56 periods are 6000 rpm with 12 pole pairs at 40 kHz, 33.3 are 1000 rpm.
        for sextant_periods in [4.03, 5.556, 11.7, 33.333, 400.618] {
            for delay in [NONE, HALF, Delay::One] {
                let late = lateness(|t| t / sextant_periods - 0.3, 20_000, delay);
                assert!(late.len() > 40);
                let half_period_deg = 30.0 / sextant_periods;
                // Those before are early: at the crossing.
                let late = &late[usize::from(KNOWN)..];
                for deg in &late[4..] {
                    assert!(deg.abs() < half_period_deg * 1.01 + 0.01, "{deg}");
                }
                let mean = late[4..].iter().sum::<f64>() / (late.len() - 4) as f64;
                assert!(
                    mean.abs() < half_period_deg * 0.25,
                    "{sextant_periods}: {mean}"
                );
            }
        }
    }

    #[test]
    fn a_start_with_constant_acceleration_is_followed() {
        // 60° in 680 periods: the bench at 4 A, without load.
        let rest = 680.0_f64;
        let late = lateness(|t| (t / rest).powi(2) - 1.0, 4000, Delay::One);
        assert!(late.len() > 20);
        // The first ones are at the crossing, half a sextant early.
        for deg in &late[usize::from(KNOWN)..] {
            assert!(deg.abs() < 20.0, "{late:?}");
        }
    }

    #[test]
    fn a_missed_crossing_does_not_halve_the_speed() {
        let mut state = State::at_rest();
        for crossing in 0..20 {
            let sextants = if crossing == 15 { 2 } else { 1 };
            for _ in 0..10 * sextants {
                state.advance();
            }
            state.sextants = sextants;
            state.crossed(I16F16::ZERO);
        }
        assert!((state.omega.to_num::<f64>() / speed(10.0) - 1.0).abs() < 1e-4);
        assert!((state.omega_bar.to_num::<f64>() / speed(10.0) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn no_interval_overflows() {
        let mut state = State::at_rest();
        state.crossed(I16F16::MAX);
        assert_eq!(state.omega, Speed::ZERO);
        state.crossed(I16F16::MAX);
        assert!(state.omega > Speed::ZERO && state.omega <= FASTEST);
        for _ in 0..70_000 {
            state.advance();
        }
        state.sextants = u8::MAX;
        state.crossed(I16F16::MIN);
        assert!(state.omega > Speed::ZERO);
        for _ in 0..10 {
            state.commutated();
        }
        state.forced();
        assert_eq!(state.delta, -HALF_SEXTANT);
    }
}
