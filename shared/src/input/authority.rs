//! Decides whether the motor may turn: by an armed wire, or by a test of limited time. Nothing else
//! turns it but an identification, which is begun under the rule of a test, and only while nobody here asks for
//! anything (`Throttle::setpoint`).
//!
//! The wire is armed by zero throttle held for a time, in a signal that has been identified. It is
//! disarmed when that signal is lost, and never turns a motor before it is armed. Only a frame whose
//! checksum is right, or a pulse, can change the command to the motor. If nearly all other frames fail,
//! as random words do, the right ones do not count either: of random words one in sixteen is right by
//! chance. That judgement takes some twelve frames, so a wire at zero opens only after several
//! throttles in a row: of armed wires that become noise at zero, one in 2170 turns the motor, where the
//! first throttle alone would turn it in 57 of 100.

use super::Share;
use super::command::within;
use super::demand::Reading;
use super::endpoints::Demand;
use super::event::Event;
use super::signal::Signal;
use super::trust::Trust;
use crate::math::Real;

/// Zero-throttle frames that arm a wire, at least.
const ARMING_FRAMES: u32 = 30;
/// Pulses that arming takes; a servo's come 50 times a second.
const ARMING_PULSES: u32 = 5;

/// DShot zeros, with no throttle between, that close an armed wire. In flight some may be other frames with errors
/// that their check does not show: these stop the motor until the next throttle.
const CLOSING_FRAMES: u8 = 10;
/// DShot throttles in a row, with no bad frame between, that open it again: 0.75 ms later than the first at
/// 4 kHz, 3 ms at 1 kHz. A pulse has no checksum to be right by chance: it opens at once. Edges that pass for
/// pulses do so in a row too, and spikes never do.
const OPENING_FRAMES: u8 = 4;

/// The longest silence after a DShot command that is no loss, µs. The protocol leaves 260 ms after a
/// beacon, and Betaflight's loop, which waits for it, 110 ms until the next frame.
const COMMAND_GAP_US: u64 = 300_000;

/// The longest test, s.
const TEST_MOST_S: f32 = 3.0;

/// Times of the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Time for which zero throttle must be held to arm, µs.
    pub arm_us: u64,
    /// The longest time without a valid frame; past it the signal is lost, µs.
    pub loss_us: u64,
}

/// The command to the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Do not turn.
    Stop,
    /// Do not turn, because the armed wire holds zero throttle, or somebody has disarmed: an earlier fault
    /// is forgiven.
    Zero,
    /// Turn, by the wire's throttle.
    Throttle(Share),
    /// Turn, by a test's value.
    Test(Share),
}

impl Command {
    /// Returns true if nothing turns the motor.
    pub fn rests(self) -> bool {
        matches!(self, Self::Stop | Self::Zero)
    }
}

/// The drive's state, for those who may test only a motor at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveStatus {
    /// The drive does not turn the motor, nothing asks it to, and the shaft is at rest.
    pub stopped: bool,
    /// A fault holds the bridge off.
    pub faulted: bool,
}

/// Arming was refused: the wire does not hold valid zero throttle, or nothing may turn the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Denied;

/// The reason why a test was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestError {
    /// A value outside 0 to 1, or −1 to 1 with two directions, or a time outside 0 to 3 s.
    OutOfRange,
    /// The motor turns, a fault holds, the wire is neither silent nor at valid zero, or nothing may turn
    /// the motor.
    TemporarilyRejected,
}

/// Decides whether the motor may turn.
///
/// Times are in µs since any start, and do not run backwards.
#[derive(Clone, Debug)]
pub struct Authority {
    timing: Timing,
    reading: Reading,
    armed: bool,
    arming: Option<Arming>,
    valid: Option<Valid>,
    trust: Trust,
    /// Zeros since the throttle was open.
    closing: u8,
    /// Throttles since the last zero or bad frame.
    opening: u8,
    event_us: Option<u64>,
    test: Option<Test>,
    /// Somebody has disarmed since the last drive: until the fault that may hold has ended, that is as good as zero
    /// throttle on the wire.
    forgiven: bool,
    /// True if nothing may turn the motor, whoever asks.
    barred: bool,
}

/// Zero throttle since some time.
#[derive(Clone, Copy, Debug)]
struct Arming {
    since_us: u64,
    zeros: u32,
    failed: u32,
}

/// The last frame with a right checksum, or pulse.
#[derive(Clone, Copy, Debug)]
struct Valid {
    at_us: u64,
    signal: Signal,
    /// True if the wire was known to carry this signal, and it means what it says.
    identified: bool,
    demand: Demand,
    /// True if it was a DShot command.
    command: bool,
}

#[derive(Clone, Copy, Debug)]
struct Test {
    value: Share,
    ends_us: u64,
}

impl Authority {
    /// Unarmed, with no signal.
    pub fn new(timing: Timing) -> Self {
        Self {
            timing,
            reading: Reading::default(),
            armed: false,
            arming: None,
            valid: None,
            trust: Trust::default(),
            closing: 0,
            opening: 0,
            event_us: None,
            test: None,
            forgiven: false,
            barred: false,
        }
    }

    /// Lets nothing turn the motor from now on, neither the wire nor a test, or lets them again. The wire
    /// must be armed again then.
    pub fn bar(&mut self, barred: bool) {
        self.barred = barred;
        if barred {
            self.restart();
            self.test = None;
        }
    }

    /// Changes the times, at once.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = timing;
    }

    /// Changes how frames and pulses are read, and the directions of tests. What was zero may be
    /// full throttle now: the wire must be armed again if anything changes.
    pub fn set_reading(&mut self, reading: Reading) {
        if self.reading != reading {
            self.reading = reading;
            self.restart();
        }
    }

    /// Takes the decoder's event, and the signal identified so far.
    ///
    /// Before one is identified, zero throttle counts and does not arm. Later, any other is bad.
    pub fn wire(&mut self, now_us: u64, event: Event, identified: Option<Signal>) {
        // Time-outs before this event apply, however late `poll` is.
        self.poll(now_us);
        self.event_us = Some(now_us);
        let (Some(signal), Some(demand)) = (event.signal(), self.reading.demand(&event)) else {
            return self.count_failure();
        };
        if identified.is_some_and(|identified| identified != signal) {
            return self.count_failure();
        }
        match demand {
            Demand::Zero => {
                self.closing = self.closing.saturating_add(1);
                self.opening = 0;
            }
            Demand::Throttle(_) => {
                self.arming = None;
                self.test = None;
                self.opening = self.opening.saturating_add(1);
            }
        }
        if matches!(signal, Signal::Dshot { .. }) && !self.trust.good() {
            // It keeps no signal and opens no throttle. To stop is right in either case, and the sender is not
            // silent any more.
            if let Some(valid) = &mut self.valid {
                valid.command = false;
                if demand == Demand::Zero {
                    valid.demand = demand;
                }
            }
            return;
        }
        if self.valid.is_some_and(|valid| valid.signal != signal) {
            self.restart();
        }
        let demand = self.opened(signal, demand);
        let valid = Valid {
            at_us: now_us,
            signal,
            identified: identified.is_some(),
            demand,
            command: matches!(event, Event::Frame { frame, .. } if frame.is_command()),
        };
        self.valid = Some(valid);
        if demand == Demand::Zero && !self.armed && !self.barred {
            self.count_zero(&valid);
        }
    }

    /// The demand; an armed wire at zero stays there for the first throttles.
    fn opened(&mut self, signal: Signal, demand: Demand) -> Demand {
        let closed = self.armed && self.closing >= CLOSING_FRAMES;
        let waits = closed && self.opening < OPENING_FRAMES;
        if waits && matches!(signal, Signal::Dshot { .. }) {
            return Demand::Zero;
        }
        if demand != Demand::Zero {
            self.closing = 0;
        }
        demand
    }

    fn count_zero(&mut self, valid: &Valid) {
        let arming = self.arming.get_or_insert(Arming {
            since_us: valid.at_us,
            zeros: 0,
            failed: 0,
        });
        arming.zeros = arming.zeros.saturating_add(1);
        let held_us = valid.at_us.saturating_sub(arming.since_us);
        let least = match valid.signal {
            Signal::Dshot { .. } => ARMING_FRAMES,
            Signal::Pulse(_) => ARMING_PULSES,
        };
        let held = arming.zeros >= least && held_us >= self.timing.arm_us;
        if valid.identified && held {
            self.armed = true;
            self.arming = None;
        }
    }

    /// More bad frames than good ones: what arrives may be noise, and zero by chance.
    fn count_failure(&mut self) {
        self.trust.bad();
        self.opening = 0;
        if let Some(arming) = &mut self.arming {
            arming.failed = arming.failed.saturating_add(1);
            if arming.failed > arming.zeros {
                self.arming = None;
            }
        }
    }

    /// The wire must be armed again.
    pub fn restart(&mut self) {
        self.armed = false;
        self.arming = None;
    }

    /// The stick teaches its end points: for now it is no throttle, not even zero.
    pub fn learn(&mut self) {
        self.restart();
        self.test = None;
        if let Some(valid) = &mut self.valid {
            valid.identified = false;
        }
    }

    /// Applies time-outs: of a lost signal's arming, and of a test.
    ///
    /// Between two calls a lost signal or a test lasts longer than it should; otherwise it does not
    /// matter how rarely it is called. Returns true once for each signal that was lost.
    pub fn poll(&mut self, now_us: u64) -> bool {
        if self.test.is_some_and(|test| now_us >= test.ends_us) {
            self.test = None;
        }
        let lost = self.valid.is_some() && !self.signal_present(now_us);
        if lost {
            self.valid = None;
            self.restart();
        }
        lost
    }

    /// The command to the motor, as of the last [`Authority::poll`] or event.
    pub fn command(&self) -> Command {
        if let Some(test) = self.test {
            return Command::Test(test.value);
        }
        match self.valid.map(|valid| valid.demand) {
            Some(Demand::Throttle(throttle)) if self.armed => Command::Throttle(throttle),
            Some(Demand::Zero) if self.armed => Command::Zero,
            _ if self.forgiven => Command::Zero,
            _ => Command::Stop,
        }
    }

    /// Returns true if the wire shows zero throttle, and no test runs.
    pub fn rests_by_wire(&self) -> bool {
        let zero = |valid: Valid| valid.identified && valid.demand == Demand::Zero;
        self.test.is_none() && self.valid.is_some_and(zero)
    }

    /// Returns true if a throttle on the wire would turn the motor.
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Returns true if the wire asks the motor to turn, and may not.
    pub fn refuses(&self) -> bool {
        let open = self
            .valid
            .is_some_and(|valid| valid.identified && valid.demand != Demand::Zero);
        open && !self.armed
    }

    /// Returns true if a valid frame or pulse has come within the loss time. After a command an armed
    /// wire at rest may be silent for longer: that stops nothing which is not stopped already.
    pub fn signal_present(&self, now_us: u64) -> bool {
        let loss_us = match self.valid {
            Some(valid) if self.armed && valid.command => self.timing.loss_us.max(COMMAND_GAP_US),
            _ => self.timing.loss_us,
        };
        within(now_us, self.valid.map(|valid| valid.at_us), loss_us)
    }

    /// Stops the motor, whatever turns it. The wire must be armed again by its zero throttle.
    pub fn disarm(&mut self) {
        self.restart();
        self.test = None;
        self.forgiven = true;
    }

    /// A request to arm. It grants nothing that the wire does not: only its own zero throttle,
    /// held for its time, arms it.
    ///
    /// # Errors
    /// [`Denied`] unless the last valid frame is zero throttle and not older than the loss time, and the
    /// wire may turn the motor.
    pub fn arm(&self, now_us: u64) -> Result<(), Denied> {
        if self.holds_zero(now_us) && !self.barred {
            Ok(())
        } else {
            Err(Denied)
        }
    }

    /// Turns the motor by `value`, 0 to 1 or −1 to 1 with two directions, for `duration_s`; NaN ends
    /// a running test.
    ///
    /// It ends at its time, at any throttle on the wire but zero, at [`Authority::disarm`] and at
    /// [`Authority::fault`].
    ///
    /// # Errors
    /// See [`TestError`]. A refused test leaves a running one as it is.
    pub fn actuator_test(
        &mut self,
        now_us: u64,
        value: f32,
        duration_s: f32,
        drive: DriveStatus,
    ) -> Result<(), TestError> {
        self.poll(now_us);
        if value.is_nan() {
            self.test = None;
            return Ok(());
        }
        let least = if self.reading.two_directions {
            -1.0
        } else {
            0.0
        };
        if !(least..=1.0).contains(&value) || !(0.0..=TEST_MOST_S).contains(&duration_s) {
            return Err(TestError::OutOfRange);
        }
        if self.barred || !self.may_test(now_us, drive) {
            return Err(TestError::TemporarilyRejected);
        }
        let duration_us = u64::from((duration_s * 1e6) as u32);
        // No time at all, or nothing to turn by, is no test.
        self.test = (duration_us > 0 && value != 0.0).then(|| Test {
            value: Share::from_f32(value),
            ends_us: now_us.saturating_add(duration_us),
        });
        Ok(())
    }

    /// Returns true if something else than the wire may use the motor: it rests without a fault, and
    /// the wire is silent or at valid zero. Even if nothing may turn the motor, a self-test may still
    /// find out why.
    pub fn may_test(&self, now_us: u64, drive: DriveStatus) -> bool {
        let silent = !within(now_us, self.event_us, self.timing.loss_us);
        drive.stopped && !drive.faulted && (silent || self.holds_zero(now_us))
    }

    /// To be called at each look with true if a fault holds the bridge off: that ends a test. When the fault
    /// has ended, a disarming no longer forgives anything.
    pub fn fault(&mut self, holds: bool) {
        if holds {
            self.test = None;
        } else {
            self.forgiven = false;
        }
    }

    fn holds_zero(&self, now_us: u64) -> bool {
        let zero = self
            .valid
            .is_some_and(|valid| valid.identified && valid.demand == Demand::Zero);
        zero && self.signal_present(now_us)
    }
}

#[cfg(test)]
mod tests;
