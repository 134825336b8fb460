//! An ESC at rest with a throttle wire, and a judge that knows when its motor may turn.

use siskin_control::drive::{Setpoint, Snapshot, State};
use siskin_control::esc::Esc;
use siskin_control::mavlink::Request;
use siskin_control::throttle::Throttle;
use siskin_emulator::device::Latest;
use siskin_emulator::rig::Bench;
use siskin_params::{BOSSO_MOTOR, ParamId, Params};
use siskin_throttle::answer::Ask;
use siskin_throttle::line::{Event, Line};
use siskin_throttle::signal::Signal;

/// Clock of the capture timer.
pub const CAPTURE_HZ: u32 = 170_000_000;

/// The defaults of `INP_ARM_MS` and `INP_LOSS_MS`.
const ARM_NS: u64 = 300_000_000;
const LOSS_NS: u64 = 100_000_000;
/// How long an armed wire may be silent after a DShot command.
const COMMAND_GAP_NS: u64 = 300_000_000;

/// Frames and pulses of zero throttle needed to arm.
const ARMING_FRAMES: u32 = 30;
const ARMING_PULSES: u32 = 5;

/// The longest that an edge waits to be believed while time passes.
const LONGEST_FILTER_NS: u64 = 3_000;

/// How often the tasks run.
const POLL_NS: u64 = 1_000_000;

/// An ESC, its wire and the time.
pub struct Desk {
    /// The ESC.
    pub esc: Esc,
    /// Its wire.
    pub throttle: Throttle,
    /// What its drive reports.
    pub snapshot: Snapshot,
    judge: Judge,
    now_ns: u64,
    /// The timer's count at the start.
    origin_ticks: u32,
    polled_ns: u64,
}

impl Desk {
    /// Creates one whose signal `INP_PROTO` forces, or detects.
    pub fn new(signal: Option<Signal>, origin_ticks: u32) -> Self {
        let mut params = Params::of(&BOSSO_MOTOR);
        if let Some(signal) = signal {
            params
                .set(ParamId::InpProto, f32::from(signal.number()))
                .expect("a number of the table");
        }
        let bench = Bench::default();
        let board = bench.sensing.board(bench.delay);
        let (mut esc, mut throttle) =
            Esc::new(params, board, CAPTURE_HZ, 1_000_000).expect("its motor fits the bench");
        let config = esc.config().expect("its motor fits the bench");
        let snapshot = State::new(&config).snapshot();
        // The board's power-up test is over before the wire begins, so only the wire decides whether the motor
        // may turn.
        for _ in 0..4 {
            esc.poll(&mut throttle, 0, &snapshot, 25.0, &mut |_| {});
            esc.test_itself(&snapshot, &mut Latest::at_rest());
        }
        Self {
            esc,
            throttle,
            snapshot,
            judge: Judge::new(signal),
            now_ns: 0,
            origin_ticks,
            polled_ns: 0,
        }
    }

    fn ticks(&self) -> u32 {
        let ticks = u128::from(self.now_ns) * u128::from(CAPTURE_HZ) / 1_000_000_000;
        self.origin_ticks.wrapping_add(ticks as u32)
    }

    /// Plays an edge after a time; returns what it asks for.
    pub fn edge(&mut self, after_ns: u64, level: bool) -> Option<Ask> {
        self.now_ns += after_ns;
        let ticks = self.ticks();
        self.judge.edge(self.now_ns, ticks, level);
        let ask = self.throttle.edge(self.now_ns / 1000, ticks, level);
        self.check();
        ask
    }

    /// Lets time pass without an edge; returns what it asks for. The tasks run at its end.
    pub fn settle(&mut self, after_ns: u64) -> Option<Ask> {
        self.now_ns += after_ns;
        let ticks = self.ticks();
        self.judge.settle(self.now_ns, ticks);
        let ask = self.throttle.settle(self.now_ns / 1000, ticks);
        if self.now_ns - self.polled_ns >= POLL_NS {
            self.polled_ns = self.now_ns;
            // Between two polls a signal outlasts its time limit.
            self.judge.poll(self.now_ns);
            let now_us = self.now_ns / 1000;
            let throttle = &mut self.throttle;
            self.esc
                .poll(throttle, now_us, &self.snapshot, 25.0, &mut |_| {});
            while let Some(request) = self.esc.take_request(throttle) {
                if matches!(request, Request::Save | Request::Keep) {
                    self.esc.storage_done(throttle, Ok(()));
                }
            }
        }
        self.check();
        ask
    }

    fn check(&self) {
        let turns = matches!(
            self.throttle.setpoint(),
            Setpoint::Speed(_) | Setpoint::Torque(_) | Setpoint::Voltage(_) | Setpoint::Test(_)
        );
        assert!(!turns || self.judge.may_turn(), "it turns and is not armed");
        let armed = self.esc.telemetry().armed;
        let polled = self.polled_ns == self.now_ns;
        assert!(
            !(armed && polled) || self.judge.may_turn(),
            "armed by nothing"
        );
    }
}

/// Knows what has been on the wire: the minimum that an armed wire must have had.
struct Judge {
    /// For a forced signal, a decoder that sees what the ESC's sees. While the ESC detects one, it is not known
    /// when it starts over.
    line: Option<Line>,
    least: u32,
    zeros: u32,
    since_ns: u64,
    last_ns: u64,
    /// Whether the last frame was, or may have been, a command.
    command: bool,
    /// The last edge, if too little time has passed for the ESC to believe it.
    waits_ns: Option<u64>,
    has_armed: bool,
    /// Whether the wire has been silent for too long since the last poll.
    has_lapsed: bool,
}

impl Judge {
    fn new(signal: Option<Signal>) -> Self {
        let line = signal.map(|signal| {
            let mut line = Line::new(CAPTURE_HZ);
            line.force(Some(signal));
            line
        });
        Self {
            line,
            least: match signal {
                Some(Signal::Dshot { .. }) => ARMING_FRAMES,
                Some(Signal::Pulse(_)) => ARMING_PULSES,
                // A pulse has two edges.
                None => 2 * ARMING_PULSES,
            },
            zeros: 0,
            since_ns: 0,
            last_ns: 0,
            command: false,
            waits_ns: None,
            has_armed: false,
            has_lapsed: false,
        }
    }

    fn edge(&mut self, now_ns: u64, ticks: u32, level: bool) {
        match &mut self.line {
            Some(line) => {
                let event = line.edge(ticks, level);
                self.event(now_ns, event);
            }
            None => {
                self.waits_ns = Some(now_ns);
                self.zero(now_ns, true);
            }
        }
    }

    fn settle(&mut self, now_ns: u64, ticks: u32) {
        let event = self.line.as_mut().and_then(|line| line.settle(ticks));
        self.event(now_ns, event);
        // What an edge ends counts from the time when it is believed.
        if let Some(edge_ns) = self.waits_ns {
            self.zero(now_ns, true);
            if now_ns - edge_ns >= LONGEST_FILTER_NS {
                self.waits_ns = None;
            }
        }
    }

    fn event(&mut self, now_ns: u64, event: Option<Event>) {
        match event {
            Some(Event::Frame { frame, .. }) if frame.value >= 48 => {
                self.expire(now_ns);
                self.last_ns = now_ns;
                self.command = false;
                self.zeros = 0;
            }
            Some(Event::Frame { frame, .. }) => self.zero(now_ns, frame.is_command()),
            // The pulse ends may have been calibrated: any pulse might be zero.
            Some(Event::Pulse { .. }) => self.zero(now_ns, false),
            Some(Event::Bad) | None => {}
        }
    }

    fn zero(&mut self, now_ns: u64, command: bool) {
        self.expire(now_ns);
        self.command = command;
        if self.zeros == 0 {
            self.since_ns = now_ns;
        }
        self.zeros += 1;
        self.last_ns = now_ns;
        // The ESC counts in whole microseconds.
        let held_ns = now_ns - self.since_ns + 1000;
        if self.zeros >= self.least && held_ns >= ARM_NS {
            self.has_armed = true;
            // Armed again since the silence, which no longer matters.
            self.has_lapsed = false;
        }
    }

    /// Starts counting again after too long a silence.
    fn expire(&mut self, now_ns: u64) {
        let silence_ns = now_ns - self.last_ns;
        let lapse_ns = if self.command {
            COMMAND_GAP_NS
        } else {
            LOSS_NS
        };
        if silence_ns > LOSS_NS + 1000 {
            self.zeros = 0;
        }
        self.has_lapsed |= silence_ns > lapse_ns + 1000;
    }

    /// Applies a silence, as the tasks do in their poll.
    fn poll(&mut self, now_ns: u64) {
        self.expire(now_ns);
        self.has_armed &= !core::mem::take(&mut self.has_lapsed);
    }

    fn may_turn(&self) -> bool {
        self.has_armed
    }
}

#[cfg(test)]
mod tests {
    use siskin_throttle::dshot::{Frame, Rate, edges};
    use siskin_throttle::signal::Pulse;

    use super::*;

    /// Returns whether the motor turns after this many zero throttle frames and some at half throttle, 1 ms
    /// apart, and whether it may.
    fn turns_after(zeros: u32) -> (bool, bool) {
        let rate = Rate::Dshot300;
        let mut desk = Desk::new(
            Some(Signal::Dshot {
                rate,
                bidirectional: false,
            }),
            0,
        );
        for frame in 0..zeros + 20 {
            let value = if frame < zeros { 0 } else { 1046 };
            let telemetry = false;
            let mut before_ns = 0;
            for (at_ns, level) in edges(Frame { value, telemetry }.to_bits(), rate) {
                desk.edge(u64::from(at_ns - before_ns), level);
                before_ns = at_ns;
            }
            desk.settle(1_000_000 - u64::from(before_ns));
        }
        let turns = matches!(desk.throttle.setpoint(), Setpoint::Speed(_));
        (turns, desk.judge.may_turn())
    }

    /// A wire with zero throttle servo pulses.
    fn pulsed() -> Desk {
        Desk::new(Some(Signal::Pulse(Pulse::Servo)), 0)
    }

    /// Sends zero throttle pulses at 50 Hz for half a second, in which the tasks do not run.
    fn half_a_second(desk: &mut Desk) {
        for _ in 0..25 {
            desk.edge(19_000_000, true);
            desk.edge(1_000_000, false);
        }
    }

    #[test]
    fn between_two_looks_of_the_tasks_a_wire_may_lapse_and_be_armed_anew() {
        let mut desk = pulsed();
        half_a_second(&mut desk);
        desk.settle(2_000_000);
        assert!(desk.esc.telemetry().armed);
        desk.edge(200_000_000, true);
        desk.edge(1_000_000, false);
        half_a_second(&mut desk);
        desk.settle(2_000_000);
        assert!(desk.esc.telemetry().armed && desk.judge.may_turn());
    }

    #[test]
    fn what_lapsed_and_was_not_armed_anew_may_not_turn() {
        let mut desk = pulsed();
        half_a_second(&mut desk);
        desk.settle(2_000_000);
        desk.edge(200_000_000, true);
        desk.edge(1_000_000, false);
        desk.settle(2_000_000);
        assert!(!desk.esc.telemetry().armed && !desk.judge.may_turn());
    }

    #[test]
    fn the_judge_knows_an_armed_wire_from_another() {
        assert_eq!(turns_after(350), (true, true));
        assert_eq!(turns_after(250), (false, false));
        assert_eq!(turns_after(0), (false, false));
    }
}
