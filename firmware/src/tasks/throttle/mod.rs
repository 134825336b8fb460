//! The throttle task: wire edges in, set-points to the interrupt and answers to the flight controller out.
//!
//! It runs in its own executor, above all other tasks, since a bidirectional frame is answered 30 µs after its
//! end. The other tasks access its data through [`Port`], with all interrupts but the control's masked
//! meanwhile.

mod capture;
mod reply;

use core::cell::{RefCell, RefMut};
use core::num::NonZeroU32;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use siskin_control::answer::Serial;
use siskin_control::drive::Snapshot;
use siskin_control::throttle::{LockThrottle, Throttle};
use siskin_throttle::answer::Ask;
use siskin_throttle::dshot::Rate;
use siskin_throttle::line::Event;
use siskin_throttle::signal::Signal;
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
pub(crate) use reply::Replier;
use reply::{Armed, Sending};

/// Starts the task.
pub(crate) fn start(listener: Listener, replier: Replier) {
    let spawner = board::start_executor();
    spawner.spawn(listen(listener, replier).expect("spawned here and nowhere else"));
}

/// The ESC's throttle side, which tasks access one at a time.
type Shared = Mutex<CriticalSectionRawMutex, RefCell<&'static mut Throttle>>;

/// Access to the throttle side.
#[derive(Clone, Copy)]
pub(crate) struct Port(&'static Shared);

impl Port {
    /// Creates the throttle side where all tasks can access it. Call it once.
    pub(crate) fn open(make: impl FnOnce() -> Throttle) -> Self {
        // Constructed apart from its lock, since moving it in would be another copy.
        static THROTTLE: StaticCell<Throttle> = StaticCell::new();
        static SHARED: StaticCell<Shared> = StaticCell::new();
        let throttle = THROTTLE.init_with(make);
        Self(SHARED.init_with(|| Mutex::new(RefCell::new(throttle))))
    }
}

impl LockThrottle for Port {
    fn lock<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T {
        self.0.lock(|throttle| act(&mut borrow(throttle)))
    }
}

/// Never inlined: some twenty accesses share the check and its panic.
#[inline(never)]
fn borrow<'a>(throttle: &'a RefCell<&'static mut Throttle>) -> RefMut<'a, &'static mut Throttle> {
    throttle.borrow_mut()
}

/// Longest time between two looks at the wire, which detect a lost signal and renew set-points.
const RENEWAL_US: u32 = 1000;

/// Times of looks after a first edge, last look first, while the signal is unknown. DShot1200 and 600 are
/// complete at the first look and DShot300 at the second, as is a DShot600 of a slow clock; at the last one DShot150
/// is, and everything else is taken edge by edge.
const UNKNOWN_LOOKS_US: [u32; 3] = [150, 75, 30];

/// Time from a pulse's first edge to the look; if the pulse is longer, its second edge starts another look.
const PULSE_LOOK_US: u32 = 30;

/// Time from a frame's first edge to the look, in eighths of a bit: its last edge has come (15 bits and the 3/4
/// of a one) plus half a bit for the DMA; and, if it was late, soon after.
const FRAME_LOOK_EIGHTHS: u32 = 129;
const LATE_LOOK_EIGHTHS: u32 = 144;

/// More than the time between leading edges within a frame, in eighths of a bit.
const FRAME_APART_EIGHTHS: u32 = 16;

/// Usual time from the alarm to the look, which then waits for the last edge.
const WAKING_US: u32 = 8;

/// The task's own state, besides that of replies.
pub(crate) struct Listener {
    pub(crate) port: Port,
    pub(crate) capture: Capture,
    pub(crate) setpoint: SetpointWriter,
    pub(crate) snapshot: &'static SnapshotReader,
    /// Rate and duration of the last frame that asked, if its sender's clock is off.
    pub(crate) frame_ticks: Option<(Rate, NonZeroU32)>,
}

/// Listens forever.
#[embassy_executor::task]
pub(crate) async fn listen(mut listener: Listener, mut replier: Replier) -> ! {
    let renewal_ticks = capture::ticks_of_us(RENEWAL_US);
    loop {
        // Prepare before a frame what need not wait for it: the reply then reports the state at the previous
        // frame, or `RENEWAL_US` ago.
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
            let asked = listener.look(&mut looks, ready.as_ref(), &mut armed);
            if let Some((asked, ready)) = asked.zip(ready.as_ref()) {
                listener.answer(asked, &looks, ready).await;
            }
        }
    }
}

/// State prepared before a frame comes.
struct Ready {
    snapshot: Snapshot,
    /// The reply bits for the snapshot's speed.
    speed_bits: u32,
    /// The signal, if known.
    signal: Option<Signal>,
}

impl Ready {
    /// Returns true unless the signal is known to be one that is not answered on its wire.
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

/// What a frame asked for, and the reply that has begun.
struct Asked<'a> {
    ask: Ask,
    sending: Option<Sending<'a>>,
}

/// Planned looks at the wire, from the first edge on.
struct Looks {
    begin_ticks: u32,
    /// Times of looks to come, ticks. All but the last one only take a whole frame.
    after_ticks: Vec<u32, 3>,
    /// How long to wait for the last edges of an expected frame.
    until_ticks: u32,
    /// A frame whose answer cannot wait for it to be processed.
    unheard: Option<Event>,
}

impl Looks {
    fn next(&mut self) -> Option<u32> {
        self.after_ticks.pop()
    }

    /// Returns true in the last look, or if no other is needed.
    fn is_last(&self) -> bool {
        self.after_ticks.is_empty()
    }
}

impl Listener {
    /// Returns the drive's state for the next answer; `None` before the first snapshot.
    fn ready(&mut self) -> Option<Ready> {
        let snapshot = self.snapshot.read()?;
        let (speed_bits, signal) = self
            .port
            .lock(|throttle| (throttle.speed_bits(&snapshot), throttle.signal()));
        Some(Ready {
            snapshot,
            speed_bits,
            signal,
        })
    }

    /// Plans looks after a first edge, until the line is quiet; without an edge, one look right away.
    fn begin(&mut self, edge: bool, signal: Option<Signal>) -> Looks {
        self.fill();
        if let Some(Signal::Dshot {
            rate,
            bidirectional,
        }) = signal
        {
            let apart_ticks = self.eighths_ticks(rate, FRAME_APART_EIGHTHS);
            let first = usize::from(bidirectional);
            // Edge by edge a frame takes 140 µs: a task that is behind would stay behind.
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
                    .map(|eighths| self.eighths_ticks(rate, eighths));
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

    /// Returns so many eighths of a bit in ticks; 144 at most.
    fn eighths_ticks(&self, rate: Rate, eighths: u32) -> u32 {
        match self.frame_ticks {
            Some((of, ticks)) if of == rate => ticks.get() * eighths / 128,
            _ => TICK_HZ / 8 * eighths / rate.bit_hz(),
        }
    }

    fn fill(&mut self) {
        if !self.capture.fill() {
            TROUBLE.lost_edges();
        }
    }

    /// Takes in new edges and acts on them: a whole frame of the known signal at once, which is fast enough for
    /// a timely answer, everything else edge by edge. A reply begins before anything else is done with its frame.
    // Inlined, it would take 0.2 KB more flash.
    #[inline(never)]
    fn look<'a>(
        &mut self,
        looks: &mut Looks,
        ready: Option<&Ready>,
        armed: &mut Option<Armed<'a>>,
    ) -> Option<Asked<'a>> {
        self.fill_with_frame(looks);
        let (capture, setpoint) = (&mut self.capture, &mut self.setpoint);
        let frame_ticks = &mut self.frame_ticks;
        self.port.lock(|throttle| {
            if throttle.is_storing() {
                capture.edges.forget();
                renew(setpoint, throttle);
                return None;
            }
            let ask = take_in(throttle, &mut capture.edges, looks, ready)?;
            let asked = ask.and_then(|ask| {
                *frame_ticks = ask.frame_ticks.map(|ticks| (ask.rate, ticks));
                let reply = ready.and_then(|ready| throttle.reply(ask, ready.speed_bits));
                let sending = reply
                    .zip(armed.take())
                    .and_then(|(reply, armed)| armed.begin(capture, &reply));
                if ask.bidirectional && sending.is_none() {
                    TROUBLE.late_reply();
                }
                ready.map(|_| Asked { ask, sending })
            });
            if looks.unheard.is_none() {
                renew(setpoint, throttle);
            }
            asked
        })
    }

    /// Takes the edges from the DMA, waiting for a complete frame if one is expected.
    fn fill_with_frame(&mut self, looks: &Looks) {
        let mut waits = !looks.is_last();
        loop {
            self.fill();
            if !waits || self.capture.edges.has_frame() {
                return;
            }
            // Once more after the time has passed: the last edge may have come during the check.
            waits = self.capture.edges.is_before(looks.until_ticks);
        }
    }

    async fn answer(&mut self, asked: Asked<'_>, looks: &Looks, ready: &Ready) {
        let Asked { ask, sending } = asked;
        let setpoint = &mut self.setpoint;
        let Serial { kiss, info } = self.port.lock(|throttle| {
            if let Some(event) = &looks.unheard {
                // The answer to its request is already being sent.
                let _ = throttle.hear(now_us(), event);
                renew(setpoint, throttle);
            }
            throttle.serial(ask, &ready.snapshot)
        });
        if let Some(frame) = kiss {
            kiss::send(&frame);
        }
        if let Some(information) = info {
            kiss::send(&information);
        }
        if let Some(sending) = sending {
            let over_ticks = sending.end(&mut self.capture).await;
            // Skip the reply's own edges. Later ones belong to the next frame, which may have started.
            self.fill();
            self.capture.edges.skip_before(over_ticks);
        }
    }
}

/// Gives the interrupt its set-point.
fn renew(setpoint: &mut SetpointWriter, throttle: &Throttle) {
    setpoint.write(throttle.setpoint());
    throttle_lives();
}

/// Returns what the new edges ask for; `None` leaves it to the next look.
fn take_in(
    throttle: &mut Throttle,
    edges: &mut Edges<TIMER_BITS>,
    looks: &mut Looks,
    ready: Option<&Ready>,
) -> Option<Option<Ask>> {
    let whole = edges.frame();
    if let Some(event) = whole.and_then(|(rests_high, bit)| throttle.whole(rests_high, bit)) {
        looks.after_ticks.clear();
        // It may have failed; the next look reports the loss.
        let skipped = edges.skip_frame();
        skipped.then(|| hear(throttle, looks, event, ready))
    } else if looks.is_last() {
        Some(edge_by_edge(throttle, edges))
    } else {
        if throttle.signal().is_none() {
            // The line had rested before, so edges left from then are not part of this frame.
            let _ = throttle.settle(now_us(), looks.begin_ticks);
        }
        None
    }
}

/// Processes a whole frame now, or leaves it until after its answer.
fn hear(
    throttle: &mut Throttle,
    looks: &mut Looks,
    event: Event,
    ready: Option<&Ready>,
) -> Option<Ask> {
    let ask = Ask::of(&event);
    // The wire belongs to the sender until an answer is known to be wanted.
    let answers = throttle.signal().is_some() && ready.is_some();
    if ask.is_some_and(|ask| ask.bidirectional) && answers {
        looks.unheard = Some(event);
        ask
    } else {
        throttle.hear(now_us(), &event)
    }
}

/// Processes all new edges one by one.
fn edge_by_edge(throttle: &mut Throttle, edges: &mut Edges<TIMER_BITS>) -> Option<Ask> {
    let (mut ask, now_us) = (None, now_us());
    edges.take(|at_ticks, level| {
        ask = throttle.edge(now_us, at_ticks, level).or(ask);
    });
    throttle.settle(now_us, edges.settled()).or(ask)
}

/// Returns the tasks' time.
fn now_us() -> u64 {
    now().as_micros()
}
