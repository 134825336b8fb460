//! The throttle's task: edges of the wire in, set-points to the interrupt and answers to the flight
//! controller out.
//!
//! It runs in an executor of its own, above all other tasks: a bidirectional frame is answered
//! 30 µs after its end. The other tasks reach what it knows by [`Port`], with all interrupts but
//! the control's held off for that moment.

mod capture;
mod reply;

use core::cell::RefCell;

use embassy_executor::InterruptExecutor;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Instant;
use siskin_control::answer::{Answer, Ask};
use siskin_control::input::dshot::Rate;
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

/// When the edges that follow a first one are looked at where no frame is known to come.
const UNKNOWN_LOOK_US: u32 = 30;

/// When a frame is looked at, in bits after its first edge: once within, so that less is left to be
/// done at the end, then when its last edge is there (15 bits and the 3/4 of a one), and, if it was
/// late, soon after.
const FRAME_LOOKS_BITS: [u32; 2] = [10, 16];

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
        if listener.capture.wait_for_edge(due_ticks).await {
            listener.burst().await;
        } else {
            listener.look().await;
        }
    }
}

impl Listener {
    /// A first edge has come: looks at what follows until the line is quiet.
    async fn burst(&mut self) {
        let begin_ticks = self.capture.now();
        let signal = self.port.reach(|throttle| throttle.signal());
        for (bits, times) in FRAME_LOOKS_BITS.into_iter().zip(1..) {
            let after_ticks = match signal {
                Some(Signal::Dshot { rate, .. }) => bits_ticks(rate, bits),
                _ => times * capture::ticks_of_us(UNKNOWN_LOOK_US),
            };
            self.capture
                .wait_until(begin_ticks.wrapping_add(after_ticks))
                .await;
            self.look().await;
        }
    }

    /// Takes in what has come, and does what follows from it.
    async fn look(&mut self) {
        let now_us = Instant::now().as_micros();
        let capture = &mut self.capture;
        let (ask, setpoint) = self.port.reach(|throttle| {
            if throttle.is_storing() {
                capture.forget();
                return (None, throttle.setpoint());
            }
            let mut ask = None;
            let whole = capture.take(|at_ticks, level| {
                ask = throttle.edge(now_us, at_ticks, level).or(ask);
            });
            if !whole {
                TROUBLE.lost_edges();
            }
            ask = throttle.settle(now_us, capture.settled()).or(ask);
            (ask, throttle.setpoint())
        });
        self.setpoint.write(setpoint);
        throttle_lives();
        if let Some(ask) = ask {
            self.answer(ask).await;
        }
    }

    async fn answer(&mut self, ask: Ask) {
        let Some(snapshot) = self.snapshot.read() else {
            return;
        };
        let Answer { reply, kiss, info } =
            self.port.reach(|throttle| throttle.answer(ask, &snapshot));
        if let Some(frame) = kiss {
            kiss::send(&frame);
        }
        if let Some(information) = info {
            kiss::send(&information);
        }
        if let Some(reply) = reply {
            if !self.replier.send(&mut self.capture, &reply).await {
                TROUBLE.late_reply();
            }
            // What it has heard of itself.
            self.capture.forget();
        }
    }
}

/// So many bits of a frame; 25 are the most.
fn bits_ticks(rate: Rate, bits: u32) -> u32 {
    TICK_HZ * bits / rate.bit_hz()
}
