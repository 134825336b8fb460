//! Follows a turning motor's resistance and flux: as it warms up, the resistance rises and the flux falls.
//!
//! This works on snapshots, in the tasks, not in the interrupt. The default observer's φ̂ is wrong by what its voltage
//! model leaves out, divided by the speed: ω·(φ̂ − φ) = (R − R̂)·i_q + v, where v is the residual of the dead-time
//! compensation and has the current's sign. While the rotor accelerates, its flux leads the frame by some z_q, and the
//! observer's leak takes another ω·z_q/2; this shows along d, where u_d + ω·L·i_q = −ω·z_q.
//!
//! A single sample cannot tell φ, R and v apart, but a varying throttle can. A Kalman filter tracks the three as random
//! walks: each sample corrects only what it shows, in proportion to the uncertainty, and the rest stays. Without v in
//! the model, a dead time wrong by 50 ns would pass for a fifth of a racing motor's resistance.
//!
//! The estimates are clamped to the range that heat and a wrongly stated motor can explain. They change no parameter, and
//! are forgotten without power.

use siskin_units::math::Real;
use siskin_units::{Current, FLUX_NOMINAL, stated_emf};

use super::phase::Phase;
use super::snapshot::Snapshot;

/// A motor's resistance and flux over those that the parameters state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Of the resistance.
    pub resistance: f32,
    /// Of the flux.
    pub flux: f32,
}

impl Drift {
    /// As stated.
    pub const NONE: Self = Self {
        resistance: 1.0,
        flux: 1.0,
    };
}

/// Units of the estimates: flux and resistance relative to the stated ones, and v relative to the supply. Each is its
/// initial standard deviation, with the sign of its change with heat.
const UNITS: [f32; 3] = [-0.025, 0.1, 0.01];

/// Range of the estimates. At 180 °C copper has 1.6 times its resistance at 25 °C; magnets lose 0.1 to 0.2 % per kelvin.
/// The rest allows for a wrongly stated motor.
const LEAST: f32 = -3.0;
const MOST: f32 = 6.0;

/// Variance that each sample adds to an estimate: after a minute a resistance is as uncertain as at the start.
const WANDER: f32 = 1.5e-5;

/// Variance of a sample's voltage relative to the supply's square. Far above the sensors' noise, because errors in a
/// transient are correlated over many samples.
const NOISE: f32 = 4e-4;

/// Smallest current with a reliable sign: a few percent of a board's range.
const LEAST_CURRENT: Current = Current::lit("0.03");

/// Smallest back-EMF, relative to the supply.
const LEAST_EMF: f32 = 0.03;

/// Largest flux of the inductance and largest lead of the rotor, relative to the rotor's flux. Beyond them an inductance
/// stated a third wrong, or an angle error, changes the flux by more than a percent.
const MOST_OWN_FLUX: f32 = 0.4;
const MOST_LEAD: f32 = 0.05;

/// Samples between two changes of the values in force.
const PAUSE: u16 = 1000;

/// Smallest difference that causes a change.
const CHANGE: f32 = 0.01;

/// The motor as the parameters state it, per unit of current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    /// The drop across the resistance, in units of voltage.
    pub drop: f32,
    /// The flux of the inductance over the rotor's.
    pub own_flux: f32,
}

impl Stated {
    /// A motor that cannot be followed.
    pub const NONE: Self = Self {
        drop: 0.0,
        own_flux: 0.0,
    };
}

/// Follows a motor's resistance and flux.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracker {
    stated: Stated,
    /// Flux, resistance and v relative to the stated motor, in [`UNITS`].
    found: [f32; 3],
    covariance: [[f32; 3]; 3],
    in_force: Drift,
    /// Since the last change of it, up to [`PAUSE`].
    samples: u16,
}

impl Default for Tracker {
    fn default() -> Self {
        Self::new(Stated::NONE)
    }
}

impl Tracker {
    fn new(stated: Stated) -> Self {
        let mut covariance = [[0.0; 3]; 3];
        for (place, row) in covariance.iter_mut().enumerate() {
            row[place] = 1.0;
        }
        Self {
            stated,
            found: [0.0; 3],
            covariance,
            in_force: Drift::NONE,
            samples: 0,
        }
    }

    /// Takes in a snapshot, about once a millisecond, and starts anew if a different motor is stated. Returns true if
    /// the values [in force](Self::in_force) have changed.
    // In its own registers: the caller has none left.
    #[inline(never)]
    pub fn update(&mut self, snapshot: &Snapshot, stated: Stated) -> bool {
        if stated != self.stated {
            let changes = self.in_force != Drift::NONE;
            *self = Self::new(stated);
            return changes;
        }
        if !snapshot.phase.drives() {
            // A winding at rest cools, and what was stated wrongly is forgotten with it.
            self.found[1] -= self.found[1] * WANDER;
        } else if snapshot.phase == Phase::Run && self.stated != Stated::NONE {
            self.measure(snapshot);
        }
        self.samples += 1;
        if self.samples < PAUSE {
            return false;
        }
        self.samples = 0;
        let (now, before) = (self.drift(), self.in_force);
        let changes = (now.resistance - before.resistance).abs() > CHANGE
            || (now.flux - before.flux).abs() > CHANGE;
        if changes {
            self.in_force = now;
        }
        changes
    }

    /// Takes in a sample if the current has a reliable sign and there is enough back-EMF.
    fn measure(&mut self, snapshot: &Snapshot) {
        let i_q = snapshot.i.q;
        let magnitude = i_q.saturating_abs();
        let supply = snapshot.bus.to_f32();
        let emf = stated_emf(snapshot.speed.saturating_abs()).to_f32();
        let sure = magnitude > LEAST_CURRENT && snapshot.i.d.saturating_abs() < magnitude / 4;
        let own_flux = self.stated.own_flux * i_q.to_f32();
        let leads = snapshot.u.d.to_f32() + emf * own_flux;
        let shows = emf < supply
            && emf > LEAST_EMF * supply
            && own_flux.abs() < MOST_OWN_FLUX
            && leads.abs() < MOST_LEAD * emf;
        if !sure || !shows {
            return;
        }
        // All voltages are relative to the supply.
        let (emf, leads) = (emf / supply, leads / supply);
        let drop = self.stated.drop * i_q.to_f32() / supply;
        let sign = if i_q.is_negative() { -1.0 } else { 1.0 };
        let shown = [emf * UNITS[0], drop * UNITS[1], sign * UNITS[2]];
        let excess = snapshot.flux.to_f32() / FLUX_NOMINAL.to_f32() - 1.0;
        // Relative to the stated motor's voltage.
        let seen = emf * excess - 0.5 * leads + (self.in_force.resistance - 1.0) * drop;
        let error = seen - product(&self.found, &shown);
        let gains = self.covariance.map(|row| product(&row, &shown));
        let scale = 1.0 / (NOISE + product(&gains, &shown));
        for (place, row) in self.covariance.iter_mut().enumerate() {
            let gain = gains[place] * scale;
            let found = &mut self.found[place];
            *found = (*found + gain * error).clamp(LEAST, MOST);
            for (variance, other) in row.iter_mut().zip(&gains) {
                *variance -= gain * other;
            }
            // Never less certain than at the start.
            row[place] = (row[place] + WANDER).min(1.0);
        }
    }

    /// Gives up the values in force, with which no valid drive can be built, and starts anew.
    pub fn reject(&mut self) {
        *self = Self::new(self.stated);
    }

    /// Returns the present estimate.
    pub fn drift(&self) -> Drift {
        Drift {
            resistance: 1.0 + self.found[1] * UNITS[1],
            flux: 1.0 + self.found[0] * UNITS[0],
        }
    }

    /// Returns the values that the control runs with.
    pub fn in_force(&self) -> Drift {
        self.in_force
    }
}

/// Returns the scalar product.
fn product(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board, Params};
    use siskin_units::{Flux, Speed, Voltage};

    use super::*;
    use crate::build::build;
    use crate::drive::State;

    /// The first paper's motor on the bench: 26.7 A and 49 V are a unit.
    const STATED: Stated = Stated {
        drop: 0.059,
        own_flux: 0.63,
    };

    const HOT: Drift = Drift {
        resistance: 1.4,
        flux: 0.92,
    };

    /// What the compensation of the dead time leaves, units of voltage: 0.1 V.
    const LEFT: f32 = 0.002;

    /// A supply of 24 V.
    const SUPPLY: f32 = 0.49;

    struct Bench {
        tracker: Tracker,
        snapshot: Snapshot,
        /// Changes of what is in force.
        changes: u32,
    }

    impl Bench {
        fn new() -> Self {
            let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the bench fits");
            let mut bench = Self {
                tracker: Tracker::default(),
                snapshot: State::new(&config).snapshot(),
                changes: 0,
            };
            bench.snapshot.bus = Voltage::from_f32(SUPPLY);
            bench.snapshot.phase = Phase::Run;
            bench.update();
            bench
        }

        fn update(&mut self) {
            self.changes += u32::from(self.tracker.update(&self.snapshot, STATED));
        }

        /// A sample of a motor at a speed, in turns a period, and a current, while its flux leads the frame by a part
        /// of it: what the observer makes of that, by its derivation.
        fn see(&mut self, motor: Drift, speed: f32, current: f32, leads: f32) {
            let emf = 4.0 * speed;
            let drop =
                STATED.drop * current * (motor.resistance - self.tracker.in_force().resistance);
            let flux = motor.flux + (drop + LEFT * current.signum()) / emf - 0.5 * leads;
            let snapshot = &mut self.snapshot;
            snapshot.speed = Speed::from_f32(speed);
            snapshot.i.q = Current::from_f32(current);
            snapshot.u.d = Voltage::from_f32(-emf * (STATED.own_flux * current + leads));
            snapshot.flux = Flux::from_f32(flux * FLUX_NOMINAL.to_f32());
            self.update();
        }

        /// So many seconds of a propeller whose speed swings by a fifth.
        fn fly(&mut self, motor: Drift, seconds: u32) {
            for sample in 0..1000 * seconds {
                let (sin, cos) = (sample as f32 * 0.004).sin_cos();
                let speed = 0.025 * (1.0 + 0.2 * sin);
                // 4.3 A at the mean speed, and 2.7 A to accelerate.
                let current = 256.0 * speed * speed + 0.1 * cos;
                self.see(motor, speed, current, 0.02 * cos);
            }
        }

        fn off_by(&self, motor: Drift) -> [f32; 2] {
            let found = self.tracker.drift();
            [
                found.resistance / motor.resistance - 1.0,
                found.flux / motor.flux - 1.0,
            ]
        }
    }

    fn within(off_by: [f32; 2], most: f32) -> bool {
        off_by.iter().all(|off| off.abs() < most)
    }

    #[test]
    fn a_hot_motor_is_found_whatever_the_dead_time_leaves() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        let off_by = bench.off_by(HOT);
        assert!(within(off_by, 0.02), "{off_by:?}");
        // And is left again.
        bench.fly(Drift::NONE, 60);
        let off_by = bench.off_by(Drift::NONE);
        assert!(within(off_by, 0.02), "{off_by:?}");
    }

    #[test]
    fn what_is_in_force_follows_in_steps() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        let (found, used) = (bench.tracker.drift(), bench.tracker.in_force());
        assert!(
            (found.resistance - used.resistance).abs() < 0.02,
            "{used:?}"
        );
        assert!((found.flux - used.flux).abs() < 0.02, "{used:?}");
        assert!((2..=60).contains(&bench.changes), "{}", bench.changes);
    }

    #[test]
    fn a_drift_that_was_rejected_is_found_again_from_the_stated_motor() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        bench.tracker.reject();
        assert_eq!(bench.tracker.in_force(), Drift::NONE);
        assert_eq!(bench.tracker.drift(), Drift::NONE);
        bench.fly(HOT, 60);
        let off_by = bench.off_by(HOT);
        assert!(within(off_by, 0.02), "{off_by:?}");
    }

    #[test]
    fn a_throttle_that_stands_still_tells_of_the_voltage_alone() {
        let mut bench = Bench::new();
        let (speed, current) = (0.025, 0.16);
        for _ in 0..60_000 {
            bench.see(HOT, speed, current, 0.0);
        }
        let found = bench.tracker.drift();
        // Back-EMF, drop, and what the dead time leaves.
        let volts = |drift: Drift, left: f32| {
            4.0 * speed * drift.flux + STATED.drop * current * drift.resistance + left
        };
        let left = bench.tracker.found[2] * UNITS[2] * SUPPLY;
        let [seen, stated] = [volts(found, left), volts(Drift::NONE, 0.0)];
        let off_by = (seen - volts(HOT, LEFT)) / (stated - volts(HOT, LEFT));
        assert!(off_by.abs() < 0.01, "{off_by}");
        // Of which no part has taken all.
        assert!((found.resistance - 1.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn nothing_moves_where_nothing_shows() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        let found = bench.tracker.drift();
        let cold = Drift::NONE;
        for (phase, speed, current) in [
            (Phase::Ramp, 0.025, 0.16),
            (Phase::Stopping, 0.025, 0.16),
            // Too small a current, and too little back-EMF.
            (Phase::Run, 0.025, 0.02),
            (Phase::Run, 0.003, 0.16),
        ] {
            bench.snapshot.phase = phase;
            for _ in 0..10_000 {
                bench.see(cold, speed, current, 0.0);
            }
            assert_eq!(bench.tracker.drift(), found, "{phase:?} {speed} {current}");
        }
        // Nor without a supply.
        bench.snapshot.bus = Voltage::ZERO;
        bench.see(cold, 0.0, 0.16, 0.0);
        assert_eq!(bench.tracker.drift(), found);
    }

    #[test]
    fn a_winding_at_rest_cools() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        let before = bench.tracker.drift();
        bench.snapshot.phase = Phase::Idle;
        for _ in 0..200_000 {
            bench.update();
        }
        let now = bench.tracker.drift();
        assert!((1.0..1.05).contains(&now.resistance), "{now:?}");
        assert_eq!(now.flux, before.flux);
    }

    #[test]
    fn what_is_followed_has_bounds() {
        let mut bench = Bench::new();
        bench.fly(
            Drift {
                resistance: 3.0,
                flux: 0.5,
            },
            60,
        );
        let found = bench.tracker.drift();
        assert!((0.7..=1.601).contains(&found.resistance), "{found:?}");
        assert!((0.849..=1.075).contains(&found.flux), "{found:?}");
    }

    #[test]
    fn another_motor_is_as_it_is_stated() {
        let mut bench = Bench::new();
        bench.fly(HOT, 60);
        let other = Stated {
            drop: 0.06,
            ..STATED
        };
        assert!(bench.tracker.update(&bench.snapshot, other));
        assert_eq!(bench.tracker.in_force(), Drift::NONE);
        assert_eq!(bench.tracker.drift(), Drift::NONE);
        assert!(!bench.tracker.update(&bench.snapshot, STATED));
    }
}
