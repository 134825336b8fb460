//! The inverter's timing: how a command moves the legs in each half of a control period.
//!
//! The timer's counter runs down from its top to the middle of the period and up again, and its outputs change where it
//! passes the duties: the high sides are on around the middle. Turning a switch off is immediate, turning one on waits
//! for the dead time. The sample is taken in the middle of the low sides' on-time, half a dead time after the top: at
//! the top itself, where a current falls by e/L while the low sides are on, its mean would be missed by 0.06 A at 4500
//! rpm and 0.5 µs. The period runs from sample to sample.

mod comparators;
mod edges;

use siskin_control::drive::Bridge;

use super::breaks::Breaks;
use super::machine::{Flow, Machine};
use super::rail::Rail;
use super::stage::{DIODE_V, Stage};
use super::timing::{Half, Timer, delayed, duties, first_half, second_half, share};
use super::{Extras, Load, Motor};
use comparators::Comparators;

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

/// The phase current below which a dead time's loss is proportional to the current, A.
const SIGN_CERTAIN_A: f64 = 0.1;

/// Motor, load and inverter.
#[derive(Clone, Debug)]
pub struct Plant {
    fidelity: Fidelity,
    stage: Stage,
    timers: [Timer; 3],
    comparators: Comparators,
    /// Where all legs are, with none waiting.
    settled: Option<Rail>,
    /// The longest stretch between a period's own edges that the circuit's solution is prepared for, s.
    longest_s: f64,
}

impl Plant {
    /// Creates a motor and its load at a mechanical speed and an electrical angle in turns, all switches off.
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
            comparators: Comparators::new(),
            settled: None,
            longest_s: 0.0,
        }
    }

    /// Breaks parts of the stage and mends all others.
    ///
    /// While something is broken every switch edge is simulated, and a comparator at each low side's shunt turns all
    /// switches off if it sees more than its level: with a sound stage the drive's own trip at the samples comes first.
    pub fn break_legs(&mut self, breaks: &Breaks) {
        let on = [0, 1, 2].map(|leg| self.timers[leg].on());
        self.stage.break_legs(breaks, on);
    }

    /// Sets the comparators' level, A; initially infinite.
    pub fn set_comparator_a(&mut self, level_a: f64) {
        self.comparators.level_a = level_a;
    }

    /// Returns true if the comparators hold all switches off, until the drive turns them off as well.
    pub fn tripped(&self) -> bool {
        self.comparators.tripped
    }

    /// Returns the time from a current beyond the comparators' level to switches off, s, at their last act.
    pub fn trip_answer_s(&self) -> Option<f64> {
        self.comparators.answer_s()
    }

    /// Returns a leg that had less than the dead time between its switches in the last period, where real ones might
    /// both have been on. Mean voltages have no edges.
    #[inline(always)] // in each period
    pub fn crossed(&self) -> Option<usize> {
        self.stage.crossed()
    }

    /// Gives the motor, at rest, the deviations of a real one.
    pub fn fit(&mut self, extras: &Extras) {
        self.stage.machine.fit(extras);
    }

    /// Returns the present phase resistance, Ω.
    pub fn resistance_ohm(&self) -> f64 {
        self.stage.machine.resistance_ohm()
    }

    /// Flux linkage of a phase now, peak Wb.
    pub fn flux_wb(&self) -> f64 {
        self.stage.machine.flux_wb()
    }

    /// Lets resistance and flux be so many times those of the start, whatever else heat does to the winding.
    pub fn drift(&mut self, factors: [f64; 2]) {
        self.stage.machine.drift(factors);
    }

    /// Returns the winding's temperature, °C, if simulated.
    pub fn winding_c(&self) -> Option<f64> {
        self.stage.machine.winding_c()
    }

    /// Holds the shaft at this speed, rad/s, whatever the torque.
    pub fn impose(&mut self, speed_rad_s: f64) {
        self.stage.machine.impose(speed_rad_s);
    }

    /// Blocks the shaft, whatever the torque, or releases it.
    pub fn block(&mut self, blocked: bool) {
        self.stage.machine.block(blocked);
    }

    /// Adds to the shaft's speed at once, rad/s, unless it is held.
    pub fn kick(&mut self, speed_rad_s: f64) {
        self.stage.machine.kick(speed_rad_s);
    }

    /// Sets the speed at which the wind would turn a free propeller, rad/s; 0 is still air.
    pub fn set_wind_rad_s(&mut self, speed_rad_s: f64) {
        self.stage.machine.shaft_mut().wind_rad_s = speed_rad_s;
    }

    /// Sets a torque on the shaft besides all others, Nm; positive turns it forward.
    pub fn set_extra_torque_nm(&mut self, torque_nm: f64) {
        self.stage.machine.shaft_mut().torque_nm = torque_nm;
    }

    /// Sets the ambient temperature, °C.
    pub fn set_ambient_c(&mut self, ambient_c: f64) {
        self.stage.machine.set_ambient_c(ambient_c);
    }

    /// Returns the energy stored in motor and shaft, J.
    #[cfg(test)]
    pub(super) fn stored_j(&self) -> f64 {
        self.stage.machine.stored_j()
    }

    /// Returns the electrical angle in turns, 0..1.
    pub fn angle_turns(&self) -> f64 {
        self.stage.machine.angle_turns()
    }

    /// Returns the cosine and sine of the electrical angle.
    pub fn direction(&self) -> [f64; 2] {
        self.stage.machine.now().direction
    }

    /// Returns the mechanical speed, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.stage.machine.speed_rad_s()
    }

    /// Returns the currents into the phases, A.
    pub fn currents_a(&self) -> [f64; 3] {
        self.stage.machine.currents_a()
    }

    /// Returns the terminals' voltages against the negative pole, V: with all legs off and no current, three equal
    /// dividers hold the star at ground, unless a low diode holds a terminal.
    pub fn terminals_v(&self) -> [f64; 3] {
        self.stage.terminals_v()
    }

    /// Returns how long each phase's current has been flowing through its low side, s; `None` if it does not.
    pub fn low_s(&self) -> [Option<f64>; 3] {
        self.stage.low_s()
    }

    /// Returns the currents of the low sides' shunts into the phases, A, from the phases' `currents_a`: the same if the
    /// stage is sound.
    pub fn shunts_a(&self, currents_a: [f64; 3]) -> [f64; 3] {
        if self.stage.is_sound() {
            currents_a
        } else {
            self.stage.shunts_a()
        }
    }

    /// Advances the plant by a period from sample to sample, with a command for each half.
    pub fn period(
        &mut self,
        halves: [Bridge; 2],
        bus_v: f64,
        period_s: f64,
        dead_time_s: f64,
    ) -> Flow {
        self.stage.begin(bus_v, period_s, dead_time_s);
        let half_s = 0.5 * period_s;
        if self.comparators.tripped {
            self.comparators.tripped = halves != [Bridge::Off; 2];
        }
        let [first, second] = halves;
        let first = self.gated(first);
        if first == second
            && let Some(duties) = self.means(first)
        {
            self.mean(duties, dead_time_s / period_s, period_s);
        } else {
            for (bridge, to) in [(first, Rail::High), (second, Rail::Low)] {
                let bridge = self.gated(bridge);
                match self.means(bridge) {
                    Some(duties) => self.mean(duties, dead_time_s / period_s, half_s),
                    None => self.switch(bridge, to, half_s, dead_time_s),
                }
            }
        }
        let mut flow = self.stage.machine.finish(period_s);
        flow.bus_a += self.stage.shot_as() / period_s;
        flow
    }

    /// Returns what the comparators let through of a command.
    fn gated(&self, bridge: Bridge) -> Bridge {
        if self.comparators.tripped {
            Bridge::Off
        } else {
            bridge
        }
    }

    /// Advances the plant by a stretch of any length with each leg at a rail, or with both switches off: for commands
    /// that no control period makes, without dead time.
    ///
    /// The means are over the stretch; the shaft takes its torque at the end.
    pub fn legs(&mut self, legs: [Option<Rail>; 3], bus_v: f64, time_s: f64) -> Flow {
        self.stage.begin(bus_v, time_s, 0.0);
        self.settled = None;
        for (leg, rail) in legs.into_iter().enumerate() {
            self.timers[leg] = Timer {
                output: rail,
                waiting_s: 0.0,
            };
            self.stage.set(leg, rail);
        }
        // The circuit's solution is prepared for halves of a period.
        for _ in 0..2 {
            self.stage.run(0.5 * time_s);
        }
        self.stage.machine.finish(time_s)
    }

    /// Returns the duties whose mean voltages replace the switches.
    fn means(&self, bridge: Bridge) -> Option<[f64; 3]> {
        match self.fidelity {
            Fidelity::Averaged if self.stage.is_sound() => duties(bridge),
            _ => None,
        }
    }

    /// Puts all legs low, as mean voltages assume at the samples.
    #[cold]
    fn close_low(&mut self) {
        self.timers = [Timer {
            output: Some(Rail::Low),
            waiting_s: 0.0,
        }; 3];
        self.stage.hold(Rail::Low);
        self.settled = Some(Rail::Low);
    }

    /// Runs some time on the mean voltages, less the dead time's loss, a share of the period, by the sign of each
    /// current: once the supply's voltage and twice a diode's per period.
    #[inline(always)] // in each period
    fn mean(&mut self, duties: [f64; 3], dead_share: f64, time_s: f64) {
        if self.settled != Some(Rail::Low) {
            self.close_low();
        }
        let bus_v = self.stage.bus_v();
        let loss_v = dead_share * (bus_v + 2.0 * DIODE_V);
        let currents_a = self.stage.machine.middle_a(time_s);
        let mut terminals_v = [0.0; 3];
        for leg in 0..3 {
            let sign = (currents_a[leg] * (1.0 / SIGN_CERTAIN_A)).clamp(-1.0, 1.0);
            // A leg that does not switch has no dead time.
            let switches = duties[leg] > 0.0 && duties[leg] < 1.0;
            let loss_v = if switches { sign * loss_v } else { 0.0 };
            terminals_v[leg] = (duties[leg] * bus_v - loss_v).clamp(0.0, bus_v);
        }
        self.stage.run_averaged(terminals_v, time_s);
    }

    /// Plays half a period edge by edge, after which the switching legs are at a rail.
    fn switch(&mut self, bridge: Bridge, to: Rail, half_s: f64, dead_time_s: f64) {
        if let Some(edges_s) = self.plain(bridge, to, half_s, dead_time_s)
            && self.stage.sweep(to, edges_s, dead_time_s, half_s)
        {
            for timer in &mut self.timers {
                timer.output = Some(to);
            }
            self.settled = Some(to);
            return;
        }
        let halves = match to {
            Rail::High => first_half(bridge, half_s),
            Rail::Low => second_half(bridge, half_s),
        };
        self.play(halves, half_s, dead_time_s);
        let first = self.timers[0].on();
        let same = self.timers.iter().all(|timer| timer.on() == first);
        self.settled = if same { first } else { None };
    }

    /// Plays half a period, whatever the legs do in it.
    fn play(&mut self, halves: [Half; 3], half_s: f64, dead_time_s: f64) {
        let mut halves = halves.map(|half| half.timed(half_s, dead_time_s));
        let mut next_s = [0.0; 3];
        for leg in 0..3 {
            let half = halves[leg];
            let timer = &mut self.timers[leg];
            if timer.output != half.first {
                timer.turn(half.first, dead_time_s);
                self.stage.set(leg, timer.on());
            }
            next_s[leg] = timer.next_s(0.0).min(half.edge_s);
        }
        let watched = !self.stage.is_sound();
        if !watched {
            self.comparators.rest();
        }
        let mut now_s = 0.0;
        loop {
            let mut end_s = next_s[0].min(next_s[1]).min(next_s[2]).min(half_s);
            if watched {
                let shunts_a = self.stage.shunts_a();
                end_s = end_s.min(now_s + self.comparators.look(shunts_a, self.may_short()));
            }
            let time_s = end_s - now_s;
            if time_s > 0.0 {
                self.stage.run(time_s);
            }
            if watched && self.comparators.pass(time_s) {
                return self.trip(half_s - end_s);
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

    /// Returns true if a switch that is on may short through one that is always on.
    fn may_short(&self) -> bool {
        self.stage.is_shorted() && self.timers.iter().any(|timer| timer.output.is_some())
    }

    /// Turns all switches off by the comparators for the rest of a half.
    #[cold]
    fn trip(&mut self, left_s: f64) {
        self.timers = Default::default();
        for leg in 0..3 {
            self.stage.set(leg, None);
        }
        self.stage.run(left_s);
    }

    /// Returns the legs' edges if solutions superpose, each leg has one from the other rail, and its dead time fits:
    /// nearly always, in drive.
    fn plain(&self, bridge: Bridge, to: Rail, half_s: f64, dead_time_s: f64) -> Option<[f64; 3]> {
        let Bridge::Duty(duties) = bridge else {
            return None;
        };
        if self.settled != Some(to.other())
            || !self.stage.machine.is_linear()
            || !self.stage.is_sound()
        {
            return None;
        }
        let at_s = duties.map(|duty| {
            let high_s = half_s * share(duty);
            match to {
                Rail::High => half_s - high_s,
                Rail::Low => high_s,
            }
        });
        // An edge at either end does not count.
        let [first_s, last_s] = [
            at_s[0].min(at_s[1]).min(at_s[2]),
            at_s[0].max(at_s[1]).max(at_s[2]),
        ];
        let fits = first_s > 0.0 && last_s + 0.5 * dead_time_s < half_s;
        fits.then(|| at_s.map(|at_s| delayed(at_s, dead_time_s)))
    }
}

#[cfg(test)]
mod tests;
