//! The payload of an answer, with the contents of the session's file.

use super::answer::{ACK, Answer, Content, DATA_AT, NAK, PAYLOAD_MAX};
use super::server::Server;
use super::sink::Sink;
use super::view::View;
use crate::mavlink::frame::Address;

impl Answer {
    /// Writes the message's payload, which is zero before.
    ///
    /// Never inlined: its stack is free for the sender.
    #[inline(never)]
    pub(in crate::mavlink) fn write(
        &self,
        to: Address,
        server: &mut Server,
        view: &View,
        payload: &mut [u8; PAYLOAD_MAX],
    ) {
        let (header, data) = payload.split_at_mut(DATA_AT);
        let mut complete = false;
        let done = match self.content {
            Content::Done => Ok(0),
            Content::Refused(error) => Err(error),
            Content::Number(number) => {
                Sink::new(0, data).put(&number.to_le_bytes());
                Ok(4)
            }
            Content::Entries(entry) => {
                let mut sink = Sink::new(0, data);
                entry.write_rest(view, &mut sink);
                Ok(sink.len as u8)
            }
            Content::Bytes { len, last } => {
                complete = last;
                let room = data.get_mut(..len.into()).unwrap_or_default();
                server
                    .read((to, self.session), (self.offset, room), view)
                    .map(|()| len)
            }
        };
        if let (Err(error), [reason, ..]) = (done, data) {
            *reason = error as u8;
        }
        let [sequence_low, sequence_high] = self.sequence.to_le_bytes();
        let [a, b, c, d] = self.offset.to_le_bytes();
        header.copy_from_slice(&[
            0,
            to.system,
            to.component,
            sequence_low,
            sequence_high,
            self.session,
            if done.is_ok() { ACK } else { NAK },
            done.unwrap_or(1),
            self.request,
            u8::from(complete),
            0,
            a,
            b,
            c,
            d,
        ]);
    }
}
