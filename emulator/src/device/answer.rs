//! What the ESC sends back to the requester: its reply on the throttle wire, and datagrams.

use siskin_control::answer::Answer;
use siskin_throttle::answer::Ask;
use siskin_throttle::signal::Signal;

use super::capture::time_ns;
use super::{Device, Onlooker};

/// Byte 0 of a KISS telemetry datagram, and of one with the ESC's information.
const KISS: u8 = 30;
const INFO: u8 = 31;

impl Device {
    /// Sends what was requested at about `now_ns`.
    pub(super) fn answer(&mut self, now_ns: u64, ask: Ask, onlooker: &mut impl Onlooker) {
        let Answer { reply, kiss, info } = self.throttle.answer(ask, &self.rig.snapshot());
        let asked_ns = time_ns(ask.first_edge_ticks, now_ns);
        let mut send = |code: u8, payload: &[&[u8]]| {
            let datagram = [&[code], payload.concat().as_slice()].concat();
            onlooker.answer(asked_ns, &datagram);
            self.wire.send(asked_ns, &datagram);
        };
        let reply = reply.map(|reply| (reply, time_ns(reply.at_ticks, now_ns)));
        if let Some((reply, at_ns)) = reply
            && self.driven.drive(now_ns, &reply, at_ns)
        {
            let signal = Signal::Dshot {
                rate: ask.rate,
                bidirectional: true,
            };
            let end_ns = asked_ns + u64::from(ask.rate.frame_ns());
            let after_ns = at_ns.saturating_sub(end_ns) as u32;
            let payload = [reply.bits.to_le_bytes(), after_ns.to_le_bytes()];
            send(signal.number(), &[payload.as_flattened()]);
        }
        if let Some(kiss) = kiss {
            send(KISS, &[&kiss]);
        }
        if let Some(info) = info {
            send(INFO, &[&info]);
        }
    }
}
