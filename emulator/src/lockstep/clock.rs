//! The rack's clock in a client's hand: each request in its turn, and the state as the answer.

use super::request::{Malformed, Request, Turn, parse};
use super::state::{self, Head};
use crate::machine::Onlooker;
use crate::rack::Rack;

/// Where a client stands.
#[derive(Default)]
pub(super) struct Clock {
    head: Head,
    /// The answer to the latest request that was obeyed.
    state: Vec<u8>,
}

impl Clock {
    /// Obeys a request if it is its turn, and says what was wrong with one that is malformed. Either way
    /// [`Clock::answer`] then goes to who asked.
    pub(super) fn obey(
        &mut self,
        request: &[u8],
        rack: &mut Rack,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Malformed> {
        let asked = parse(request, rack.escs().len());
        let next = self.head.sequence.wrapping_add(1);
        match asked {
            Ok(Request::Turn(sequence, turn)) if sequence == next => {
                self.head.sequence = next;
                match turn {
                    Turn::Advance(time_ns, frames) => {
                        let now_ns = rack.now_ns();
                        for frame in frames {
                            let start_ns = now_ns + u64::from(frame.offset_ns);
                            // One that finds no room is counted by its wire, as any is.
                            let _ = rack.play(frame.esc, start_ns, frame.datagram);
                        }
                        rack.advance_to(now_ns + u64::from(time_ns), onlooker, send);
                    }
                    Turn::Change(environment) => rack.surround(&environment),
                }
                state::write(&mut self.state, &mut self.head, rack);
            }
            Ok(_) => self.told(rack),
            Err(malformed) => {
                self.head.refused = self.head.refused.wrapping_add(1);
                self.told(rack);
                self.state[16..20].copy_from_slice(&self.head.refused.to_le_bytes());
                return Err(malformed);
            }
        }
        Ok(())
    }

    /// The state: of a request that came before, if it is written already.
    fn told(&mut self, rack: &Rack) {
        if self.state.is_empty() {
            state::write(&mut self.state, &mut self.head, rack);
        }
    }

    /// The state after the latest request that was obeyed.
    pub(super) fn answer(&self) -> &[u8] {
        &self.state
    }

    /// Requests that were malformed.
    pub(super) fn refused(&self) -> u32 {
        self.head.refused
    }
}
