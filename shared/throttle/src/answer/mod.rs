//! What a frame asks for, and how a bidirectional frame is answered on its own wire.
//!
//! A reply's code is [`gcr`]; it holds the speed ([`erpm`]) or a word of extended telemetry ([`extended`]).

pub mod erpm;
pub mod extended;
pub mod gcr;

use core::num::NonZeroU32;

use crate::command::Order;
use crate::dshot::Rate;
use crate::event::Event;

/// Time from the end of a frame to its reply, ns, at every rate.
pub const REPLY_DELAY_NS: u32 = 30_000;

/// Bits of a frame.
pub const FRAME_BITS: u32 = 16;

/// The answers a frame requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// Time of the frame's first edge, in ticks of the capture timer.
    pub first_edge_ticks: u32,
    /// Bit rate of the frame.
    pub rate: Rate,
    /// Duration of the frame, in the same ticks, if its sender's clock is off.
    pub frame_ticks: Option<NonZeroU32>,
    /// The frame is to be answered on its wire.
    pub bidirectional: bool,
    /// Telemetry is to be sent on the serial line.
    pub telemetry: bool,
}

impl Ask {
    /// Returns the answers that a frame requests, or `None`.
    pub fn of(event: &Event) -> Option<Self> {
        let Event::Frame {
            rate,
            bidirectional,
            frame,
            first_edge_ticks,
            frame_ticks,
        } = *event
        else {
            return None;
        };
        let info = Order::of(frame.value) == Some(Order::Info);
        (bidirectional || frame.telemetry || info).then_some(Self {
            first_edge_ticks,
            rate,
            frame_ticks,
            bidirectional,
            telemetry: frame.telemetry,
        })
    }
}

/// A reply on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// 21 bits, first bit highest; 1 is line high.
    pub bits: u32,
    /// Bits per second: 5/4 of the frame's, by its sender's clock.
    pub bit_hz: u32,
    /// Time of the first bit, in ticks of the capture timer.
    pub at_ticks: u32,
}

/// Returns the bit rate of the reply to a frame of this rate, in bits per second.
pub const fn reply_bit_hz(rate: Rate) -> u32 {
    rate.bit_hz() / 4 * 5
}
