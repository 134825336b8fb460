//! Feeds any sequence of good and bad frames and pulses: the ESC neither panics nor turns its motor before
//! the wire is armed, and its answers can be read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use siskin_control::answer::kiss;
use siskin_control::drive::Phase;
use siskin_fuzz::bytes::Bytes;
use siskin_fuzz::desk::{CAPTURE_HZ, Desk};
use siskin_throttle::answer::{Ask, REPLY_DELAY_NS, gcr};
use siskin_throttle::dshot::{Frame, edges};
use siskin_throttle::signal::{Pulse, Signal};
use siskin_units::Speed;

/// Most frames in a case: more than a second.
const FRAMES: u32 = 1_500;

/// Time between settle calls, ns: the longest control period.
const PERIOD_NS: u64 = 125_000;

/// A signal's sender, and the ESC that hears it.
struct Sender {
    desk: Desk,
    signal: Signal,
    level: bool,
    frames: u32,
}

fuzz_target!(|input: &[u8]| {
    let mut input = Bytes(input);
    let mut play = || {
        let forced = Signal::from_number(input.u8()?);
        let sent = usize::from(input.u8()?);
        let signal = Signal::all().nth(sent % Signal::all().count())?;
        let mut sender = Sender {
            desk: Desk::new(forced, 0xFF00_0000),
            signal,
            level: false,
            frames: 0,
        };
        let mut last = 0;
        while sender.frames < FRAMES {
            let kind = input.u8()?;
            // Each item is followed by a pause of up to 25 ms.
            let rest_ns = match kind >> 4 {
                0..=12 => u64::from(kind >> 4) * 100_000 + 50_000,
                long => u64::from(long) * 2_000_000,
            };
            match kind & 7 {
                0 => last = input.u16()?,
                1 => {
                    let data = input.u16()?;
                    last = Frame {
                        value: data & 0x7FF,
                        telemetry: data & 0x800 != 0,
                    }
                    .to_bits();
                }
                2 => {
                    for _ in 1..input.u8()? {
                        sender.send(last, rest_ns);
                    }
                }
                3 => last ^= 1 << (input.u8()? & 15),
                4 => sender.turn(input.u16()?),
                5 => {
                    let sent = usize::from(input.u8()?);
                    sender.signal = Signal::all().nth(sent % Signal::all().count())?;
                }
                6 => sender.rest(u64::from(input.u16()?) * 10_000),
                _ => sender.flip(u64::from(input.u8()?) * 20),
            }
            sender.send(last, rest_ns);
        }
        Some(())
    };
    play();
});

impl Sender {
    /// Sends a frame with these bits, or a pulse of a width given by them.
    fn send(&mut self, bits: u16, rest_ns: u64) {
        self.frames += 1;
        match self.signal {
            Signal::Dshot {
                rate,
                bidirectional,
            } => {
                if self.level != bidirectional {
                    self.flip(20_000);
                }
                let check = if bidirectional { 0xF } else { 0 };
                let mut before_ns = 0;
                for (at_ns, active) in edges(bits ^ check, rate) {
                    self.level = active != bidirectional;
                    let after_ns = u64::from(at_ns - before_ns);
                    before_ns = at_ns;
                    let ask = self.desk.edge(after_ns, self.level);
                    self.answer(ask);
                }
                self.rest(u64::from(rate.frame_ns() - before_ns) + rest_ns);
            }
            Signal::Pulse(kind) => {
                // More than the kind's whole range.
                let scale_ns = match kind {
                    Pulse::Servo => 40,
                    Pulse::OneShot125 => 5,
                    Pulse::OneShot42 => 2,
                    Pulse::Multishot => 1,
                };
                let width_ns = u64::from(bits) * scale_ns;
                if self.level {
                    self.flip(20_000);
                }
                self.flip(0);
                self.rest(width_ns);
                self.flip(0);
                self.rest(rest_ns);
            }
        }
    }

    fn flip(&mut self, after_ns: u64) {
        self.level = !self.level;
        let ask = self.desk.edge(after_ns, self.level);
        self.answer(ask);
    }

    fn rest(&mut self, mut rest_ns: u64) {
        while rest_ns > 0 {
            let step_ns = rest_ns.min(PERIOD_NS);
            let ask = self.desk.settle(step_ns);
            self.answer(ask);
            rest_ns -= step_ns;
        }
    }

    /// Turns the motor at this speed; 0 stops it.
    fn turn(&mut self, speed: u16) {
        let snapshot = &mut self.desk.snapshot;
        snapshot.speed = Speed::from_bits(i32::from(speed as i16) << 14);
        snapshot.phase = if speed == 0 { Phase::Idle } else { Phase::Run };
    }

    fn answer(&mut self, ask: Option<Ask>) {
        let Some(ask) = ask else { return };
        let snapshot = self.desk.snapshot;
        let answer = self.desk.throttle.answer(ask, &snapshot);
        if let Some(reply) = answer.reply {
            assert!(gcr::decode(reply.bits).is_some(), "{:021b}", reply.bits);
            let to_ns = |ticks: u32| u64::from(ticks) * 1_000_000_000 / u64::from(CAPTURE_HZ);
            let nominal_ns = u64::from(ask.rate.frame_ns());
            let frame_ns = ask
                .frame_ticks
                .map_or(nominal_ns, |ticks| to_ns(ticks.get()));
            let bit_ns = 1_000_000_000 / u64::from(reply.bit_hz);
            assert!(
                (20 * bit_ns).abs_diff(frame_ns) < 100,
                "{bit_ns} {frame_ns}"
            );
            let delay_ns = to_ns(reply.at_ticks.wrapping_sub(ask.first_edge_ticks));
            let wanted_ns = frame_ns + u64::from(REPLY_DELAY_NS);
            assert!(delay_ns.abs_diff(wanted_ns) < 1_000, "{delay_ns} ns");
        }
        if let Some(frame) = answer.kiss {
            let (data, check) = frame.split_at(kiss::BYTES - 1);
            assert_eq!(kiss::crc8(data), check[0]);
        }
    }
}
