//! The throttle wire: turns its edges into the decision whether the motor may turn, and answers on it.
//!
//! ```text
//! timer edges → line::Line → Event → authority::Authority → Command
//!                                  → command::Commands → Order
//!                                  → calibration::Calibration → the pulses' end points
//!                                  → answer::Ask … answer::Reply → wire
//! ```
//!
//! [`dshot`] defines what a frame means and [`endpoints`] what a pulse means; [`line`](mod@line) decodes both
//! from timer edges; [`authority`] alone decides whether the motor may turn. None of them owns a clock: the
//! caller passes the time of every event. [`Input`] ties them together. [`answer`] is the code of the replies.
//!
//! ```
//! use siskin_throttle::dshot::{Frame, Rate, edges};
//! use siskin_throttle::line::{Event, Line};
//! use siskin_throttle::signal::Signal;
//!
//! let rate = Rate::Dshot300;
//! let sent = Frame { value: 1046, telemetry: true };
//! // Captured by a timer of one tick per nanosecond.
//! let mut line = Line::new(1_000_000_000);
//! line.force(Some(Signal::Dshot { rate, bidirectional: false }));
//! let event = edges(sent.to_bits(), rate).find_map(|(at_ns, level)| line.edge(at_ns, level));
//! assert!(matches!(event, Some(Event::Frame { frame, .. }) if frame == sent));
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod access;
pub mod answer;
pub mod authority;
pub mod calibration;
mod capture;
pub mod command;
pub mod demand;
mod detect;
pub mod dshot;
pub mod endpoints;
pub mod event;
mod filter;
pub mod line;
mod news;
mod pulse;
mod share;
pub mod signal;
mod tally;
mod trust;

#[cfg(test)]
mod tests;

pub use news::News;
pub use share::{Share, reverse};

use authority::{Authority, DriveStatus, Timing};
use calibration::Calibration;
use command::{Commands, Order};
use demand::Reading;
use event::Event;
use line::Line;
use news::{Announcer, Standing};
use signal::Signal;
use tally::Tally;

/// Wire settings, from the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The only signal to accept (`INP_PROTO`); `None` accepts any.
    pub protocol: Option<Signal>,
    /// Arming and loss times.
    pub timing: Timing,
    /// How frames and pulses map to throttle.
    pub reading: Reading,
}

/// The result of one edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// A frame or pulse of the identified signal.
    pub event: Event,
    /// The order that the frame gives, if any.
    pub order: Option<Order>,
}

/// Returns true if a wire carries something, but no signal that is known: one of another kind, or noise.
pub fn is_unknown(signal: Option<Signal>, bad_share: f32) -> bool {
    signal.is_none() && bad_share > 0.5
}

/// One throttle wire, from the decoder to the authority.
#[derive(Clone, Debug)]
pub struct Input {
    settings: Settings,
    line: Line,
    authority: Authority,
    commands: Commands,
    calibration: Calibration,
    tally: Tally,
    announcer: Announcer,
    /// Whether the motor was at rest at the last poll.
    stopped: bool,
    /// When the wire went to zero throttle.
    zero_since_us: Option<u64>,
    /// A signal was lost since the last [`Input::take_loss`].
    lost: bool,
}

impl Input {
    /// Creates the input for a quiet wire at power-up, captured by a timer running at `tick_hz`.
    pub fn new(tick_hz: u32, settings: Settings) -> Self {
        let mut line = Line::new(tick_hz);
        line.force(settings.protocol);
        let mut authority = Authority::new(settings.timing);
        authority.set_reading(settings.reading);
        Self {
            settings,
            line,
            authority,
            commands: Commands::default(),
            calibration: Calibration::default(),
            tally: Tally::default(),
            announcer: Announcer::default(),
            stopped: false,
            zero_since_us: None,
            lost: false,
        }
    }

    /// Applies new settings. Anything but a change of times disarms the wire.
    pub fn set(&mut self, settings: Settings) {
        self.authority.set_timing(settings.timing);
        self.authority.set_reading(settings.reading);
        if settings.protocol != self.settings.protocol {
            // A new protocol restarts the decoder, so do this only when it changes: frames keep arriving.
            self.line.force(settings.protocol);
            self.authority.restart();
        }
        self.settings = settings;
    }

    /// Takes one edge: its capture time, and the level after it.
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) -> Option<Heard> {
        let event = self.line.edge(at_ticks, level);
        self.take(now_us, event.as_ref()?)
    }

    /// Takes all edges of a DShot frame at once, as [`Line::whole`] does. Pass the result to [`Input::heard`];
    /// together they are equivalent to [`Input::edge`] on each edge.
    #[inline(always)] // in time for the reply
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        self.line.whole(rests_high, bit)
    }

    /// Processes the event from [`Input::whole`].
    pub fn heard(&mut self, now_us: u64, event: &Event) -> Option<Heard> {
        self.take(now_us, event)
    }

    /// Advances the decoder to the capture timer's current time. Call it at least once per control period.
    pub fn settle(&mut self, now_us: u64, now_ticks: u32) -> Option<Heard> {
        let event = self.line.settle(now_ticks);
        self.take(now_us, event.as_ref()?)
    }

    fn take(&mut self, now_us: u64, event: &Event) -> Option<Heard> {
        self.expire(now_us);
        let identified = self.line.signal();
        self.hear(now_us, event, identified)
    }

    /// Processes a decoder event, given the signal identified so far.
    fn hear(&mut self, now_us: u64, event: &Event, identified: Option<Signal>) -> Option<Heard> {
        self.authority.wire(now_us, *event, identified);
        let known = identified.is_some() && event.signal() == identified;
        let valid = *event != Event::Bad && (known || identified.is_none());
        self.tally.count(valid);
        if !valid {
            self.commands.bad(now_us);
        }
        if !known {
            return None;
        }
        let order = match *event {
            Event::Frame { frame, .. } => {
                let cancelled = self.calibration.end();
                self.announcer.calibration(cancelled);
                let rests = self.authority.rests_by_wire();
                self.zero_since_us = rests.then(|| self.zero_since_us.unwrap_or(now_us));
                let in_time = self.zero_since_us.zip(Order::of(frame.value));
                let in_time = in_time.is_some_and(|(since_us, order)| {
                    order.is_in_time(self.stopped, now_us.saturating_sub(since_us))
                });
                // Outside that window it is not a command, however often it repeats.
                if in_time {
                    self.commands.frame(now_us, frame)
                } else {
                    self.commands.interrupt();
                    None
                }
            }
            Event::Pulse { kind, width_ns, .. } => {
                let step = self.calibration.pulse(now_us, kind.servo_ns(width_ns));
                self.announcer.calibration(step);
                if self.calibration.is_under_way() {
                    self.authority.learn();
                }
                None
            }
            Event::Bad => None,
        };
        Some(Heard {
            event: *event,
            order,
        })
    }

    /// Advances time and takes in the drive's state. Call it about once per millisecond.
    pub fn poll(&mut self, now_us: u64, drive: DriveStatus) {
        self.stopped = drive.stopped;
        self.expire(now_us);
        self.authority.fault(drive.faulted);
        let cancelled = self.calibration.poll(now_us);
        self.announcer.calibration(cancelled);
        self.tally.poll(now_us);
    }

    /// Starts a stick calibration: from now on the stick is not throttle, not even zero.
    pub fn calibrate(&mut self, now_us: u64) {
        self.calibration.ask(now_us);
        self.authority.learn();
    }

    /// Ends a running stick calibration.
    pub fn end_calibration(&mut self) {
        let cancelled = self.calibration.end();
        self.announcer.calibration(cancelled);
    }

    /// Applies timeouts.
    fn expire(&mut self, now_us: u64) {
        let armed = self.authority.armed();
        if self.authority.poll(now_us) {
            self.lost = true;
            self.zero_since_us = None;
            self.line.lost();
            self.commands.interrupt();
            let cancelled = self.calibration.lost();
            self.announcer.calibration(cancelled);
            self.announcer.lost(armed);
        }
    }

    /// Returns true if a signal was lost since the last call, in which case the next one may come from another
    /// sender.
    pub fn take_loss(&mut self) -> bool {
        core::mem::take(&mut self.lost)
    }

    /// Returns the next news for the user. Call it after each poll until it returns `None`.
    pub fn news(&mut self, now_us: u64) -> Option<News> {
        let standing = Standing {
            signal: self.signal(now_us),
            armed: self.authority.armed(),
            unknown: is_unknown(self.signal(now_us), self.bad_share()),
            open: self.authority.refuses() && !self.calibration.is_under_way(),
        };
        self.announcer.next(now_us, standing)
    }

    /// Returns the signal on the wire, or `None` before identification and on a silent wire.
    pub fn signal(&self, now_us: u64) -> Option<Signal> {
        let present = self.authority.signal_present(now_us);
        self.line.signal().filter(|_| present)
    }

    /// Returns the identified or forced signal, whether or not it is present.
    pub fn known(&self) -> Option<Signal> {
        self.line.signal()
    }

    /// Returns the authority over the motor.
    pub fn authority(&self) -> &Authority {
        &self.authority
    }

    /// Returns the authority for callers that may disarm it or run a test.
    pub fn authority_mut(&mut self) -> &mut Authority {
        &mut self.authority
    }

    /// Returns the number of bad frames and pulses since power-up.
    pub fn bad_frames(&self) -> u32 {
        self.tally.bad_total()
    }

    /// Returns the share of bad frames in the last full second, 0 to 1.
    pub fn bad_share(&self) -> f32 {
        self.tally.bad_share()
    }
}
