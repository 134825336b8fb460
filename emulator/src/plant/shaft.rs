//! What acts on the shaft besides the currents and the load in still air: wind, a blow, and the motor's own drag and
//! cogging.

use std::f64::consts::TAU;

use super::{Cogging, Drag, Load};

/// Disturbances of a shaft.
#[derive(Clone, Debug)]
pub(super) struct Shaft {
    /// Speed at which the wind would turn a free propeller, rad/s.
    pub(super) wind_rad_s: f64,
    /// Torque besides all others, Nm.
    pub(super) torque_nm: f64,
    drag: Drag,
    cogging: Cogging,
    pole_pairs: u32,
    /// Electrical turns since the start, modulo those in a mechanical turn.
    pole: u32,
    /// Mean cogging torque over the latest period, Nm.
    cogging_nm: f64,
}

/// The effect of a period on the shaft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Push {
    /// Acceleration, rad/s².
    pub(super) acceleration: f64,
    /// Power lost to the motor's drag, W.
    pub(super) drag_w: f64,
}

impl Shaft {
    pub(super) const fn new(pole_pairs: u32, drag: Drag, cogging: Cogging) -> Self {
        Self {
            wind_rad_s: 0.0,
            torque_nm: 0.0,
            drag,
            cogging,
            pole_pairs,
            pole: 0,
            cogging_nm: 0.0,
        }
    }

    /// Turns the rotor from an electrical angle by `turns`, in turns.
    pub(super) fn turn(&mut self, angle_turns: f64, turns: f64) {
        if self.cogging.torque_nm > 0.0 {
            self.cogging_nm = self.mean_cogging_nm(angle_turns, turns);
        }
        let passed = libm::floor(angle_turns + turns) as i64;
        let pole = passed.saturating_add(i64::from(self.pole));
        self.pole = pole.rem_euclid(i64::from(self.pole_pairs)) as u32;
    }

    /// Returns the mean cogging torque over the path, Nm: the fall of its potential over the path's length. Steps of
    /// half a wave cost less than 0.1 mW of 5 mNm.
    fn mean_cogging_nm(&self, angle_turns: f64, turns: f64) -> f64 {
        let (middle, half) = (
            self.cogging_rad(angle_turns + 0.5 * turns),
            0.5 * (self.cogging_rad(turns) - self.cogging_rad(0.0)),
        );
        let share = if half.abs() < 1e-4 {
            1.0
        } else {
            libm::sin(half) / half
        };
        -self.cogging.torque_nm * libm::sin(middle) * share
    }

    /// Returns the angle of the cogging wave at an electrical angle of this turn.
    fn cogging_rad(&self, angle_turns: f64) -> f64 {
        let mechanical = (f64::from(self.pole) + angle_turns) / f64::from(self.pole_pairs);
        TAU * f64::from(self.cogging.order) * mechanical
    }

    /// Computes the effect of a period on a free shaft at `speed` under a mean electromagnetic torque; `middle` is the
    /// expected mid-period speed, rad/s.
    ///
    /// The load by the trapezoidal rule; dry friction stops the shaft and never turns it.
    pub(super) fn push(
        &self,
        load: &Load,
        inertia_kgm2: f64,
        [speed, middle]: [f64; 2],
        torque_nm: f64,
        period_s: f64,
    ) -> Push {
        let (c2, wind) = (load.c2, self.wind_rad_s);
        let own = self.drag.viscous_nms + self.drag.eddy_nms;
        // The propeller feels the difference to the wind, everything else the speed.
        let aerodynamic = c2 * ((middle - wind).abs() - middle.abs());
        let damping = load.damping_at(middle) + aerodynamic + own;
        let blown = c2 * (middle - wind).abs() * wind;
        let driving = torque_nm + self.torque_nm + self.cogging_nm + blown;
        let inertia = inertia_kgm2 + 0.5 * period_s * damping;
        let free = speed + period_s * (driving - damping * speed) / inertia;
        let dry = period_s * (self.drag.friction_nm + self.drag.hysteresis_nm) / inertia;
        let stopped = if free.abs() <= dry {
            0.0
        } else {
            free - dry.copysign(free)
        };
        let acceleration = (stopped - speed) / period_s;
        // What is missing from the balance at the mean speed is what the drag took.
        let mean = 0.5 * (speed + stopped);
        let lost_nm = driving - (damping - own) * mean - inertia_kgm2 * acceleration;
        Push {
            acceleration,
            drag_w: lost_nm * mean,
        }
    }

    /// Returns the energy in the cogging field at an electrical angle, J.
    #[cfg(test)]
    pub(super) fn stored_j(&self, angle_turns: f64) -> f64 {
        let order = f64::from(self.cogging.order).max(1.0);
        let energy_j = self.cogging.torque_nm / order;
        energy_j * (1.0 - libm::cos(self.cogging_rad(angle_turns)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOAD: Load = Load {
        c1: 1e-4,
        c2: 2e-7,
        torque_nm: 0.0,
        inertia_kgm2: 1e-5,
    };

    const PERIOD_S: f64 = 50e-6;

    /// Returns the speeds of a shaft moved only by its surroundings.
    fn turned(mut shaft: Shaft, load: &Load, mut speed: f64, periods: u32) -> Vec<f64> {
        let (mut angle, mut acceleration) = (0.1, 0.0);
        (0..periods)
            .map(|_| {
                let middle = speed + 0.5 * PERIOD_S * acceleration;
                let turns = middle * PERIOD_S * 7.0 / TAU;
                shaft.turn(angle, turns);
                angle += turns;
                angle -= libm::floor(angle);
                let push = shaft.push(load, 1e-5, [speed, middle], 0.0, PERIOD_S);
                acceleration = push.acceleration;
                speed += acceleration * PERIOD_S;
                speed
            })
            .collect()
    }

    fn plain(drag: Drag) -> Shaft {
        Shaft::new(7, drag, Cogging::default())
    }

    #[test]
    fn wind_turns_the_propeller_up_to_its_speed() {
        for wind_rad_s in [300.0, -300.0] {
            let shaft = Shaft {
                wind_rad_s,
                ..plain(Drag::default())
            };
            let load = Load { c1: 0.0, ..LOAD };
            let speeds = turned(shaft, &load, 0.0, 400_000);
            let last = speeds[speeds.len() - 1];
            assert!((last / wind_rad_s - 1.0).abs() < 0.02, "{last}");
            assert!(speeds.iter().all(|speed| speed.abs() <= 300.0));
        }
    }

    /// c2·(ω − ω_w)² for a wind along the blades' motion, c2·(ω + ω_w)² for one against it.
    #[test]
    fn wind_changes_the_load_at_a_speed() {
        for (wind_rad_s, seen) in [(0.0, 400.0), (150.0, 250.0), (-150.0, 550.0)] {
            let shaft = Shaft {
                wind_rad_s,
                ..plain(Drag::default())
            };
            let push = shaft.push(&LOAD, 1e-5, [400.0; 2], 0.0, 1e-9);
            let wanted = -(1e-4 * 400.0 + 2e-7 * seen * seen) / 1e-5;
            assert!((push.acceleration / wanted - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn dry_friction_stops_the_shaft_and_holds_it() {
        let drag = Drag {
            friction_nm: 2e-3,
            hysteresis_nm: 1e-3,
            ..Drag::default()
        };
        let bare = Load::default();
        // 3 mNm on 10 µkg·m² takes 100 rad/s in a third of a second.
        let speeds = turned(plain(drag), &bare, 100.0, 8_000);
        let stops = speeds.iter().position(|speed| *speed == 0.0);
        let stops_s = stops.map(|periods| periods as f64 * PERIOD_S);
        assert!(
            stops_s.is_some_and(|s| (s - 1.0 / 3.0).abs() < 1e-3),
            "{stops_s:?}"
        );
        let held = |torque_nm| {
            let shaft = Shaft {
                torque_nm,
                ..plain(drag)
            };
            turned(shaft, &bare, 0.0, 1_000)[999]
        };
        assert_eq!(held(2.9e-3), 0.0);
        // A tenth of a millinewton metre remains, for 50 ms.
        assert!((held(-3.1e-3) + 0.5).abs() < 1e-9);
    }

    #[test]
    fn drag_is_accounted_for() {
        let drag = Drag {
            friction_nm: 1e-3,
            viscous_nms: 1e-6,
            hysteresis_nm: 2e-3,
            eddy_nms: 3e-6,
        };
        let push = plain(drag).push(&LOAD, 1e-5, [-500.0; 2], 0.0, 1e-9);
        let wanted_w = 500.0 * (3e-3 + 4e-6 * 500.0);
        assert!(
            (push.drag_w / wanted_w - 1.0).abs() < 1e-5,
            "{}",
            push.drag_w
        );
    }

    /// It takes and gives: over full turns no energy is lost, whether slow or fast relative to the steps.
    #[test]
    fn cogging_only_stores() {
        let cogging = Cogging {
            torque_nm: 5e-3,
            order: 84,
        };
        for (speed, lost_w) in [(40.0, 2e-6), (700.0, 1e-4)] {
            let shaft = Shaft::new(7, Drag::default(), cogging);
            let speeds = turned(shaft, &Load::default(), speed, 100_000);
            let ends = |speeds: &[f64]| {
                let of = |f: fn(f64, f64) -> f64| speeds.iter().copied().fold(speeds[0], f);
                [of(f64::min), of(f64::max)]
            };
            // The potential's full height is 2·T/N, 0.12 mJ.
            let swing = 2.0 * 5e-3 / 84.0 / 1e-5 / speed;
            let [[least, most], [_, late]] = [&speeds[..10_000], &speeds[90_000..]].map(ends);
            assert!(
                (0.5..1.3).contains(&((most - least) / swing)),
                "{least} {most}"
            );
            let shown_w = 1e-5 * speed * (late - most).abs() / (90_000.0 * PERIOD_S);
            assert!(shown_w < lost_w, "{shown_w}");
        }
        // A rotor too slow to leave its detent stays in it.
        let shaft = Shaft::new(7, Drag::default(), cogging);
        let speeds = turned(shaft, &Load::default(), 1.0, 20_000);
        assert!(speeds.iter().any(|speed| *speed < -0.5));
    }
}
