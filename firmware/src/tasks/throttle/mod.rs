//! The throttle's task: edges of the wire in, set-points to the interrupt and answers to the flight
//! controller out.
//!
//! It runs in an executor of its own, above all other tasks: a bidirectional frame is answered
//! 30 µs after its end. The other tasks reach what it knows by [`Port`], with all interrupts but
//! the control's held off for that moment.

mod capture;
mod reply;

use core::cell::{RefCell, RefMut};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use siskin_control::answer::{Ask, Reply, Serial};
use siskin_control::drive::{Setpoint, Snapshot};
use siskin_control::input::dshot::Rate;
use siskin_control::input::line::Event;
use siskin_control::input::signal::Signal;
use siskin_control::throttle::{Reach, Throttle};
use static_cell::StaticCell;

use super::clock::now;
use super::kiss;
use super::supervisor::throttle_lives;
use super::trouble::TROUBLE;
use crate::board;
use crate::board::wire::{TICK_HZ, TIMER_BITS};
use crate::edges::Edges;
use crate::exchange::{SetpointWriter, SnapshotReader};
pub(crate) use capture::Capture;
use reply::Armed;
pub(crate) use reply::Replier;

/// Starts the task.
pub(crate) fn start(listener: Listener, replier: Replier) {
    let spawner = board::start_executor();
    spawner.spawn(listen(listener, replier).expect("spawned here and nowhere else"));
}

/// The throttle's side of the ESC, which tasks reach one at a time.
type Shared = Mutex<CriticalSectionRawMutex, RefCell<&'static mut Throttle>>;

/// A way to the throttle's side.
#[derive(Clone, Copy)]
pub(crate) struct Port(&'static Shared);

impl Port {
    /// Makes the throttle's side where all tasks reach it; to be called once.
    pub(crate) fn open(make: impl FnOnce() -> Throttle) -> Self {
        // Made apart from its lock, with which it would be copied once more.
        static THROTTLE: StaticCell<Throttle> = StaticCell::new();
        static SHARED: StaticCell<Shared> = StaticCell::new();
        let throttle = THROTTLE.init_with(make);
        Self(SHARED.init_with(|| Mutex::new(RefCell::new(throttle))))
    }
}

impl Reach for Port {
    fn reach<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T {
        self.0.lock(|throttle| act(&mut borrow(throttle)))
    }
}

/// Never inlined: some twenty reaches have the check and its panic in common.
#[inline(never)]
fn borrow<'a>(throttle: &'a RefCell<&'static mut Throttle>) -> RefMut<'a, &'static mut Throttle> {
    throttle.borrow_mut()
}

/// Longest time between two looks at the wire, which notice a lost signal and renew set-points.
const RENEWAL_US: u32 = 1000;

/// Times of the looks at the edges after a first one, the last one first. If nothing is known of what comes,
/// DShot1200 and 600 are whole at the first and DShot300 at the second; at the last one DShot150 is, and all
/// else is taken edge by edge.
const UNKNOWN_LOOKS_US: [u32; 3] = [120, 60, 30];

/// Time of the look at a pulse after its first edge; a longer one's second edge is another first one.
const PULSE_LOOK_US: u32 = 30;

/// Time of the look at a frame, in eighths of a bit after its first edge: its last edge is there (15
/// bits and the 3/4 of a one), and half a bit for the DMA; and, if it was late, soon after.
const FRAME_LOOK_EIGHTHS: u32 = 129;
const LATE_LOOK_EIGHTHS: u32 = 144;

/// From the first edge of a bit to that of the next in the same frame it is never as long, in eighths of a bit.
const FRAME_APART_EIGHTHS: u32 = 16;

/// Usual time from the alarm to the look: it then waits for the last edge.
const WAKING_US: u32 = 9;

/// The task's own state, besides that of the replies.
pub(crate) struct Listener {
    pub(crate) port: Port,
    pub(crate) capture: Capture,
    pub(crate) setpoint: SetpointWriter,
    pub(crate) snapshot: &'static SnapshotReader,
}

/// Listens for ever.
#[embassy_executor::task]
pub(crate) async fn listen(mut listener: Listener, mut replier: Replier) -> ! {
    let renewal_ticks = capture::ticks_of_us(RENEWAL_US);
    loop {
        // What can be done before a frame comes is not to be done while it does, nor behind it: it is told as
        // it was at the frame before, or `RENEWAL_US` ago.
        let ready = listener.ready();
        let replies = ready.as_ref().filter(|ready| ready.may_reply());
        let mut armed = replies.map(|ready| replier.arm(ready.speed_bits));
        let due_ticks = listener.capture.now().wrapping_add(renewal_ticks);
        let edge = listener.capture.wait_for_edge(due_ticks).await;
        let signal = ready.as_ref().and_then(|ready| ready.signal);
        let mut looks = listener.begin(edge, signal);
        while let Some(after_ticks) = looks.next() {
            let at_ticks = looks.begin_ticks.wrapping_add(after_ticks);
            if after_ticks > 0 {
                listener.capture.wait_until(at_ticks).await;
            }
            let query = listener.look(&mut looks, ready.as_ref());
            if let Some((query, ready)) = query.zip(ready.as_ref()) {
                listener.answer(query, &looks, ready, armed.take()).await;
            }
        }
    }
}

/// The state before a frame comes.
struct Ready {
    snapshot: Snapshot,
    /// A reply's bits for its speed.
    speed_bits: u32,
    /// The signal, if it is known.
    signal: Option<Signal>,
}

impl Ready {
    /// Returns true if the signal is one that is answered on its wire, as far as is known.
    fn may_reply(&self) -> bool {
        !matches!(
            self.signal,
            Some(
                Signal::Pulse(_)
                    | Signal::Dshot {
                        bidirectional: false,
                        ..
                    }
            )
        )
    }
}

/// A frame that is to be answered, and the reply to it on the wire.
struct Query {
    ask: Ask,
    reply: Option<Reply>,
}

/// Time of the look at the wire, from the first edge that has come.
struct Looks {
    begin_ticks: u32,
    /// Times of those to come, ticks. All but the last one take a whole frame and nothing else.
    after_ticks: Vec<u32, 3>,
    /// Until when the last edges of an expected frame are waited for.
    until_ticks: u32,
    /// A frame whose answer cannot wait until it has been decoded.
    unheard: Option<Event>,
}

impl Looks {
    fn next(&mut self) -> Option<u32> {
        self.after_ticks.pop()
    }

    /// Returns true in the last one, or if no other is wanted.
    fn is_last(&self) -> bool {
        self.after_ticks.is_empty()
    }
}

impl Listener {
    /// The drive as the next answer reports it; `None` before the first snapshot.
    fn ready(&mut self) -> Option<Ready> {
        let snapshot = self.snapshot.read()?;
        let (speed_bits, signal) = self
            .port
            .reach(|throttle| (throttle.speed_bits(&snapshot), throttle.signal()));
        Some(Ready {
            snapshot,
            speed_bits,
            signal,
        })
    }

    /// A first edge has come: what follows is looked at until the line is quiet. Without one it is once, at
    /// once.
    fn begin(&mut self, edge: bool, signal: Option<Signal>) -> Looks {
        self.fill();
        if let Some(Signal::Dshot {
            rate,
            bidirectional,
        }) = signal
        {
            let apart_ticks = eighths_ticks(rate, FRAME_APART_EIGHTHS);
            let first = usize::from(bidirectional);
            // Edge by edge a frame takes 140 µs: who is behind would stay behind.
            if self.capture.edges.skip_to_last_frame(first, apart_ticks) {
                TROUBLE.lost_edges();
            }
        }
        let begin_ticks = match self.capture.edges.first() {
            Some(first_ticks) => first_ticks,
            None => self.capture.now(),
        };
        let (last_ticks, after_ticks) = match signal {
            _ if !edge => (0, Vec::from_iter([0])),
            Some(Signal::Dshot { rate, .. }) => {
                let [late, last] = [LATE_LOOK_EIGHTHS, FRAME_LOOK_EIGHTHS]
                    .map(|eighths| eighths_ticks(rate, eighths));
                let waking_ticks = last.saturating_sub(capture::ticks_of_us(WAKING_US));
                (last, Vec::from_iter([late, waking_ticks]))
            }
            Some(Signal::Pulse(_)) => (0, Vec::from_iter([capture::ticks_of_us(PULSE_LOOK_US)])),
            None => (0, Vec::from(UNKNOWN_LOOKS_US.map(capture::ticks_of_us))),
        };
        Looks {
            begin_ticks,
            after_ticks,
            until_ticks: begin_ticks.wrapping_add(last_ticks),
            unheard: None,
        }
    }

    fn fill(&mut self) {
        if !self.capture.fill() {
            TROUBLE.lost_edges();
        }
    }

    /// Takes in what has come, and does what follows from it: a whole frame of the known signal at once,
    /// which is soon enough for an answer in time, and all else edge by edge.
    // Inlined, it is 0.2 KB more flash.
    #[inline(never)]
    fn look(&mut self, looks: &mut Looks, ready: Option<&Ready>) -> Option<Query> {
        self.fill_with_frame(looks);
        let edges = &mut self.capture.edges;
        let (query, setpoint) = self.port.reach(|throttle| {
            if throttle.is_storing() {
                edges.forget();
                return Some((None, Some(throttle.setpoint())));
            }
            let ask = take_in(throttle, edges, looks, ready)?;
            let query = ask.zip(ready).map(|(ask, ready)| Query {
                ask,
                reply: throttle.reply(ask, ready.speed_bits),
            });
            if ask.is_some_and(|ask| ask.bidirectional) && query.is_none() {
                TROUBLE.late_reply();
            }
            let heard = looks.unheard.is_none();
            Some((query, heard.then(|| throttle.setpoint())))
        })?;
        if let Some(setpoint) = setpoint {
            self.renew(setpoint);
        }
        query
    }

    /// Takes the edges from the DMA; all of a frame's, if the look is at one.
    fn fill_with_frame(&mut self, looks: &Looks) {
        let mut waits = !looks.is_last();
        loop {
            self.fill();
            if !waits || self.capture.edges.has_frame() {
                return;
            }
            // Once more when the time has passed: the last edge may have come while it was looked.
            waits = self.capture.edges.is_before(looks.until_ticks);
        }
    }

    /// Gives the interrupt its set-point.
    fn renew(&mut self, setpoint: Setpoint) {
        self.setpoint.write(setpoint);
        throttle_lives();
    }

    async fn answer(
        &mut self,
        query: Query,
        looks: &Looks,
        ready: &Ready,
        armed: Option<Armed<'_>>,
    ) {
        let Query { ask, reply } = query;
        let sending = reply
            .as_ref()
            .zip(armed)
            .and_then(|(reply, armed)| armed.begin(&mut self.capture, reply));
        if reply.is_some() && sending.is_none() {
            TROUBLE.late_reply();
        }
        let (setpoint, Serial { kiss, info }) = self.port.reach(|throttle| {
            let setpoint = looks.unheard.as_ref().map(|event| {
                // The answer to its request is being sent.
                let _ = throttle.hear(now_us(), event);
                throttle.setpoint()
            });
            (setpoint, throttle.serial(ask, &ready.snapshot))
        });
        if let Some(setpoint) = setpoint {
            self.renew(setpoint);
        }
        if let Some(frame) = kiss {
            kiss::send(&frame);
        }
        if let Some(information) = info {
            kiss::send(&information);
        }
        if let Some(sending) = sending {
            let over_ticks = sending.end(&mut self.capture).await;
            // What it has heard of itself. What came later is the next frame's, which may have begun.
            self.fill();
            self.capture.edges.skip_before(over_ticks);
        }
    }
}

/// What the edges that have come ask for; `None` if the next look is to tell.
fn take_in(
    throttle: &mut Throttle,
    edges: &mut Edges<TIMER_BITS>,
    looks: &mut Looks,
    ready: Option<&Ready>,
) -> Option<Option<Ask>> {
    let whole = edges.frame();
    if let Some(event) = whole.and_then(|(rests_high, bit)| throttle.whole(rests_high, bit)) {
        looks.after_ticks.clear();
        // It may be none; the next look tells of what is lost.
        let skipped = edges.skip_frame();
        skipped.then(|| hear(throttle, looks, event, ready))
    } else if looks.is_last() {
        Some(edge_by_edge(throttle, edges))
    } else {
        if throttle.signal().is_none() {
            // The line had rested before: what was left of the edges then is none of this frame's.
            let _ = throttle.settle(now_us(), looks.begin_ticks);
        }
        None
    }
}

/// A whole frame is heard at once, or behind its answer.
fn hear(
    throttle: &mut Throttle,
    looks: &mut Looks,
    event: Event,
    ready: Option<&Ready>,
) -> Option<Ask> {
    let ask = Ask::of(&event);
    // The wire is the sender's until it is known that an answer is wanted.
    let answers = throttle.signal().is_some() && ready.is_some();
    if ask.is_some_and(|ask| ask.bidirectional) && answers {
        looks.unheard = Some(event);
        ask
    } else {
        throttle.hear(now_us(), &event)
    }
}

/// All edges that have come, one after the other.
fn edge_by_edge(throttle: &mut Throttle, edges: &mut Edges<TIMER_BITS>) -> Option<Ask> {
    let (mut ask, now_us) = (None, now_us());
    edges.take(|at_ticks, level| {
        ask = throttle.edge(now_us, at_ticks, level).or(ask);
    });
    throttle.settle(now_us, edges.settled()).or(ask)
}

/// The time of the tasks.
fn now_us() -> u64 {
    now().as_micros()
}

/// So many eighths of a bit of a frame; 144 are the most.
fn eighths_ticks(rate: Rate, eighths: u32) -> u32 {
    TICK_HZ / 8 * eighths / rate.bit_hz()
}
