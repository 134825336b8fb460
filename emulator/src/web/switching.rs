//! One PWM period edge by edge: the six switches, the terminal voltages and the phase currents.
//!
//! A past period's commands are replayed, stretch by stretch, on the bench as it was before. That costs the simulation
//! a copy, and only on request.

use serde::Serialize;
use siskin_scope::ViewerId;

use crate::plant::{Fidelity, Gate, Gates};
use crate::rig::{Period, Rig};
use crate::surroundings::Surroundings;

/// Stretches into which the period is cut, besides its edges, for the currents.
const STRETCHES: u32 = 200;

/// Converts to microseconds, rounded to the picosecond: an edge can be at any time.
fn microseconds(seconds: f64) -> f64 {
    (seconds * 1e12).round() * 1e-6
}

/// A period.
#[derive(Debug, Default, Serialize)]
pub(super) struct Switching {
    /// Its start, s.
    pub(super) t_s: f64,
    /// Its length, µs.
    pub(super) length_us: f64,
    /// Whether the plant is driven by these edges.
    pub(super) is_switching: bool,
    /// Each change of a leg's gates: when, µs, the leg, and whether the high side and the low side are on.
    pub(super) edges: Vec<(f64, usize, bool, bool)>,
    /// The ends of the stretches, µs.
    pub(super) t_us: Vec<f64>,
    /// For each stretch, whether each leg's high and low sides are on, one bit each.
    pub(super) gates: Vec<u8>,
    /// The terminal voltages at its end, V.
    pub(super) terminals_v: [Vec<f32>; 3],
    /// And the currents into the phases, A.
    pub(super) currents_a: [Vec<f32>; 3],
}

/// Captures periods on request.
#[derive(Default)]
pub(super) enum Look {
    /// No request.
    #[default]
    Nowhere,
    /// Requested, by these viewers.
    Asked(Vec<ViewerId>),
    /// Requested, with the state before the next period.
    Before(Vec<ViewerId>, Box<Before>),
}

/// The state before a period.
pub(super) struct Before {
    around: Surroundings,
    gates: Gates,
    on: [Gate; 3],
}

impl Look {
    /// Adds a request.
    pub(super) fn ask(&mut self, viewer: ViewerId) {
        match self {
            Self::Nowhere => *self = Self::Asked(vec![viewer]),
            Self::Asked(viewers) | Self::Before(viewers, _) => viewers.push(viewer),
        }
    }

    /// Returns true if there is a request.
    pub(super) fn is_asked(&self) -> bool {
        !matches!(self, Self::Nowhere)
    }

    /// Handles a period that has passed: returns its requesters and the period itself, if requested.
    pub(super) fn period(
        &mut self,
        t_s: f64,
        period: &Period,
        rig: &Rig,
    ) -> Option<(Vec<ViewerId>, Switching)> {
        match std::mem::take(self) {
            Self::Nowhere => None,
            Self::Asked(viewers) => {
                *self = Self::Before(viewers, Box::new(Before::after(period, rig)));
                None
            }
            Self::Before(viewers, before) => Some((viewers, before.play(t_s, period, rig))),
        }
    }

    /// Handles a period whose commands are unknown: returns its requesters.
    pub(super) fn unknown(&mut self) -> Option<Vec<ViewerId>> {
        match std::mem::take(self) {
            Self::Nowhere => None,
            Self::Asked(viewers) | Self::Before(viewers, _) => Some(viewers),
        }
    }
}

impl Before {
    /// Captures the state after a period, which is that before the next.
    fn after(period: &Period, rig: &Rig) -> Self {
        let mut before = Self {
            around: rig.around().clone(),
            gates: Gates::default(),
            on: [Gate::default(); 3],
        };
        let on = &mut before.on;
        let times = (rig.period_s(), rig.dead_time_s());
        before
            .gates
            .period(period.halves, times.0, times.1, |_, leg, gate| {
                on[leg] = gate;
            });
        before
    }

    /// Plays the period.
    fn play(mut self: Box<Self>, t_s: f64, period: &Period, rig: &Rig) -> Switching {
        let (period_s, dead_time_s) = (rig.period_s(), rig.dead_time_s());
        let mut seen = Switching {
            t_s,
            length_us: microseconds(period_s),
            is_switching: self.around.bench().plant == Fidelity::Switching,
            ..Switching::default()
        };
        let mut changes = Vec::new();
        self.gates
            .period(period.halves, period_s, dead_time_s, |at_s, leg, gate| {
                changes.push((at_s, Some((leg, gate))));
            });
        let part_s = period_s / f64::from(STRETCHES);
        changes.extend((1..=STRETCHES).map(|part| (f64::from(part) * part_s, None)));
        // Simultaneous edges stay in order of occurrence.
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut now_s = 0.0;
        seen.tell(now_s, self.on, &self.around);
        for (at_s, change) in changes {
            if at_s > now_s {
                self.around.stretch(self.on, at_s - now_s);
                now_s = at_s;
                seen.tell(now_s, self.on, &self.around);
            }
            if let Some((leg, gate)) = change
                && self.on[leg] != gate
            {
                self.on[leg] = gate;
                seen.edges
                    .push((microseconds(at_s), leg, gate.high, gate.low));
            }
        }
        seen
    }
}

impl Switching {
    fn tell(&mut self, at_s: f64, on: [Gate; 3], around: &Surroundings) {
        self.t_us.push(microseconds(at_s));
        let bits = on.iter().rev().fold(0, |bits, gate| {
            bits << 2 | u8::from(gate.low) << 1 | u8::from(gate.high)
        });
        self.gates.push(bits);
        let truth = around.truth();
        for phase in 0..3 {
            self.terminals_v[phase].push(truth.terminals_v[phase] as f32);
            self.currents_a[phase].push(around.plant().currents_a()[phase] as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use siskin_control::build::build;
    use siskin_control::drive::Setpoint;
    use siskin_params::{BOSSO_BENCH, ParamId, Params};

    use super::*;
    use crate::rig::Bench;

    /// Returns a period of a motor at speed as captured, the actual one, its length, s, and the phase currents after
    /// it, A.
    fn seen(plant: Fidelity) -> (Switching, Period, f64, [f64; 3]) {
        let mut params = Params::of(&BOSSO_BENCH);
        params.set(ParamId::PwmDeadtimeNs, 500.0).expect("in range");
        let bench = Bench {
            plant,
            ..Bench::default()
        };
        let config = build(&params, &bench.sensing.board(bench.delay)).expect("it fits the bench");
        let mut rig = Rig::new(bench, config);
        let fast = Setpoint::Speed(rig.config().scale.speed_from_rpm(4500.0));
        for _ in 0..48_000 {
            rig.period(fast);
        }
        let mut look = Look::default();
        assert!(look.period(0.0, &rig.period(fast), &rig).is_none());
        look.ask(1);
        let before = rig.period(fast);
        assert!(look.period(1.0, &before, &rig).is_none());
        look.ask(2);
        let period = rig.period(fast);
        let after_a = rig.plant().currents_a();
        let (viewers, seen) = look.period(2.0, &period, &rig).expect("it was asked for");
        assert_eq!((viewers.as_slice(), seen.t_s), (&[1, 2][..], 2.0));
        assert!(look.period(3.0, &rig.period(fast), &rig).is_none());
        (seen, period, rig.period_s(), after_a)
    }

    #[test]
    fn a_period_has_its_edges_and_ends_where_the_next_begins() {
        let (seen, period, period_s, after_a) = seen(Fidelity::Switching);
        assert!(seen.is_switching);
        assert!((seen.length_us - 1e6 * period_s).abs() < 1e-5);
        // Both sides of each leg turn on and off once.
        for leg in 0..3 {
            let edges: Vec<_> = seen.edges.iter().filter(|edge| edge.1 == leg).collect();
            assert_eq!(edges.len(), 4, "{edges:?}");
            assert!(edges.iter().all(|edge| !(edge.2 && edge.3)));
            // Low off, high on, high off, low on: the dead time is between off and on.
            let dead = [edges[1].0 - edges[0].0, edges[3].0 - edges[2].0];
            assert!(dead.iter().all(|us| (us - 0.5).abs() < 1e-3), "{dead:?}");
        }
        assert!(seen.t_us.is_sorted());
        let (begin_a, bus_v) = (period.motion.currents_a, period.motion.bus_v as f32);
        let ends_a = begin_a.into_iter().zip(after_a);
        let traces = seen.currents_a.iter().zip(&seen.terminals_v);
        for ((current, volts), (begin_a, after_a)) in traces.zip(ends_a) {
            assert!((f64::from(current[0]) - begin_a).abs() < 1e-5);
            // Replayed stretch by stretch it equals the plant's result: `Surroundings` has the tolerance.
            let apart = f64::from(current[current.len() - 1]) - after_a;
            assert!(apart.abs() < 5e-3 * (1.0 + after_a.abs()), "{apart}");
            // A terminal is at either rail, except for the drop of a diode or switch. In the dead time one without current
            // floats.
            let rail = |volts: &f32| volts.abs() < 1.5 || (volts - bus_v).abs() < 1.5;
            let mut points = volts.iter().zip(current);
            assert!(
                points.all(|(volts, a)| rail(volts) || a.abs() < 0.1),
                "{volts:?}"
            );
        }
    }

    #[test]
    fn of_the_averaged_plant_it_says_so() {
        assert!(!seen(Fidelity::Averaged).0.is_switching);
    }
}
