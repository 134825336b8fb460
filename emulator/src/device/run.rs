//! The ESC in time: one control period after another, with the wire's events in between.

use siskin_control::drive::Setpoint;

use super::capture::ticks;
use super::{Device, Onlooker, TASK_NS};
use crate::rig::Rig;
use crate::surroundings::Motion;

impl Device {
    /// Runs control periods until `until_ns`. `imposed` overrides the wire's set-point; `send`
    /// receives every MAVLink frame.
    pub fn advance(
        &mut self,
        until_ns: u64,
        imposed: impl Fn(f64, &Rig) -> Option<Setpoint>,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) {
        while self.is_before(until_ns) {
            self.step(&imposed, onlooker, send);
        }
    }

    /// Runs the next control period; returns what the motor did in it.
    #[inline(always)] // in each period
    pub fn step(
        &mut self,
        imposed: &impl Fn(f64, &Rig) -> Option<Setpoint>,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Motion {
        let now_ns = self.now_ns();
        let t_s = now_ns as f64 * 1e-9;
        if t_s >= self.faults.due_s {
            self.disturb(t_s);
        }
        self.hear(now_ns, onlooker);
        if now_ns >= self.task_due_ns {
            self.task_due_ns = now_ns - now_ns % TASK_NS + TASK_NS;
            if !self.rig.is_held() {
                self.tasks(now_ns, onlooker, send);
            }
        }
        // A fault found by a task takes precedence, even over an imposed set-point.
        let setpoint = match (self.throttle.setpoint(), imposed(t_s, &self.rig)) {
            (fault @ Setpoint::Fault(_), _) => fault,
            (setpoint, imposed) => imposed.unwrap_or(setpoint),
        };
        let period = self.rig.period(setpoint);
        if !self.rig.is_held() {
            let io = (&period.sample, &period.bridge);
            let (config, state) = (self.rig.config(), self.rig.state());
            self.record
                .note(config, state, io, self.clock.periods as u32);
        }
        self.latest = Some(period.sample);
        onlooker.period(t_s, &period, &self.rig);
        self.clock.periods += 1;
        period.motion
    }

    /// Hands what came on the throttle wire before this time to the ESC, and lets it answer.
    fn hear(&mut self, now_ns: u64, onlooker: &mut impl Onlooker) {
        while let Some((edge_ns, level)) = self.wire.next_edge(now_ns) {
            self.settle(edge_ns, onlooker);
            if self.driven.is_output(edge_ns) {
                continue;
            }
            onlooker.edge(edge_ns, level);
            if !self.rig.is_held()
                && let Some(ask) = self.throttle.edge(edge_ns / 1000, ticks(edge_ns), level)
            {
                self.answer(edge_ns, ask, onlooker);
            }
        }
        self.settle(now_ns, onlooker);
    }

    /// Tells the ESC the time, and reports what it has put on the wire before.
    fn settle(&mut self, now_ns: u64, onlooker: &mut impl Onlooker) {
        if !self.rig.is_held()
            && let Some(ask) = self.throttle.settle(now_ns / 1000, ticks(now_ns))
        {
            self.answer(now_ns, ask, onlooker);
        }
        self.driven.show(now_ns, onlooker);
    }
}
