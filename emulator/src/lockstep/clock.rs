//! The rack's clock under a client's control: each request in its turn, answered by the state.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::request::{Malformed, Request, Turn, parse};
use super::state::{self, Head};
use crate::machine::Onlooker;
use crate::rack::Rack;

/// Simulated time between two looks at the request to end, ns.
const STRIDE_NS: u64 = 20_000_000;

/// A client's position in the sequence.
pub(super) struct Clock {
    /// Set once the program is to end.
    stop: Arc<AtomicBool>,
    head: Head,
    /// The answer to the latest request obeyed.
    state: Vec<u8>,
}

impl Clock {
    /// Creates a clock that stops in an advance too once this is set.
    pub(super) fn new(stop: Arc<AtomicBool>) -> Self {
        Self {
            stop,
            head: Head::default(),
            state: Vec::new(),
        }
    }

    /// Obeys a request if it is its turn, and says what is wrong with a malformed one. Either way [`Clock::answer`]
    /// then goes to the sender, unless the request to end has cut the advance short.
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
                            // If it finds no room, its wire counts it, as any.
                            let _ = rack.play(frame.esc, start_ns, frame.datagram);
                        }
                        let until_ns = now_ns + u64::from(time_ns);
                        rack.begin();
                        while rack.now_ns() < until_ns && !self.stop.load(Ordering::Relaxed) {
                            let stride_ns = until_ns.min(rack.now_ns() + STRIDE_NS);
                            rack.go_on_to(stride_ns, onlooker, send);
                        }
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

    /// Writes the state, unless it is written already, for a repeated request.
    fn told(&mut self, rack: &Rack) {
        if self.state.is_empty() {
            state::write(&mut self.state, &mut self.head, rack);
        }
    }

    /// Returns the state after the latest request obeyed.
    pub(super) fn answer(&self) -> &[u8] {
        &self.state
    }

    /// Returns the number of malformed requests.
    pub(super) fn refused(&self) -> u32 {
        self.head.refused
    }
}
