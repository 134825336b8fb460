//! From the edges of the throttle wire to the decision whether the motor may turn.
//!
//! ```text
//! timer edges → line::Line → Event → authority::Authority → Command
//!                                  → command::Commands → Order
//!                                  → calibration::Calibration → the pulses' end points
//! ```
//!
//! [`dshot`] has the meaning of a frame and [`endpoints`] that of a pulse, [`line`](mod@line) decodes
//! both from a timer's edges, and [`authority`] alone decides whether the motor may turn. None of them
//! has a clock: the caller says when something happened. [`Input`] is all of it.

pub mod access;
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

/// The settings of the wire, from the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The signal that is taken and no other (`INP_PROTO`); any if there is none.
    pub protocol: Option<Signal>,
    /// Durations.
    pub timing: Timing,
    /// The way frames and pulses are read.
    pub reading: Reading,
}

/// The result of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// A frame or pulse of the signal that the wire is known to carry.
    pub event: Event,
    /// The order of the frame, if it gives one.
    pub order: Option<Order>,
}

/// One throttle wire, with all that is decided by it.
#[derive(Clone, Debug)]
pub struct Input {
    settings: Settings,
    line: Line,
    authority: Authority,
    commands: Commands,
    calibration: Calibration,
    tally: Tally,
    announcer: Announcer,
    /// As of the last poll.
    stopped: bool,
    /// Since when the wire has been at zero throttle.
    zero_since_us: Option<u64>,
    /// A signal was lost since this was last asked.
    lost: bool,
}

impl Input {
    /// A quiet wire at power-up, captured by a timer of `tick_hz`.
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

    /// Puts other settings in force. The wire must be armed again, unless only times have changed.
    pub fn set(&mut self, settings: Settings) {
        self.authority.set_timing(settings.timing);
        self.authority.set_reading(settings.reading);
        if settings.protocol != self.settings.protocol {
            // The decoder starts over with it: not for every change, while frames come in.
            self.line.force(settings.protocol);
            self.authority.restart();
        }
        self.settings = settings;
    }

    /// An edge: when the capturing timer saw it, and the level after it.
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) -> Option<Heard> {
        let event = self.line.edge(at_ticks, level);
        self.take(now_us, event.as_ref()?)
    }

    /// Takes all edges of a DShot frame at once, as [`Line::whole`] does. What is found is to be given to
    /// [`Input::heard`]; with that it is what [`Input::edge`] does edge by edge.
    #[inline(always)] // in time for the reply
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        self.line.whole(rests_high, bit)
    }

    /// Takes the event of [`Input::whole`].
    pub fn heard(&mut self, now_us: u64, event: &Event) -> Option<Heard> {
        self.take(now_us, event)
    }

    /// The time of the timer that captures the edges, once a control period or more often.
    pub fn settle(&mut self, now_us: u64, now_ticks: u32) -> Option<Heard> {
        let event = self.line.settle(now_ticks);
        self.take(now_us, event.as_ref()?)
    }

    fn take(&mut self, now_us: u64, event: &Event) -> Option<Heard> {
        self.expire(now_us);
        let identified = self.line.signal();
        self.hear(now_us, event, identified)
    }

    /// Takes the decoder's event, and the signal identified so far.
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
                // At another time it is no command, however often it is repeated.
                if in_time {
                    self.commands.frame(now_us, frame)
                } else {
                    self.commands.interrupt();
                    None
                }
            }
            Event::Pulse { kind, width_ns } => {
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

    /// Lets time pass, each millisecond or so, and takes in the drive's state.
    pub fn poll(&mut self, now_us: u64, drive: DriveStatus) {
        self.stopped = drive.stopped;
        self.expire(now_us);
        self.authority.fault(drive.faulted);
        let cancelled = self.calibration.poll(now_us);
        self.announcer.calibration(cancelled);
        self.tally.poll(now_us);
    }

    /// Begins a calibration by stick: from now on the stick is no throttle, not even zero.
    pub fn calibrate(&mut self, now_us: u64) {
        self.calibration.ask(now_us);
        self.authority.learn();
    }

    /// Ends a calibration by stick, if there is one.
    pub fn end_calibration(&mut self) {
        let cancelled = self.calibration.end();
        self.announcer.calibration(cancelled);
    }

    /// Applies time-outs.
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

    /// Returns true if a signal has been lost since the last call: the next one may come from another
    /// sender.
    pub fn take_loss(&mut self) -> bool {
        core::mem::take(&mut self.lost)
    }

    /// The next news for a person; to be called after each poll until there is none.
    pub fn news(&mut self, now_us: u64) -> Option<News> {
        let standing = Standing {
            signal: self.signal(now_us),
            armed: self.authority.armed(),
            open: self.authority.refuses() && !self.calibration.is_under_way(),
        };
        self.announcer.next(now_us, standing)
    }

    /// The signal on the wire; none before it has been identified, and none on a silent wire.
    pub fn signal(&self, now_us: u64) -> Option<Signal> {
        let present = self.authority.signal_present(now_us);
        self.line.signal().filter(|_| present)
    }

    /// The signal that has been identified or forced, whether it is there or not.
    pub fn known(&self) -> Option<Signal> {
        self.line.signal()
    }

    /// The authority over the motor.
    pub fn authority(&self) -> &Authority {
        &self.authority
    }

    /// The authority, for those who may disarm it or test.
    pub fn authority_mut(&mut self) -> &mut Authority {
        &mut self.authority
    }

    /// Frames and pulses that were bad, since the start.
    pub fn bad_frames(&self) -> u32 {
        self.tally.bad_total()
    }

    /// The share of bad ones in the last whole second, 0 to 1.
    pub fn bad_share(&self) -> f32 {
        self.tally.bad_share()
    }
}
