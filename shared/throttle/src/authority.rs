//! Decides whether the motor may be energised: only an armed wire or a time-limited test turns it. What the tasks want
//! of its phases besides, an identification, a self-test's pulse or a note, is granted only while nothing here demands
//! anything and nothing bars the motor.
//!
//! Zero throttle, held for a set time in an identified signal, arms the wire. Losing that signal disarms it,
//! and an unarmed wire never turns the motor. Only a frame with a correct checksum, or a pulse, changes the
//! command. When nearly all other frames fail their check, as random words do, the valid ones do not count
//! either: one random word in sixteen passes by chance. That judgement takes some twelve frames, so a wire at
//! zero opens only after several throttle frames in a row. Of armed wires that turn to noise at zero, one in
//! 2170 then turns the motor; opening on the first throttle frame would let 57 of 100 turn it. A pulse has no
//! checksum; that it is like the one before is its check.

use siskin_units::math::Real;

use super::Share;
use super::command::within;
use super::demand::Reading;
use super::endpoints::Demand;
use super::event::{Event, Likeness};
use super::signal::Signal;
use super::trust::Trust;

/// The minimum number of zero-throttle frames that arm a wire.
const ARMING_FRAMES: u32 = 30;
/// The minimum number of zero-throttle pulses that arm a wire; a servo signal has 50 a second.
const ARMING_PULSES: u32 = 5;

/// Zeros, without throttle in between, that close an armed wire. In flight a zero may be another frame with errors
/// that its checksum misses: it stops the motor until the next throttle frame. A wire is armed closed.
const CLOSING: u8 = 10;
/// Consecutive throttle frames of about the same throttle, or pulses like the one before from the second on, without a
/// bad one in between, that reopen it. They delay the first by 0.75 ms at 4 kHz, 3 ms at 1 kHz, 60 ms with a servo's
/// 50 Hz.
const OPENING: u8 = 4;
/// The most by which two such frames differ. Noise that passes its check has any throttle.
const AGREE: Share = Share::lit("0.0625");

/// The longest silence after a DShot command that is not a loss, µs. The protocol allows 260 ms after a beacon,
/// and Betaflight's loop, which waits for it, sends the next frame 110 ms later.
const COMMAND_GAP_US: u64 = 300_000;

/// The longest test, s.
const TEST_MOST_S: f32 = 3.0;

/// Arming and loss times of the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// How long zero throttle must be held to arm, µs.
    pub arm_us: u64,
    /// The longest time without a valid frame before the signal counts as lost, µs.
    pub loss_us: u64,
}

/// The command to the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Do not turn.
    Stop,
    /// Do not turn: the armed wire holds zero throttle, or somebody disarmed. Clears an earlier fault.
    Zero,
    /// Turn by the wire's throttle.
    Throttle(Share),
    /// Turn by a test's value.
    Test(Share),
}

impl Command {
    /// Returns true if nothing turns the motor.
    pub fn rests(self) -> bool {
        matches!(self, Self::Stop | Self::Zero)
    }
}

/// What may energise the motor's phases: only [`Authority::grant`] makes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Granted<T>(Demanded<T>);

impl<T> Granted<T> {
    /// Returns what is granted.
    pub fn demanded(self) -> Demanded<T> {
        self.0
    }
}

/// What is demanded of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demanded<T> {
    /// By the wire or a motor test; rest, if by nobody.
    Command(Command),
    /// By the tasks.
    Use(T),
}

/// The drive's state, for tests that need the motor at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveStatus {
    /// The drive is not turning the motor, nothing asks it to, and the shaft is at rest.
    pub stopped: bool,
    /// A fault holds the bridge off.
    pub faulted: bool,
}

/// Arming refused: the wire does not hold valid zero throttle, or the authority is barred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Denied;

/// The reason a test was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestError {
    /// Value outside 0 to 1 (−1 to 1 with two directions), or time outside 0 to 3 s.
    OutOfRange,
    /// The motor turns, a fault holds, the wire is neither silent nor at valid zero, or the authority is
    /// barred.
    TemporarilyRejected,
}

/// Decides whether the motor may turn.
///
/// Times are in µs from an arbitrary origin, and monotonic.
#[derive(Clone, Debug)]
pub struct Authority {
    timing: Timing,
    reading: Reading,
    armed: bool,
    arming: Option<Arming>,
    valid: Option<Valid>,
    trust: Trust,
    /// Zeros since the last throttle that was let through.
    closing: u8,
    /// Throttle frames since the last zero or bad frame, and the last one's throttle.
    opening: u8,
    throttle: Share,
    event_us: Option<u64>,
    test: Option<Test>,
    /// Somebody disarmed since the motor was last driven: until the present fault ends, this counts as zero
    /// throttle on the wire.
    forgiven: bool,
    /// Nothing may turn the motor, whoever asks.
    barred: bool,
}

/// Zero throttle being held to arm.
#[derive(Clone, Copy, Debug)]
struct Arming {
    since_us: u64,
    zeros: u32,
    failed: u32,
}

/// The last frame with a correct checksum, or pulse.
#[derive(Clone, Copy, Debug)]
struct Valid {
    at_us: u64,
    signal: Signal,
    /// The wire was known to carry this signal, so the demand may be trusted.
    identified: bool,
    demand: Demand,
    /// It was a DShot command.
    command: bool,
}

#[derive(Clone, Copy, Debug)]
struct Test {
    value: Share,
    ends_us: u64,
}

impl Authority {
    /// Creates an unarmed authority without a signal.
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
            throttle: Share::ZERO,
            event_us: None,
            test: None,
            forgiven: false,
            barred: false,
        }
    }

    /// Bars everything, wire and tests, from turning the motor, or lifts the bar. The wire must then be armed
    /// again.
    pub fn bar(&mut self, barred: bool) {
        self.barred = barred;
        if barred {
            self.restart();
            self.test = None;
        }
    }

    /// Changes the times, effective at once.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = timing;
    }

    /// Changes how frames and pulses are read, and the directions of tests. What was zero may now be full
    /// throttle, so any change disarms the wire.
    pub fn set_reading(&mut self, reading: Reading) {
        if self.reading != reading {
            self.reading = reading;
            self.restart();
        }
    }

    /// Processes a decoder event, given the signal identified so far.
    ///
    /// Before identification zero throttle counts but does not arm; after it, any other signal is bad.
    pub fn wire(&mut self, now_us: u64, event: Event, identified: Option<Signal>) {
        // Timeouts before this event apply even when `poll` is late.
        self.poll(now_us);
        self.event_us = Some(now_us);
        let (Some(signal), Some(demand)) = (event.signal(), self.reading.demand(&event)) else {
            return self.count_failure();
        };
        if identified.is_some_and(|identified| identified != signal) {
            return self.count_failure();
        }
        let open = self.armed && self.closing < CLOSING;
        match event {
            Event::Pulse {
                likeness: Likeness::Both,
                ..
            } => self.trust.good_pulse(),
            Event::Pulse {
                likeness: Likeness::Either,
                ..
            } if open => {}
            Event::Pulse { .. } => self.trust.bad(),
            _ => self.trust.good(),
        }
        match demand {
            Demand::Zero => {
                self.closing = self.closing.saturating_add(1);
                self.opening = 0;
            }
            Demand::Throttle(throttle) => {
                self.arming = None;
                self.test = None;
                let before = core::mem::replace(&mut self.throttle, throttle);
                let agrees = match event {
                    Event::Pulse { likeness, .. } => likeness == Likeness::Both,
                    _ => throttle.abs_diff(before) <= AGREE,
                };
                let row = if agrees { self.opening } else { 0 };
                self.opening = row.saturating_add(1);
            }
        }
        if !self.trust.believes() {
            // It neither keeps the signal alive nor opens the throttle. Stopping is right either way, and it
            // ends the sender's silence after a command.
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
        let demand = self.opened(demand);
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

    /// Returns the demand to act on: an armed wire at zero holds it for the first throttle frames or pulses.
    fn opened(&mut self, demand: Demand) -> Demand {
        let closed = self.armed && self.closing >= CLOSING;
        if closed && self.opening < OPENING {
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
            self.closing = CLOSING;
        }
    }

    /// Counts a bad frame. More bad frames than good: what arrives may be noise, and the zeros chance.
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

    /// Disarms: the wire must be armed again.
    pub fn restart(&mut self) {
        self.armed = false;
        self.arming = None;
    }

    /// Starts learning the stick's end points: for now it is not throttle, not even zero.
    pub fn learn(&mut self) {
        self.restart();
        self.test = None;
        if let Some(valid) = &mut self.valid {
            valid.identified = false;
        }
    }

    /// Applies the timeouts of signal and test; returns true once for each lost signal.
    ///
    /// How rarely it is called only affects how long a lost signal or a test outlasts its time.
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

    /// Returns the command to the motor as of the last [`Authority::poll`] or event.
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

    /// Returns true if the wire shows zero throttle and no test runs.
    pub fn rests_by_wire(&self) -> bool {
        let zero = |valid: Valid| valid.identified && valid.demand == Demand::Zero;
        self.test.is_none() && self.valid.is_some_and(zero)
    }

    /// Returns true if throttle on the wire would turn the motor.
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Returns true if the wire demands throttle but is not armed.
    pub fn refuses(&self) -> bool {
        let open = self
            .valid
            .is_some_and(|valid| valid.identified && valid.demand != Demand::Zero);
        open && !self.armed
    }

    /// Returns true if a valid frame or pulse arrived within the loss time. After a command an armed wire at
    /// rest may stay silent longer: nothing turns that a loss would have to stop.
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

    /// Answers a request to arm. It grants nothing that the wire does not: only the wire's own zero throttle,
    /// held for its time, arms it.
    ///
    /// # Errors
    /// [`Denied`] unless the last valid frame is zero throttle and within the loss time, and the authority is
    /// not barred.
    pub fn arm(&self, now_us: u64) -> Result<(), Denied> {
        if self.holds_zero(now_us) && !self.barred {
            Ok(())
        } else {
            Err(Denied)
        }
    }

    /// Turns the motor by `value`, 0 to 1 (−1 to 1 with two directions), for `duration_s`; NaN ends a running
    /// test.
    ///
    /// The test ends on time, at any non-zero throttle on the wire, at [`Authority::disarm`] and at
    /// [`Authority::fault`].
    ///
    /// # Errors
    /// See [`TestError`]. A refused test leaves a running one alone.
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
        // Zero time or zero value is no test.
        self.test = (duration_us > 0 && value != 0.0).then(|| Test {
            value: Share::from_f32(value),
            ends_us: now_us.saturating_add(duration_us),
        });
        Ok(())
    }

    /// Returns what may energise the motor now, of the command and of what the tasks want besides.
    #[inline(always)] // one caller, at each frame
    pub fn grant<T>(&self, wanted: Option<T>) -> Granted<T> {
        let command = self.command();
        Granted(match wanted {
            Some(wanted) if command.rests() && !self.barred => Demanded::Use(wanted),
            _ => Demanded::Command(command),
        })
    }

    /// Returns true if nothing may energise the motor.
    pub fn barred(&self) -> bool {
        self.barred
    }

    /// Returns true if a test or a measurement may begin: the motor is at rest without a fault, and the wire is silent
    /// or at valid zero. This holds even when barred, so that a self-test can find out why: then it measures what
    /// needs no current.
    pub fn may_test(&self, now_us: u64, drive: DriveStatus) -> bool {
        let silent = !within(now_us, self.event_us, self.timing.loss_us);
        drive.stopped && !drive.faulted && (silent || self.holds_zero(now_us))
    }

    /// Reports on each poll whether a fault holds the bridge off. A fault ends a test; once it has cleared, an
    /// earlier disarm no longer clears anything.
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
