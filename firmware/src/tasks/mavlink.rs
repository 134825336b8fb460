//! The ESC's tasks outside the throttle: MAVLink on the board's serial port, telemetry, requests.
//!
//! One task owns the [`Esc`], and with it the parameters; bytes go in and out by DMA.

use embassy_futures::select::{Either, select};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{RingBufferedUartRx, UartTx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_time::{Duration, Ticker};
use siskin_control::esc::{Esc, obey};
use siskin_control::mavlink::{Receiver, Request};

use super::clock::now;
use super::health;
use super::light::Light;
use super::supervisor::Supervisor;
use super::throttle::Port;
use super::trouble::Teller;
use crate::exchange::{ConfigWriter, SnapshotReader};
use crate::storage::{Storage, range};
use crate::{interrupt, last_words};

/// Time between two polls.
const POLL: Duration = Duration::from_millis(1);

/// Bytes waiting to be sent: replies to a burst of requests, 90 ms of the slowest link.
static OUT: Pipe<CriticalSectionRawMutex, 1024> = Pipe::new();

/// Sends forever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut line: UartTx<'static, Async>) -> ! {
    let mut bytes = [0; 64];
    loop {
        let count = OUT.read(&mut bytes).await;
        // An error on the line cannot be reported over it.
        let _ = line.write(&bytes[..count]).await;
    }
}

/// Queues a whole frame, or nothing if the line is behind: half a frame would spoil the next one too.
fn send(mut frame: &[u8]) {
    if OUT.free_capacity() < frame.len() {
        return;
    }
    // In two parts if it wraps around the end of the ring.
    while !frame.is_empty()
        && let Ok(count) = OUT.try_write(frame)
    {
        frame = &frame[count..];
    }
}

/// Polls from the time the queue is empty until a restart: the line still has 64 bytes, 6 ms at the lowest
/// speed.
const RESTART_POLLS: u8 = 10;

/// State of the ESC's task.
pub struct MainTask<'a> {
    pub(crate) esc: &'a mut Esc,
    pub(crate) throttle: Port,
    pub(crate) line: RingBufferedUartRx<'static>,
    pub(crate) config: ConfigWriter,
    pub(crate) snapshot: &'static SnapshotReader,
    pub(crate) flash: Storage,
    pub(crate) health: health::Health,
    pub(crate) receiver: Receiver,
    pub(crate) teller: Teller,
    pub(crate) light: Light,
    pub(crate) supervisor: Supervisor,
    /// The interrupt has yet to receive the configuration in force.
    pub(crate) changed: bool,
    /// Phase current limit that the hardware trip is set for, A.
    pub(crate) limit_a: f32,
    /// Polls until the chip restarts, once requested.
    pub(crate) restart_polls: Option<u8>,
}

// Each out of line, so that the stack one takes is free for the next.
impl MainTask<'_> {
    /// Serves the ESC forever.
    pub async fn attend(&mut self) -> ! {
        let mut ticker = Ticker::every(POLL);
        let mut bytes = [0; 64];
        loop {
            match select(ticker.next(), self.line.read(&mut bytes)).await {
                Either::First(()) => self.poll(),
                Either::Second(Ok(count)) => self.receive(&bytes[..count]),
                // Bytes were lost or garbled: the frame's checksum shows it.
                Either::Second(Err(_)) => {}
            }
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        let now_us = now().as_micros();
        let (esc, throttle) = (&mut self.esc, &mut self.throttle);
        self.receiver
            .push(now_us, bytes, |frame| esc.receive(throttle, now_us, frame));
    }

    fn poll(&mut self) {
        // Empty input tells the receiver that time has passed: it rescans what a false start held back.
        self.receive(&[]);
        if !self.look() {
            return;
        }
        while let Some(request) = self.request() {
            self.obey(request);
        }
        self.limit();
        self.configure();
        self.restart();
    }

    /// Takes in what the interrupt and the board report, and lets the ESC act. Returns false until the
    /// interrupt has reported something.
    #[inline(never)] // its stack is free for what comes next
    fn look(&mut self) -> bool {
        let now = now();
        self.supervisor.poll(now);
        let snapshot = self.snapshot.read();
        let telemetry = self.esc.telemetry();
        let unknown = siskin_throttle::is_unknown(telemetry.signal, telemetry.bad_share);
        self.light
            .poll(now, snapshot.as_ref(), self.esc.light(), unknown);
        let Some(snapshot) = snapshot else {
            return false;
        };
        if let Some(warning) = self.teller.next(now) {
            self.esc.warn(warning);
        }
        self.health.poll(now);
        self.esc.poll(
            &mut self.throttle,
            now.as_micros(),
            &snapshot,
            self.health.temperature_c(),
            &mut |frame| send(frame),
        );
        self.esc.test_itself(&snapshot, &mut self.health);
        true
    }

    #[inline(never)] // its stack is free for what comes next
    fn request(&mut self) -> Option<Request> {
        self.esc.take_request(&mut self.throttle)
    }

    #[inline(never)] // its stack is free for what comes next
    fn obey(&mut self, request: Request) {
        match request {
            Request::ParamsChanged => self.changed = true,
            Request::Save | Request::Keep | Request::Load | Request::FactoryReset => {
                let result = self.store(request);
                self.esc.storage_done(&mut self.throttle, result);
            }
            Request::Reboot => self.restart_polls = Some(RESTART_POLLS),
        }
    }

    #[inline(never)] // its stack is free for what comes next
    fn store(&mut self, request: Request) -> Result<(), &'static str> {
        let mut kept = self.esc.kept();
        if obey(request, &mut self.flash, range(), &mut kept)? {
            self.esc.replace(&mut kept);
        }
        Ok(())
    }

    /// Restarts the chip when requested, once the acknowledgement is gone.
    fn restart(&mut self) {
        let Some(polls) = &mut self.restart_polls else {
            return;
        };
        if OUT.is_empty() {
            *polls -= 1;
        }
        if *polls == 0 {
            last_words::restart();
        }
    }

    /// Gives the interrupt the configuration from the parameters, once there is a slot for it.
    #[inline(never)] // its stack is free for what comes next
    fn configure(&mut self) {
        if !self.changed {
            return;
        }
        let esc = &self.esc;
        // It builds, since it has before.
        self.changed = !self.config.offer(|place| esc.config_in(place).is_ok());
    }

    /// Makes the hardware trip follow `LIM_PHASE_A`: raised before the control's, lowered after it.
    #[inline(never)] // its stack is free for what comes next
    fn limit(&mut self) {
        let Some(snapshot) = self.snapshot.read() else {
            return;
        };
        let limit_a = self.esc.phase_limit_a(&snapshot);
        if limit_a != self.limit_a {
            self.limit_a = limit_a;
            interrupt::set_trip(limit_a);
        }
    }
}
