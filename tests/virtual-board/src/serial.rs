//! The far ends of the serial lines: MAVLink's, which all links share, and telemetry's.

use std::collections::BTreeMap;

use siskin_control::answer::{info, kiss};
use siskin_control::mavlink::Receiver;
use siskin_emulator::link::LinkId;

use crate::time::{CLOCK_HZ, Cycles, ns};

/// Bytes that may wait for the line, from all links: beyond that, whole frames are lost, as over a radio.
/// 0.7 s at 57600 baud.
const WAITING_MAX: usize = 4096;

/// Byte 0 of a datagram with KISS telemetry, and of one with the ESC's information.
const KISS: u8 = 30;
const INFO: u8 = 31;

/// The MAVLink line: frames from any link go to the chip one after another, and what it sends goes to all
/// of them.
#[derive(Default)]
pub struct Mavlink {
    /// What each link has sent of a frame so far.
    links: BTreeMap<LinkId, Receiver>,
    /// What the chip has sent of one.
    chip: Receiver,
    /// Frames refused on links that are gone.
    refused: u64,
}

impl Mavlink {
    /// Takes bytes from a link. Whole frames go to `forward`, unless too many bytes are already waiting.
    pub fn receive(
        &mut self,
        stream: LinkId,
        now: Cycles,
        bytes: &[u8],
        mut waiting: usize,
        mut forward: impl FnMut(&[u8]),
    ) {
        let receiver = self.links.entry(stream).or_default();
        receiver.push(ns(now) / 1000, bytes, |frame| {
            if waiting + frame.raw.len() <= WAITING_MAX {
                waiting += frame.raw.len();
                forward(frame.raw);
            }
        });
    }

    /// Returns the links that have sent anything. Each needs a call of [`receive`](Self::receive) without
    /// bytes now and then: after silence, what a start without its frame has held back is searched for
    /// frames.
    pub fn links(&self) -> Vec<LinkId> {
        self.links.keys().copied().collect()
    }

    /// Forgets a link that has ended.
    pub fn forget(&mut self, stream: LinkId) {
        if let Some(receiver) = self.links.remove(&stream) {
            self.refused += receiver.counters().rejected();
        }
    }

    /// Takes bytes from the chip, or none, just to let time pass. A frame completed by them goes to `send`.
    pub fn sent(&mut self, now: Cycles, bytes: &[u8], mut send: impl FnMut(&[u8])) {
        self.chip
            .push(ns(now) / 1000, bytes, |frame| send(frame.raw));
    }

    /// Returns how many of the links' frames were refused.
    pub fn refused(&self) -> u64 {
        let rejected = self
            .links
            .values()
            .map(|receiver| receiver.counters().rejected());
        self.refused + rejected.sum::<u64>()
    }
}

/// The telemetry line: frames end with a quiet time.
#[derive(Debug, Default)]
pub struct Telemetry {
    bytes: Vec<u8>,
    last: Cycles,
}

impl Telemetry {
    /// Takes a byte from the chip.
    pub fn sent(&mut self, now: Cycles, byte: u8) {
        self.bytes.push(byte);
        self.last = now;
    }

    /// Returns the datagram of a frame that has ended by now.
    pub fn take(&mut self, now: Cycles) -> Option<Vec<u8>> {
        // Three bytes at 115200 baud.
        let quiet = CLOCK_HZ * 30 / 115_200;
        if self.bytes.is_empty() || now - self.last < quiet {
            return None;
        }
        let bytes = std::mem::take(&mut self.bytes);
        let code = match bytes.len() {
            kiss::BYTES => KISS,
            info::BYTES => INFO,
            _ => return None,
        };
        Some([&[code], bytes.as_slice()].concat())
    }
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::ardupilotmega::HEARTBEAT_DATA;
    use mavlink::{MAVLinkV2MessageRaw, MavHeader};

    use super::*;
    use crate::time::of_ns;

    #[test]
    fn a_frame_behind_a_start_without_one_comes_after_silence_from_either_side() {
        let mut sound = MAVLinkV2MessageRaw::new();
        sound.serialize_message_data(MavHeader::default(), &HEARTBEAT_DATA::default());
        let sound = sound.raw_bytes();
        // The start of a long frame of a known message holds back what follows.
        let bytes = [&[0xfd, 255, 0, 0, 0, 1, 1, 0, 0, 0], sound].concat();
        let (mut line, link) = (Mavlink::default(), LinkId::default());
        let (mut from_link, mut from_chip) = (Vec::new(), Vec::new());
        line.receive(link, 0, &bytes, 0, |frame| from_link.extend(frame));
        line.sent(0, &bytes, |frame| from_chip.extend(frame));
        assert_eq!(line.links(), [link]);
        for (at_ns, heard) in [(99_000_000, &[][..]), (101_000_000, sound)] {
            let now = of_ns(at_ns);
            line.receive(link, now, &[], 0, |frame| from_link.extend(frame));
            line.sent(now, &[], |frame| from_chip.extend(frame));
            assert_eq!((&from_link[..], &from_chip[..]), (heard, heard));
        }
        assert!(line.refused() > 0);
    }
}
