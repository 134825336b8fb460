//! Answers the flight controller on the throttle wire and on a serial line.
//!
//! A bidirectional frame is answered on its own wire, in the code of [`siskin_throttle::answer`], with the speed or
//! a word of extended telemetry; a frame with its telemetry bit set, on the serial line ([`kiss`]).

mod basis;
mod health;
pub mod info;
pub mod kiss;
mod schedule;

use siskin_throttle::answer::extended::{self, Extended};
use siskin_throttle::answer::{Ask, FRAME_BITS, REPLY_DELAY_NS, Reply, erpm, gcr, reply_bit_hz};
use siskin_throttle::dshot::Rate;
use siskin_units::math::{quotient, round};

use crate::drive::Snapshot;
use crate::telemetry::Telemetry;
pub use basis::Basis;
use health::Health;
use schedule::{Kind, Schedule};

/// The answer to a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The reply on the wire.
    pub reply: Option<Reply>,
    /// For the serial line: a KISS telemetry frame.
    pub kiss: Option<[u8; kiss::BYTES]>,
    /// For the serial line, instead of a KISS frame: the ESC's information, requested by a command.
    pub info: Option<[u8; info::BYTES]>,
}

/// The serial part of an [`Answer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Serial {
    /// A KISS telemetry frame.
    pub kiss: Option<[u8; kiss::BYTES]>,
    /// The ESC's information.
    pub info: Option<[u8; info::BYTES]>,
}

/// State carried from answer to answer.
#[derive(Clone, Debug)]
pub struct Answers {
    /// Time from a frame's first edge to its reply, ticks, in the order of [`Rate::ALL`].
    reply_ticks: [u32; Rate::ALL.len()],
    /// Ticks per second times 16 · 5/4: over a frame's ticks, its reply's bit rate.
    frames_hz: u64,
    /// Time from a frame's end to its reply.
    delay_ticks: u32,
    /// How long a KISS frame, and the ESC's information, occupy the serial line.
    kiss_ticks: u32,
    info_ticks: u32,
    /// When the previous frame began.
    asked_at_ticks: Option<u32>,
    /// How long the serial line is still occupied.
    busy_ticks: u32,
    extended: bool,
    /// The reply to the command that turned extended telemetry on or off.
    announcement: Option<Extended>,
    schedule: Schedule,
    health: Health,
    info: Option<[u8; info::BYTES]>,
}

impl Answers {
    /// Creates the initial state; `tick_hz` is the rate of the timer that captures the wire's edges.
    pub fn new(tick_hz: u32) -> Self {
        let ticks = |time_us| quotient(u64::from(tick_hz) * u64::from(time_us), 1_000_000);
        Self {
            reply_ticks: Rate::ALL.map(|rate| reply_ticks(tick_hz, rate)),
            frames_hz: u64::from(tick_hz) * u64::from(FRAME_BITS * 5 / 4),
            delay_ticks: ticks(REPLY_DELAY_NS / 1_000),
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

    /// Turns extended telemetry on or off, and announces it in the next reply that may be an extended word.
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

    /// Resets on a lost signal: whoever appears next has requested nothing, and until it does takes every word
    /// for a speed.
    pub fn lost(&mut self) {
        self.extended = false;
        self.announcement = None;
        self.info = None;
    }

    /// Sends the ESC's information with the next answer for which the serial line is free.
    pub fn send_info(&mut self, info: [u8; info::BYTES]) {
        self.info = Some(info);
    }

    /// Returns the reply to a frame on its wire, if it requests one. Kept short to meet the deadline: the
    /// caller passes the encoded speed ([`speed_bits`]), and calls [`Answers::serial`] afterwards.
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
            let (bit_hz, reply_ticks) = match ask.frame_ticks {
                None => (reply_bit_hz(ask.rate), self.reply_ticks[ask.rate as usize]),
                Some(ticks) => {
                    let ticks = ticks.get();
                    (quotient(self.frames_hz, ticks), self.delay_ticks + ticks)
                }
            };
            Reply {
                bits,
                bit_hz,
                at_ticks: ask.first_edge_ticks.wrapping_add(reply_ticks),
            }
        })
    }

    /// Returns the bytes that answer a frame on the serial line. The drive's current state also feeds the next
    /// words of extended telemetry.
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
        // A flight controller that requests the information also sets the telemetry bit, and takes whatever
        // bytes arrive for the information.
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

    /// Advances time to that of a frame. The ticks wrap, in 25 s at 170 MHz: after a longer silence a word or a
    /// frame may be late by its interval.
    fn pass(&mut self, now_ticks: u32) {
        let before_ticks = self.asked_at_ticks.replace(now_ticks).unwrap_or(now_ticks);
        let ticks = now_ticks.wrapping_sub(before_ticks);
        self.busy_ticks = self.busy_ticks.saturating_sub(ticks);
        self.schedule.pass(ticks);
    }

    /// Returns the extended word to send as this reply, if any.
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
        // Float conversion saturates.
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

/// Returns the bits of a reply that carries the speed.
pub fn speed_bits(snapshot: &Snapshot, basis: &Basis) -> u32 {
    gcr::encode(erpm::of_speed(snapshot.speed, &basis.scale))
}

/// Returns the time from a nominal frame's first edge to its reply, in ticks rounded to nearest.
fn reply_ticks(tick_hz: u32, rate: Rate) -> u32 {
    // 16 bits in units of 10⁻⁹/3 s, of which every rate's bit is a whole number.
    let frame = FRAME_BITS * (1_000_000_000 / (rate.bit_hz() / 3));
    let whole = u64::from(frame + 3 * REPLY_DELAY_NS);
    quotient(whole * u64::from(tick_hz) + 1_500_000_000, 3_000_000_000)
}

#[cfg(test)]
mod tests;
