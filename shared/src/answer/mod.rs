//! Answers to the flight controller: on the throttle wire and on a serial line.
//!
//! A bidirectional frame is answered on its own wire ([`gcr`]) with the speed ([`erpm`]) or a word
//! of extended telemetry ([`extended`]); a frame with its telemetry bit set, on the serial line
//! ([`kiss`]).

mod basis;
pub mod erpm;
pub mod extended;
pub mod gcr;
mod health;
pub mod info;
pub mod kiss;
mod schedule;

use crate::drive::Snapshot;
use crate::input::command::Order;
use crate::input::dshot::Rate;
use crate::input::line::Event;
use crate::math::{quotient, round};
use crate::telemetry::Telemetry;
pub use basis::Basis;
use extended::Extended;
use health::Health;
use schedule::{Kind, Schedule};

/// From the end of a frame to its reply, ns, at every rate.
pub const REPLY_DELAY_NS: u32 = 30_000;

/// The answers that a frame may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// Time of the frame's first edge, in ticks of the capturing timer.
    pub first_edge_ticks: u32,
    /// The frame's rate.
    pub rate: Rate,
    /// True if it is to be answered on its wire.
    pub bidirectional: bool,
    /// True if telemetry is to be sent on the serial line.
    pub telemetry: bool,
}

/// The answer to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// On the wire.
    pub reply: Option<Reply>,
    /// On the serial line: a frame of KISS telemetry.
    pub kiss: Option<[u8; kiss::BYTES]>,
    /// On the serial line, without a KISS frame: the ESC's information, which a command has asked for.
    pub info: Option<[u8; info::BYTES]>,
}

/// The part that goes to the serial line, as in [`Answer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Serial {
    /// A frame of KISS telemetry.
    pub kiss: Option<[u8; kiss::BYTES]>,
    /// The ESC's information.
    pub info: Option<[u8; info::BYTES]>,
}

/// A reply on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// 21 bits, the highest first; 1 is line high.
    pub bits: u32,
    /// Bits a second: 5/4 of the frame's.
    pub bit_hz: u32,
    /// Time of its first bit, in ticks of the capturing timer.
    pub at_ticks: u32,
}

impl Ask {
    /// The answers that the sender of a frame or pulse may want; `None` if none.
    pub fn of(event: &Event) -> Option<Self> {
        let Event::Frame {
            rate,
            bidirectional,
            frame,
            first_edge_ticks,
        } = *event
        else {
            return None;
        };
        let info = Order::of(frame.value) == Some(Order::Info);
        (bidirectional || frame.telemetry || info).then_some(Self {
            first_edge_ticks,
            rate,
            bidirectional,
            telemetry: frame.telemetry,
        })
    }
}

/// State from answer to answer.
#[derive(Clone, Debug)]
pub struct Answers {
    /// From a frame's first edge to its reply, ticks, in the order of [`Rate::ALL`].
    reply_ticks: [u32; Rate::ALL.len()],
    /// Times for which a KISS frame, and the ESC's information, take the serial line.
    kiss_ticks: u32,
    info_ticks: u32,
    /// Time at which the frame before began.
    asked_at_ticks: Option<u32>,
    /// Time for which the serial line is still taken.
    busy_ticks: u32,
    extended: bool,
    /// The answer to the command that turned extended telemetry on or off.
    announcement: Option<Extended>,
    schedule: Schedule,
    health: Health,
    info: Option<[u8; info::BYTES]>,
}

impl Answers {
    /// Nothing sent yet; `tick_hz` is the rate of the timer that captures the wire's edges.
    pub fn new(tick_hz: u32) -> Self {
        let ticks = |time_us| quotient(u64::from(tick_hz) * u64::from(time_us), 1_000_000);
        Self {
            reply_ticks: Rate::ALL.map(|rate| reply_ticks(tick_hz, rate)),
            kiss_ticks: ticks(kiss::SPACING_US),
            info_ticks: ticks(info::SPACING_US),
            asked_at_ticks: None,
            busy_ticks: 0,
            extended: false,
            announcement: None,
            schedule: Schedule::new(ticks(schedule::SLOT_US)),
            health: Health::default(),
            info: None,
        }
    }

    /// Turns extended telemetry on or off, and announces it with the next reply that may be an
    /// extended word.
    pub fn set_extended(&mut self, on: bool) {
        self.extended = on;
        self.announcement = Some(if on {
            extended::ENABLED
        } else {
            extended::DISABLED
        });
        self.schedule.begin();
        self.health.begin();
    }

    /// The signal is lost: whoever comes back on the wire has not asked for anything, and takes every word
    /// for a speed until it has.
    pub fn lost(&mut self) {
        self.extended = false;
        self.announcement = None;
        self.info = None;
    }

    /// Sends the ESC's information with the next answer for which the serial line is free.
    pub fn send_info(&mut self, info: [u8; info::BYTES]) {
        self.info = Some(info);
    }

    /// The reply to a frame on its wire, if it asks for one. It must be quick: `speed_bits` are those of a
    /// reply with the drive's speed ([`speed_bits`]), and [`Answers::serial`] is to follow.
    pub fn reply(&mut self, ask: Ask, speed_bits: u32, telemetry: &Telemetry) -> Option<Reply> {
        self.pass(ask.first_edge_ticks);
        ask.bidirectional.then(|| {
            let bits = match self.extended(telemetry) {
                Some(word) => {
                    self.schedule.sends();
                    gcr::encode(word.data())
                }
                None => speed_bits,
            };
            let reply_ticks = self.reply_ticks[ask.rate as usize];
            Reply {
                bits,
                bit_hz: reply_bit_hz(ask.rate),
                at_ticks: ask.first_edge_ticks.wrapping_add(reply_ticks),
            }
        })
    }

    /// The bytes for the serial line that answer a frame, with the drive's present state, of which the
    /// next words of extended telemetry tell too.
    pub fn serial(
        &mut self,
        ask: Ask,
        snapshot: &Snapshot,
        basis: &Basis,
        telemetry: &Telemetry,
    ) -> Serial {
        self.health.observe(snapshot, basis, telemetry.limits);
        let free = self.busy_ticks == 0;
        let info = self.info.take_if(|_| free);
        // A flight controller that asks for the information sets the telemetry bit as well, and reads
        // the bytes that it gets as the information.
        let kiss = free && info.is_none() && ask.telemetry;
        if info.is_some() {
            self.busy_ticks = self.info_ticks;
        } else if kiss {
            self.busy_ticks = self.kiss_ticks;
        }
        Serial {
            kiss: kiss.then(|| {
                let scale = &basis.scale;
                let erpm = scale.rpm(snapshot.speed).abs() * scale.pole_pairs;
                kiss::frame(telemetry, erpm)
            }),
            info,
        }
    }

    /// Takes in when a frame has come. The ticks wrap, in 25 s at 170 MHz: after a longer rest a
    /// word or a frame may come late by its interval.
    fn pass(&mut self, now_ticks: u32) {
        let before_ticks = self.asked_at_ticks.replace(now_ticks).unwrap_or(now_ticks);
        let ticks = now_ticks.wrapping_sub(before_ticks);
        self.busy_ticks = self.busy_ticks.saturating_sub(ticks);
        self.schedule.pass(ticks);
    }

    /// The extended word that this reply shall be, if any.
    fn extended(&mut self, telemetry: &Telemetry) -> Option<Extended> {
        if !self.schedule.is_free() {
            return None;
        }
        if let Some(announcement) = self.announcement.take() {
            return Some(announcement);
        }
        if !self.extended {
            return None;
        }
        // A float's conversion saturates.
        let whole = |value: f32| round(value) as u8;
        Some(match self.schedule.due()? {
            Kind::Status => self.health.status(),
            Kind::Temperature => Extended::Temperature(whole(telemetry.temperature_c)),
            Kind::Voltage => Extended::Voltage(whole(telemetry.bus_v * 4.0)),
            Kind::Current => Extended::Current(whole(telemetry.bus_a)),
            Kind::Stress => self.health.stress(),
        })
    }
}

/// The bits of a reply that carries the speed.
pub fn speed_bits(snapshot: &Snapshot, basis: &Basis) -> u32 {
    gcr::encode(erpm::of_speed(snapshot.speed, &basis.scale))
}

/// Bits a second of the reply to a frame of this rate.
pub const fn reply_bit_hz(rate: Rate) -> u32 {
    rate.bit_hz() / 4 * 5
}

/// From a frame's first edge to its reply, in ticks to the nearest: 16 nominal bits, whatever the
/// frame's own were, and the delay.
fn reply_ticks(tick_hz: u32, rate: Rate) -> u32 {
    // 16 bits in units of 10⁻⁹/3 s, which every rate's bit is a whole number of.
    let frame = 16 * (1_000_000_000 / (rate.bit_hz() / 3));
    let whole = u64::from(frame + 3 * REPLY_DELAY_NS);
    quotient(whole * u64::from(tick_hz) + 1_500_000_000, 3_000_000_000)
}

#[cfg(test)]
mod tests;
