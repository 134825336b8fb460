//! The throttle's task: edges of the wire in, set-points to the interrupt and answers to the flight
//! controller out.
//!
//! It runs in an executor of its own, above all other tasks: a bidirectional frame is answered
//! 30 µs after its end. The other tasks reach what it knows by [`Port`], with all interrupts but
//! the control's held off for that moment.

mod capture;
mod reply;
mod ring;

use core::cell::RefCell;

use embassy_executor::InterruptExecutor;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Instant;
use heapless::Vec;
use siskin_control::answer::{Answer, Ask};
use siskin_control::drive::{Setpoint, Snapshot};
use siskin_control::input::dshot::Rate;
use siskin_control::input::line::Event;
use siskin_control::input::signal::Signal;
use siskin_control::throttle::{Reach, Throttle};
use static_cell::StaticCell;

use super::kiss;
use super::supervisor::throttle_lives;
use super::trouble::TROUBLE;
use crate::board;
use crate::board::wire::TICK_HZ;
use crate::exchange::{SetpointWriter, SnapshotReader};
pub(crate) use capture::{Capture, CaptureInterrupt};
pub(crate) use reply::Replier;

static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

/// Runs the throttle's task; for the interrupt that its executor has.
pub(crate) fn run_executor() {
    // SAFETY: called by the interrupt of `start` alone.
    unsafe { EXECUTOR.on_interrupt() }
}

/// Starts the task.
pub(crate) fn start(listener: Listener) {
    let spawner = EXECUTOR.start(board::EXECUTOR);
    spawner.spawn(listen(listener).expect("spawned here and nowhere else"));
}

/// The throttle's side of the ESC, which tasks reach one at a time.
type Shared = Mutex<CriticalSectionRawMutex, RefCell<Throttle>>;

/// A way to the throttle's side.
#[derive(Clone, Copy)]
pub(crate) struct Port(&'static Shared);

impl Port {
    /// Makes the throttle's side where all tasks reach it; to be called once.
    pub(crate) fn open(make: impl FnOnce() -> Throttle) -> Self {
        static THROTTLE: StaticCell<Shared> = StaticCell::new();
        Self(THROTTLE.init_with(|| Mutex::new(RefCell::new(make()))))
    }
}

impl Reach for Port {
    fn reach<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T {
        self.0.lock(|throttle| act(&mut throttle.borrow_mut()))
    }
}

/// Looks at the wire, at least this often: what is lost is noticed, and set-points are renewed.
const RENEWAL_US: u32 = 1000;

/// When the edges that follow a first one are looked at where no frame is known to come, twice.
const UNKNOWN_LOOK_US: u32 = 30;

/// When a frame is looked at, in eighths of a bit after its first edge: when its last edge is there (15
/// bits and the 3/4 of a one), and half a bit for the DMA; and, if it was late, soon after.
const FRAME_LOOK_EIGHTHS: u32 = 129;
const LATE_LOOK_EIGHTHS: u32 = 144;

/// How long it takes from the alarm to the look, as a rule: it then waits for the last edge.
const WAKING_US: u32 = 5;

/// What the task owns.
pub(crate) struct Listener {
    pub(crate) port: Port,
    pub(crate) capture: Capture,
    pub(crate) replier: Replier,
    pub(crate) setpoint: SetpointWriter,
    pub(crate) snapshot: &'static SnapshotReader,
}

/// Listens for ever.
#[embassy_executor::task]
pub(crate) async fn listen(mut listener: Listener) -> ! {
    let renewal_ticks = capture::ticks_of_us(RENEWAL_US);
    loop {
        let due_ticks = listener.capture.now().wrapping_add(renewal_ticks);
        let mut looks = if listener.capture.wait_for_edge(due_ticks).await {
            listener.begin()
        } else {
            Looks::at_once()
        };
        while let Some(after_ticks) = looks.next() {
            let at_ticks = looks.begin_ticks.wrapping_add(after_ticks);
            if after_ticks > 0 {
                listener.capture.wait_until(at_ticks).await;
            }
            if let Some(ask) = listener.look(&mut looks) {
                listener.answer(ask, &looks).await;
            }
        }
    }
}

/// When the wire is looked at, from the first edge that has come.
struct Looks {
    begin_ticks: u32,
    /// Times of those to come, ticks.
    after_ticks: Vec<u32, 2>,
    /// Whether a whole frame is expected, and nothing else taken.
    frame: bool,
    /// The drive as the answer shall tell of it, and the reply's bits for that.
    ready: Option<(Snapshot, u32)>,
    /// Until when the last edges of an expected frame are waited for.
    until_ticks: u32,
    /// A frame whose answer cannot wait until it has been heard.
    unheard: Option<Event>,
}

impl Looks {
    /// Once, at once.
    fn at_once() -> Self {
        Self {
            begin_ticks: 0,
            after_ticks: Vec::from([0]),
            frame: false,
            ready: None,
            until_ticks: 0,
            unheard: None,
        }
    }

    fn next(&mut self) -> Option<u32> {
        self.after_ticks.pop()
    }
}

impl Listener {
    /// A first edge has come: what follows is looked at until the line is quiet.
    #[inline(never)]
    fn begin(&mut self) -> Looks {
        let signal = self.port.reach(|throttle| throttle.signal());
        self.fill();
        let begin_ticks = match self.capture.first() {
            Some(first_ticks) => first_ticks,
            None => self.capture.now(),
        };
        let unknown_ticks = capture::ticks_of_us(UNKNOWN_LOOK_US);
        let (last_ticks, after_ticks) = match signal {
            Some(Signal::Dshot { rate, .. }) => {
                let [late, last] = [LATE_LOOK_EIGHTHS, FRAME_LOOK_EIGHTHS]
                    .map(|eighths| eighths_ticks(rate, eighths));
                (last, [late, last - capture::ticks_of_us(WAKING_US)])
            }
            _ => (0, [2 * unknown_ticks, unknown_ticks]),
        };
        let frame = last_ticks > 0;
        // What can be done before the frame has ended is not to be done after it.
        let ready = self.snapshot.read().map(|snapshot| {
            let speed_bits = self.port.reach(|throttle| throttle.speed_bits(&snapshot));
            (snapshot, speed_bits)
        });
        Looks {
            begin_ticks,
            after_ticks: Vec::from(after_ticks),
            frame,
            ready,
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
    #[inline(never)]
    fn look(&mut self, looks: &mut Looks) -> Option<Ask> {
        self.fill();
        let waits = core::mem::take(&mut looks.frame);
        while waits && !self.capture.has_frame() && self.capture.is_before(looks.until_ticks) {
            self.fill();
        }
        let now_us = Instant::now().as_micros();
        let capture = &mut self.capture;
        let (ask, setpoint) = self.port.reach(|throttle| {
            if throttle.is_storing() {
                capture.forget();
                return Some((None, Some(throttle.setpoint())));
            }
            let whole = capture.frame();
            if let Some(event) = whole.and_then(|bit| throttle.whole(bit)) {
                capture.skip_frame();
                looks.after_ticks.clear();
                let ask = Ask::of(&event);
                if ask.is_some_and(|ask| ask.bidirectional) && looks.ready.is_some() {
                    looks.unheard = Some(event);
                    return Some((ask, None));
                }
                let ask = throttle.hear(now_us, &event);
                return Some((ask, Some(throttle.setpoint())));
            }
            if waits {
                return None;
            }
            let mut ask = None;
            capture.take(|at_ticks, level| {
                ask = throttle.edge(now_us, at_ticks, level).or(ask);
            });
            ask = throttle.settle(now_us, capture.settled()).or(ask);
            Some((ask, Some(throttle.setpoint())))
        })?;
        if let Some(setpoint) = setpoint {
            self.renew(setpoint);
        }
        ask
    }

    /// Gives the interrupt what it is to do.
    fn renew(&mut self, setpoint: Setpoint) {
        self.setpoint.write(setpoint);
        throttle_lives();
    }

    async fn answer(&mut self, ask: Ask, looks: &Looks) {
        let Some((snapshot, speed_bits)) = &looks.ready else {
            return;
        };
        let Answer { reply, kiss, info } =
            (self.port).reach(|throttle| throttle.answer_with(ask, *speed_bits, snapshot));
        let sent = reply.map(|reply| self.replier.begin(&mut self.capture, &reply));
        if let Some(event) = &looks.unheard {
            let now_us = Instant::now().as_micros();
            let setpoint = self.port.reach(|throttle| {
                // What it asks for is being sent.
                let _ = throttle.hear(now_us, event);
                throttle.setpoint()
            });
            self.setpoint.write(setpoint);
            throttle_lives();
        }
        if let Some(frame) = kiss {
            kiss::send(&frame);
        }
        if let Some(information) = info {
            kiss::send(&information);
        }
        if let Some(sent) = sent {
            match sent {
                Some(sent) => sent.end().await,
                None => TROUBLE.late_reply(),
            }
            // What it has heard of itself.
            self.capture.forget();
        }
    }
}

/// So many eighths of a bit of a frame; 144 are the most.
fn eighths_ticks(rate: Rate, eighths: u32) -> u32 {
    TICK_HZ / 8 * eighths / rate.bit_hz()
}
