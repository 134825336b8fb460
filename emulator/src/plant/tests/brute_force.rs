//! The same motor and inverter by brute force: small equal steps, no closed solution, no events.

use std::f64::consts::TAU;

use siskin_control::drive::Bridge;
use siskin_units::Duty;

use super::super::{Breaks, DIODE_V, Flow, Harmonic, Motor, Plant};

/// The length of a step. The commands' edges are at multiples of it.
pub(super) const STEP_S: f64 = 2e-9;

pub(super) struct BruteForce {
    motor: Motor,
    harmonics: Vec<Harmonic>,
    omega: f64,
    angle: f64,
    i: [f64; 3],
    legs: [Leg; 3],
    dead_steps: i64,
    /// What is broken, from the start.
    pub(super) breaks: Breaks,
}

/// What a leg's switches do.
#[derive(Clone, Copy, PartialEq)]
enum On {
    /// Both are off.
    None,
    /// The wire is open.
    Cut,
    /// They hold the terminal at this share of the supply.
    At(f64),
}

/// What the timer wants of a leg, and for how many steps it has wanted it.
#[derive(Clone, Copy)]
struct Leg {
    wanted: Option<bool>,
    steps: i64,
    /// Whether the last change was between the two switches.
    crossed: bool,
}

impl BruteForce {
    pub(super) fn new(
        motor: Motor,
        harmonics: &[Harmonic],
        plant: &Plant,
        dead_time_s: f64,
    ) -> Self {
        Self {
            motor,
            harmonics: harmonics.to_vec(),
            omega: plant.speed_rad_s() * f64::from(motor.pole_pairs),
            angle: plant.angle_turns() * TAU,
            i: plant.currents_a(),
            legs: [Leg {
                wanted: None,
                steps: 0,
                crossed: false,
            }; 3],
            dead_steps: (dead_time_s / STEP_S).round() as i64,
            breaks: Breaks::default(),
        }
    }

    pub(super) fn currents_a(&self) -> [f64; 3] {
        self.i
    }

    /// Runs a period; returns its means by the midpoint rule.
    pub(super) fn period(&mut self, halves: [Bridge; 2], bus_v: f64, period_s: f64) -> Flow {
        let steps = (period_s / STEP_S).round() as i64;
        let mut sum = Flow::default();
        for step in 0..steps {
            sum.most_a = self.i.iter().fold(sum.most_a, |most, i| most.max(i.abs()));
            let share = (step as f64 + 0.5) / steps as f64;
            let bridge = halves[usize::from(share > 0.5)];
            // 0 at the samples, 1 in the middle of the period; the counter leads by half a dead time.
            let height = |share: f64| 1.0 - (2.0 * share - 1.0).abs();
            let ahead = 0.5 * self.dead_steps as f64 / steps as f64;
            let heights = (height(share), height(share + ahead));
            let on = [0, 1, 2].map(|leg| {
                let gate = self.gate(leg, wanted(bridge, leg, heights));
                self.switches(leg, gate)
            });
            let mut left_s = STEP_S;
            while left_s > 0.0 {
                let v = self.terminals(on, bus_v);
                left_s -= self.step(on, v, bus_v, left_s, &mut sum);
            }
        }
        let share = 1.0 / period_s;
        Flow {
            torque_nm: sum.torque_nm * share,
            torque_square: sum.torque_square * share,
            motor_w: sum.motor_w * share,
            copper_w: sum.copper_w * share,
            bus_a: sum.bus_a * share,
            most_a: sum.most_a,
            drag_w: 0.0,
        }
    }

    /// Returns the switch that is on: the wanted one, once wanted for the dead time.
    fn gate(&mut self, leg: usize, wanted: Option<bool>) -> Option<bool> {
        let state = &mut self.legs[leg];
        if state.wanted != wanted {
            state.crossed = state.wanted.is_some() && wanted.is_some();
            state.wanted = wanted;
            state.steps = 0;
        }
        state.steps += 1;
        let dead = state.crossed && state.steps <= self.dead_steps;
        if dead { None } else { wanted }
    }

    /// Returns the effect of a gate's state.
    fn switches(&self, leg: usize, gate: Option<bool>) -> On {
        let breaks = self.breaks.0[leg];
        let [low, high] = [false, true].map(|high| {
            let index = usize::from(high);
            breaks.shorted[index] || gate == Some(high) && !breaks.open[index]
        });
        match (low, high) {
            _ if breaks.wire => On::Cut,
            (false, false) => On::None,
            _ => On::At(f64::from(u8::from(high)) / f64::from(u8::from(low) + u8::from(high))),
        }
    }

    fn emf(&self, angle: f64) -> [f64; 3] {
        self.waves(angle)
            .map(|wave| self.omega * self.motor.flux_wb * wave)
    }

    /// Returns the back-EMFs over ωφ.
    fn waves(&self, angle: f64) -> [f64; 3] {
        [0.0, 1.0, 2.0].map(|phase| {
            let angle = angle - phase * TAU / 3.0;
            let harmonics = self.harmonics.iter();
            let harmonics =
                harmonics.map(|h| h.share * (f64::from(h.order) * angle + h.phase_rad).sin());
            -angle.sin() - harmonics.sum::<f64>()
        })
    }

    /// Returns the voltages of the connected terminals.
    fn terminals(&self, on: [On; 3], bus_v: f64) -> [Option<f64>; 3] {
        let emf = self.emf(self.angle);
        let mut v = [0, 1, 2].map(|leg| match on[leg] {
            On::At(share) => Some(share * bus_v),
            On::None if self.i[leg] > 0.0 => Some(-DIODE_V),
            On::None if self.i[leg] < 0.0 => Some(bus_v + DIODE_V),
            On::None | On::Cut => None,
        });
        let wired = || (0..3).filter(|leg| on[*leg] != On::Cut);
        // Finds every star voltage at which a floating leg conducts by trying.
        for _ in 0..3 {
            let known: Vec<usize> = (0..3).filter(|leg| v[*leg].is_some()).collect();
            let star = match known.as_slice() {
                [] => {
                    // The pair with the greatest difference, if it exceeds the supply.
                    let at = |leg: &usize, other: &usize| emf[*leg].total_cmp(&emf[*other]);
                    let top = wired().max_by(at).unwrap_or(0);
                    let bottom = wired().min_by(at).unwrap_or(0);
                    if emf[top] - emf[bottom] > bus_v + 2.0 * DIODE_V {
                        v[top] = Some(bus_v + DIODE_V);
                        v[bottom] = Some(-DIODE_V);
                        continue;
                    }
                    return v;
                }
                [leg] => v[*leg].unwrap_or(0.0) - emf[*leg],
                legs => {
                    let differences = legs.iter().map(|leg| v[*leg].unwrap_or(0.0) - emf[*leg]);
                    differences.sum::<f64>() / legs.len() as f64
                }
            };
            let beyond = |leg: usize| {
                let terminal = star + emf[leg];
                (terminal - bus_v - DIODE_V).max(-DIODE_V - terminal)
            };
            let most = wired().filter(|leg| v[*leg].is_none());
            let Some(leg) = most.max_by(|a, b| beyond(*a).total_cmp(&beyond(*b))) else {
                return v;
            };
            if beyond(leg) <= 0.0 {
                return v;
            }
            let high = star + emf[leg] > bus_v;
            v[leg] = Some(if high { bus_v + DIODE_V } else { -DIODE_V });
        }
        v
    }

    /// Runs a step, or its part until a diode's current is zero; returns its length.
    fn step(
        &mut self,
        on: [On; 3],
        v: [Option<f64>; 3],
        bus_v: f64,
        time_s: f64,
        sum: &mut Flow,
    ) -> f64 {
        let (r, l) = (self.motor.resistance_ohm, self.motor.inductance_h);
        let emf = self.emf(self.angle + 0.5 * self.omega * time_s);
        let connected = v.iter().flatten().count();
        let before = self.i;
        let mut after = before;
        if connected >= 2 {
            let differences = (0..3).filter_map(|leg| v[leg].map(|v| v - emf[leg]));
            let star = differences.sum::<f64>() / connected as f64;
            for leg in 0..3 {
                if let Some(v) = v[leg] {
                    let slope = |i: f64| (v - star - emf[leg] - r * i) / l;
                    let middle = before[leg] + 0.5 * time_s * slope(before[leg]);
                    after[leg] += time_s * slope(middle);
                }
            }
        }
        // A diode stops its current at zero, interpolated linearly.
        let zero = |leg: usize| before[leg] / (before[leg] - after[leg]);
        let stops = (0..3).filter(|leg| on[*leg] == On::None && before[*leg] * after[*leg] < 0.0);
        let first = stops.min_by(|a, b| zero(*a).total_cmp(&zero(*b)));
        let share = first.map_or(1.0, zero);
        for leg in 0..3 {
            self.i[leg] = before[leg] + share * (after[leg] - before[leg]);
        }
        if let Some(leg) = first {
            self.i[leg] = 0.0;
            // A single one cannot flow.
            if (0..3).filter(|leg| self.i[*leg].abs() > 1e-9).count() < 2 {
                self.i = [0.0; 3];
            }
        }

        let time_s = share * time_s;
        let i = [0, 1, 2].map(|leg| 0.5 * (before[leg] + self.i[leg]));
        let waves = self.waves(self.angle + 0.5 * self.omega * time_s);
        let torque_per_a = f64::from(self.motor.pole_pairs) * self.motor.flux_wb;
        let torque = torque_per_a * (0..3).map(|leg| i[leg] * waves[leg]).sum::<f64>();
        sum.torque_nm += torque * time_s;
        sum.torque_square += torque * torque * time_s;
        sum.copper_w += r * i.iter().map(|i| i * i).sum::<f64>() * time_s;
        for leg in 0..3 {
            let v = v[leg].unwrap_or(0.0);
            sum.motor_w += v * i[leg] * time_s;
            sum.bus_a += match on[leg] {
                On::At(share) => share * i[leg] * time_s,
                _ if v >= bus_v => i[leg] * time_s,
                _ => 0.0,
            };
        }
        self.angle += self.omega * time_s;
        time_s
    }
}

/// Returns the timer's output for a leg at these heights: of the time from the samples, and of its counter.
fn wanted(bridge: Bridge, leg: usize, (time, counter): (f64, f64)) -> Option<bool> {
    let above = |duty: Duty| duty >= Duty::ONE || counter > 1.0 - duty.to_num::<f64>();
    match bridge {
        Bridge::Off => None,
        Bridge::Brake => Some(false),
        Bridge::Charge(share) => (time < share.to_num::<f64>()).then_some(false),
        Bridge::Duty(duties) => Some(above(duties[leg])),
        Bridge::Legs(legs) => legs[leg].map(above),
    }
}
