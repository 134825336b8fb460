//! Throttle from the page, with a dead man's switch: frames on the wire, as a flight controller sends them.

use std::time::{Duration, Instant};

use siskin_throttle::signal::Signal;

use crate::scenario::dshot_bits;
use crate::wire::Wire;
use siskin_scope::ViewerId;

/// Silence after which a page has let go.
const SILENT: Duration = Duration::from_millis(200);

/// Time for which zero throttle is sent for a departed page before the wire falls silent.
const AFTER: Duration = Duration::from_millis(500);

/// Interval between frames, simulated ns: that of a flight controller's 1 kHz loop.
const INTERVAL_NS: u64 = 1_000_000;

/// Simulated time for which another sender's frame keeps the page off the wire, ns.
const OTHERS_NS: u64 = 500_000_000;

/// `INP_PROTO` of the usual signal, DShot600.
const USUAL: u8 = 12;

/// Why the page's throttle does not reach the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// A client of the wire's socket is sending.
    Wire,
    /// Another page is.
    Page,
    /// The page has been silent, and has not commanded zero since.
    LetGo,
}

impl Refused {
    /// Returns a line for the user.
    pub(super) fn line(self) -> &'static str {
        match self {
            Self::Wire => "another sender is on the throttle wire",
            Self::Page => "another page holds the throttle",
            Self::LetGo => "the throttle was let go, since the page was silent",
        }
    }
}

/// The holder of the throttle.
struct Holder {
    viewer: ViewerId,
    heard: Instant,
    value: f64,
    signal: u8,
    /// True after a silence, until zero has been commanded.
    let_go: bool,
}

/// An ESC's throttle.
#[derive(Default)]
pub(super) struct Throttle {
    holder: Option<Holder>,
    due_ns: u64,
}

impl Throttle {
    /// Commands a throttle for a viewer, 0 to 1, in a signal numbered as in `INP_PROTO`.
    ///
    /// # Errors
    /// Another has the wire, or the page has let go.
    pub(super) fn ask(
        &mut self,
        (viewer, came): (ViewerId, Instant),
        (value, signal): (f64, u8),
        wire: &Wire,
        now_ns: u64,
    ) -> Result<(), Refused> {
        if others_send(wire, now_ns) {
            self.holder = None;
            return Err(Refused::Wire);
        }
        let held = self.holder.as_ref();
        let silence = held.map_or(Duration::MAX, |held| {
            came.saturating_duration_since(held.heard)
        });
        if held.is_some_and(|held| held.viewer != viewer) && silence < SILENT + AFTER {
            return Err(Refused::Page);
        }
        let value = if value.is_finite() {
            value.clamp(0.0, 1.0)
        } else {
            0.0
        };
        // Whoever takes the wire starts at zero too: the ESC may still be armed.
        let was_let_go =
            held.is_none_or(|held| held.viewer != viewer || held.let_go || silence > SILENT);
        self.holder = Some(Holder {
            viewer,
            heard: came,
            value,
            signal,
            let_go: was_let_go && value > 0.0,
        });
        if was_let_go && value > 0.0 {
            return Err(Refused::LetGo);
        }
        Ok(())
    }

    /// Releases the signal of a viewer that wants none any more, or is gone: it counts as silent from now on.
    pub(super) fn release(&mut self, viewer: ViewerId, now: Instant) {
        if let Some(held) = self.holder.as_mut().filter(|held| held.viewer == viewer) {
            held.value = 0.0;
            held.heard = held.heard.min(now.checked_sub(SILENT).unwrap_or(now));
        }
    }

    /// Puts the frame that is due on the wire.
    pub(super) fn play(&mut self, now: Instant, wire: &mut Wire, now_ns: u64) {
        let Some(held) = &mut self.holder else { return };
        let silence = now.saturating_duration_since(held.heard);
        if silence > SILENT + AFTER || others_send(wire, now_ns) {
            self.holder = None;
            return;
        }
        held.let_go |= silence > SILENT;
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + INTERVAL_NS;
        let value = if held.let_go { 0.0 } else { held.value };
        // If there is no room now, there will be in a millisecond.
        let _ = wire.play(now_ns, &datagram(held.signal, value));
    }
}

/// Returns true if a client of the socket has the wire.
fn others_send(wire: &Wire, now_ns: u64) -> bool {
    let heard = wire.heard_ns();
    heard.is_some_and(|heard_ns| now_ns.saturating_sub(heard_ns) < OTHERS_NS)
}

/// Returns a frame for the wire: a DShot's, or the usual one's for any other number.
fn datagram(number: u8, value: f64) -> [u8; 3] {
    let (number, bidirectional) = match Signal::from_number(number) {
        Some(Signal::Dshot { bidirectional, .. }) => (number, bidirectional),
        _ => (USUAL, false),
    };
    let [low, high] = dshot_bits(value, bidirectional).to_le_bytes();
    [number, low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A throttle on a wire, at the same time by both clocks.
    struct Desk {
        throttle: Throttle,
        wire: Wire,
        begun: Instant,
        now_ms: u64,
    }

    impl Desk {
        fn new() -> Self {
            Self {
                throttle: Throttle::default(),
                wire: Wire::detached(),
                begun: Instant::now(),
                now_ms: 1,
            }
        }

        fn now(&self) -> Instant {
            self.begun + Duration::from_millis(self.now_ms)
        }

        fn ask(&mut self, viewer: ViewerId, value: f64) -> Result<(), Refused> {
            let (now, now_ns) = (self.now(), self.now_ms * MS);
            self.throttle
                .ask((viewer, now), (value, 0), &self.wire, now_ns)
        }

        /// Advances by this many milliseconds; returns the throttle on the wire, if any.
        fn after(&mut self, ms: u64) -> Option<f64> {
            for _ in 0..ms {
                self.now_ms += 1;
                let (now, now_ns) = (self.now(), self.now_ms * MS);
                let before = self.wire.counts().played;
                self.throttle.play(now, &mut self.wire, now_ns);
                while self.wire.next_edge(now_ns).is_some() {}
                if self.wire.counts().played == before {
                    return None;
                }
            }
            Some(self.wire.throttle())
        }
    }

    fn near(value: Option<f64>, wanted: f64) -> bool {
        value.is_some_and(|value| (value - wanted).abs() < 1e-3)
    }

    #[test]
    fn a_silent_page_has_let_go_until_it_asks_for_zero() {
        let mut desk = Desk::new();
        assert_eq!(desk.after(1), None);
        assert_eq!(desk.ask(1, 0.5), Err(Refused::LetGo), "nobody had it");
        assert!(near(desk.after(1), 0.0));
        desk.ask(1, 0.0).unwrap();
        desk.ask(1, 0.5).unwrap();
        assert!(near(desk.after(150), 0.5));
        desk.ask(1, 0.6).unwrap();
        assert!(near(desk.after(200), 0.6));
        assert!(near(desk.after(1), 0.0), "silent for 201 ms");
        assert_eq!(desk.ask(1, 0.6), Err(Refused::LetGo));
        assert!(near(desk.after(100), 0.0), "it must be taken in hand anew");
        desk.ask(1, 0.0).unwrap();
        desk.ask(1, 0.4).unwrap();
        assert!(near(desk.after(10), 0.4));
        // Without a signal the wire falls silent after some zeros.
        assert!(near(desk.after(690), 0.0));
        assert_eq!(desk.after(1), None);
    }

    #[test]
    fn a_page_that_is_gone_means_zero_at_once_then_silence() {
        let mut desk = Desk::new();
        desk.ask(1, 0.0).unwrap();
        desk.ask(1, 0.5).unwrap();
        assert!(near(desk.after(10), 0.5));
        let now = desk.now();
        desk.throttle.release(2, now);
        assert!(near(desk.after(1), 0.5), "another's");
        desk.throttle.release(1, now);
        assert!(near(desk.after(1), 0.0));
        assert!(near(desk.after(490), 0.0));
        assert_eq!(desk.after(10), None);
    }

    #[test]
    fn one_page_at_a_time_holds_it_and_nonsense_is_zero() {
        let mut desk = Desk::new();
        desk.ask(1, f64::NAN).unwrap();
        assert!(near(desk.after(1), 0.0));
        assert_eq!(desk.ask(2, 0.5), Err(Refused::Page));
        desk.ask(1, 7.0).unwrap();
        assert!(near(desk.after(1), 1.0));
        let now = desk.now();
        desk.throttle.release(1, now);
        assert_eq!(
            desk.ask(2, 0.5),
            Err(Refused::Page),
            "zeros are still sent for it"
        );
        assert_eq!(desk.after(600), None);
        assert_eq!(desk.ask(2, 0.5), Err(Refused::LetGo), "it was another's");
        desk.ask(2, 0.0).unwrap();
        desk.ask(2, 0.5).unwrap();
        assert!(near(desk.after(1), 0.5));
    }

    #[test]
    fn every_dshot_has_its_frame() {
        for number in [10, 13, 20, 23] {
            assert_eq!(datagram(number, 0.0)[0], number);
        }
        for number in [0, 1, 4, 14, 255] {
            assert_eq!(datagram(number, 0.0), [USUAL, 0, 0]);
        }
    }
}
