//! The inverter's timing: what a command makes of the legs in each half of a control period.
//!
//! The timer's counter runs down from its top to the middle of the period and up again, and its
//! outputs change where it passes the duties: the high sides are on around the middle. Turning a
//! switch off is immediate, turning one on waits for the dead time. The sample is taken in the
//! middle of the low sides' on-time, half a dead time after the top: at the top itself, where a
//! current falls by e/L while the low sides are on, its mean would be missed by 0.06 A at 4500 rpm
//! and 0.5 µs. The period runs from sample to sample.

use siskin_control::drive::Bridge;
use siskin_control::units::Duty;

use super::circuit::Stretch;
use super::machine::{Flow, Machine};
use super::stage::{DIODE_V, Rail, Stage};
use super::{Load, Motor};

/// How the inverter is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Fidelity {
    /// By its mean voltage over each half period while all legs switch
    #[default]
    Averaged,
    /// Every switch edge at its time
    Switching,
}

/// The phase current below which a dead time's loss is in proportion to the current, A.
const SIGN_CERTAIN_A: f64 = 0.1;

/// One bit of a duty.
const DUTY_BIT: f64 = 1.0 / 2_147_483_648.0;

/// Motor, load and inverter.
#[derive(Clone, Debug)]
pub struct Plant {
    fidelity: Fidelity,
    stage: Stage,
    timers: [Timer; 3],
}

/// One leg's output of the timer.
#[derive(Clone, Copy, Debug, Default)]
struct Timer {
    /// The switch that is, or after the dead time will be, on.
    output: Option<Rail>,
    /// What is left of the dead time, s.
    waiting_s: f64,
}

/// A leg's part in half a period: one output, then another.
#[derive(Clone, Copy, Debug)]
struct Half {
    first: Option<Rail>,
    second: Option<Rail>,
    /// When the second begins, s.
    edge_s: f64,
}

impl Plant {
    /// A motor and its load at a mechanical speed and an electrical angle in turns, all switches
    /// off.
    pub fn new(
        fidelity: Fidelity,
        motor: Motor,
        load: Load,
        speed_rad_s: f64,
        angle_turns: f64,
    ) -> Self {
        Self {
            fidelity,
            stage: Stage::new(Machine::new(motor, load, speed_rad_s, angle_turns)),
            timers: [Timer::default(); 3],
        }
    }

    /// Holds the shaft at this speed, rad/s, whatever the torque.
    pub fn impose(&mut self, speed_rad_s: f64) {
        self.stage.machine.impose(speed_rad_s);
    }

    /// Electrical angle in turns, 0..1.
    pub fn angle_turns(&self) -> f64 {
        self.stage.machine.angle_turns()
    }

    /// Cosine and sine of the electrical angle.
    pub fn direction(&self) -> [f64; 2] {
        self.stage.machine.now().direction
    }

    /// Mechanical speed, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.stage.machine.speed_rad_s()
    }

    /// Currents into the phases, A.
    pub fn currents_a(&self) -> [f64; 3] {
        self.stage.machine.currents_a()
    }

    /// Voltages of the terminals against the negative pole, V: with all legs off and no current,
    /// three equal dividers hold the star at ground, unless a low diode holds a terminal.
    pub fn terminals_v(&self) -> [f64; 3] {
        self.stage.terminals_v()
    }

    /// For how long each phase's current has been flowing through its low side, s; `None` where it
    /// does not.
    pub fn low_s(&self) -> [Option<f64>; 3] {
        self.stage.low_s()
    }

    /// Takes the plant on by a period from sample to sample, with a command for each half.
    pub fn period(
        &mut self,
        halves: [Bridge; 2],
        bus_v: f64,
        period_s: f64,
        dead_time_s: f64,
    ) -> Flow {
        self.stage.begin(bus_v, period_s);
        let half_s = 0.5 * period_s;
        let [first, second] = halves;
        let stretch = self.stage.machine.circuit.stretch(half_s);
        match self.means(first) {
            Some(duties) => self.mean(duties, dead_time_s, &stretch),
            None => self.switch(first_half(first, half_s), half_s, dead_time_s),
        }
        match self.means(second) {
            Some(duties) => self.mean(duties, dead_time_s, &stretch),
            None => self.switch(second_half(second, half_s), half_s, dead_time_s),
        }
        self.stage.machine.finish(period_s)
    }

    /// The duties whose mean voltages stand for the switches.
    fn means(&self, bridge: Bridge) -> Option<[f64; 3]> {
        match self.fidelity {
            Fidelity::Averaged => duties(bridge),
            Fidelity::Switching => None,
        }
    }

    /// Means stand for legs that are low at the samples.
    fn close_low(&mut self) {
        for (leg, timer) in self.timers.iter_mut().enumerate() {
            if timer.output != Some(Rail::Low) || timer.waiting_s > 0.0 {
                *timer = Timer {
                    output: Some(Rail::Low),
                    waiting_s: 0.0,
                };
                self.stage.set(leg, Some(Rail::Low));
            }
        }
    }

    /// Half a period by the mean voltages, less what the dead time takes by the sign of each
    /// current: the supply's voltage once and a diode's twice a period.
    fn mean(&mut self, duties: [f64; 3], dead_time_s: f64, half: &Stretch) {
        self.close_low();
        let bus_v = self.stage.bus_v();
        let loss_v = 0.5 * dead_time_s / half.time_s * (bus_v + 2.0 * DIODE_V);
        let currents_a = self.stage.machine.currents_a();
        let mut terminals_v = [0.0; 3];
        for leg in 0..3 {
            let sign = (currents_a[leg] * (1.0 / SIGN_CERTAIN_A)).clamp(-1.0, 1.0);
            // A leg that does not switch has no dead time.
            let switches = duties[leg] > 0.0 && duties[leg] < 1.0;
            let loss_v = if switches { sign * loss_v } else { 0.0 };
            terminals_v[leg] = (duties[leg] * bus_v - loss_v).clamp(0.0, bus_v);
        }
        self.stage.run_averaged(terminals_v, half);
    }

    /// Half a period edge by edge.
    fn switch(&mut self, halves: [Half; 3], half_s: f64, dead_time_s: f64) {
        let mut halves = halves;
        let mut next_s = [0.0; 3];
        for leg in 0..3 {
            let half = &mut halves[leg];
            // An edge at an end is none.
            if half.edge_s <= 0.0 {
                half.first = half.second;
            }
            if half.edge_s <= 0.0 || half.edge_s >= half_s {
                half.second = half.first;
            }
            if half.first == half.second {
                half.edge_s = f64::INFINITY;
            } else if half.first.is_some() && half.second.is_some() {
                // With each turning on late by the dead time, the middle of the low side's on-time,
                // which is when the sample is taken, is half of it behind the counter's top.
                half.edge_s = (half.edge_s - 0.5 * dead_time_s).max(0.0);
            }
            let timer = &mut self.timers[leg];
            if timer.output != half.first {
                timer.turn(half.first, dead_time_s);
                self.stage.set(leg, timer.on());
            }
            next_s[leg] = timer.next_s(0.0).min(half.edge_s);
        }
        if let Some((to, edges)) = self.plain(&halves, half_s, dead_time_s) {
            self.stage.sweep(to, edges, dead_time_s, half_s);
            for timer in &mut self.timers {
                timer.output = Some(to);
            }
            return;
        }
        let mut now_s = 0.0;
        loop {
            let end_s = next_s[0].min(next_s[1]).min(next_s[2]).min(half_s);
            let time_s = end_s - now_s;
            if time_s > 0.0 {
                self.stage.run(time_s);
            }
            for timer in &mut self.timers {
                timer.waiting_s -= time_s;
            }
            if end_s >= half_s {
                return;
            }
            now_s = end_s;
            for leg in 0..3 {
                if next_s[leg] > now_s {
                    continue;
                }
                let (timer, half) = (&mut self.timers[leg], &mut halves[leg]);
                if half.edge_s <= now_s {
                    half.edge_s = f64::INFINITY;
                    timer.turn(half.second, dead_time_s);
                } else {
                    timer.waiting_s = 0.0;
                }
                self.stage.set(leg, timer.on());
                next_s[leg] = timer.next_s(now_s).min(half.edge_s);
            }
        }
    }

    /// The edges in order of time, where each leg has one, from the same rail, and time for its
    /// dead time before the next: nearly always, in drive.
    fn plain(
        &self,
        halves: &[Half; 3],
        half_s: f64,
        dead_time_s: f64,
    ) -> Option<(Rail, [(usize, f64); 3])> {
        let to = halves[0].second?;
        for (half, timer) in halves.iter().zip(&self.timers) {
            let crosses = half.edge_s < half_s && half.second == Some(to) && half.first.is_some();
            if !crosses || timer.waiting_s > 0.0 {
                return None;
            }
        }
        let [a, b, c] = [halves[0].edge_s, halves[1].edge_s, halves[2].edge_s];
        // Each edge's place is the number of those before it.
        let places = [
            usize::from(b < a) + usize::from(c < a),
            usize::from(a <= b) + usize::from(c < b),
            usize::from(a <= c) + usize::from(b <= c),
        ];
        let mut edges = [(0, 0.0); 3];
        for leg in 0..3 {
            edges[places[leg]] = (leg, halves[leg].edge_s);
        }
        let apart = edges[1].1 - edges[0].1 >= dead_time_s
            && edges[2].1 - edges[1].1 >= dead_time_s
            && half_s - edges[2].1 >= dead_time_s;
        apart.then_some((to, edges))
    }
}

impl Timer {
    fn turn(&mut self, output: Option<Rail>, dead_time_s: f64) {
        // A leg that has been off needs no dead time.
        let waits = self.output.is_some() && output.is_some();
        self.waiting_s = if waits { dead_time_s } else { 0.0 };
        self.output = output;
    }

    fn on(&self) -> Option<Rail> {
        if self.waiting_s > 0.0 {
            None
        } else {
            self.output
        }
    }

    /// When the dead time ends.
    fn next_s(&self, now_s: f64) -> f64 {
        if self.waiting_s > 0.0 {
            now_s + self.waiting_s
        } else {
            f64::INFINITY
        }
    }
}

/// The duties of a command with which all legs switch, 0..1.
fn duties(bridge: Bridge) -> Option<[f64; 3]> {
    match bridge {
        Bridge::Duty(duties) => Some(duties.map(share)),
        Bridge::Brake => Some([0.0; 3]),
        Bridge::Legs([Some(a), Some(b), Some(c)]) => Some([a, b, c].map(share)),
        Bridge::Legs(_) | Bridge::Off | Bridge::Charge(_) => None,
    }
}

fn share(duty: Duty) -> f64 {
    (f64::from(duty.to_bits()) * DUTY_BIT).min(1.0)
}

/// What a command makes of each leg in the half after a sample.
fn first_half(bridge: Bridge, half_s: f64) -> [Half; 3] {
    second_half(bridge, half_s).map(|half| Half {
        first: half.second,
        second: half.first,
        edge_s: half_s - half.edge_s,
    })
}

/// The same in the half before a sample: the first in the mirror.
fn second_half(bridge: Bridge, half_s: f64) -> [Half; 3] {
    let off = Half {
        first: None,
        second: None,
        edge_s: half_s,
    };
    let switching = |duty| Half {
        first: Some(Rail::High),
        second: Some(Rail::Low),
        edge_s: half_s * share(duty),
    };
    match bridge {
        Bridge::Off => [off; 3],
        Bridge::Brake => [switching(Duty::ZERO); 3],
        Bridge::Duty(duties) => duties.map(switching),
        Bridge::Legs(legs) => legs.map(|leg| leg.map_or(off, switching)),
        Bridge::Charge(duty) => {
            [Half {
                first: None,
                second: Some(Rail::Low),
                edge_s: half_s * (1.0 - share(duty)),
            }; 3]
        }
    }
}
