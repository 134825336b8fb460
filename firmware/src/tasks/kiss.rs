//! KISS telemetry for flight controllers on a serial line, 115200 baud, and the ESC's information.

use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use heapless::Vec;
use siskin_control::answer::info;

type Bytes = Vec<u8, { info::BYTES }>;

/// The throttle side spaces frames so that the previous one is gone.
static NEXT: Channel<CriticalSectionRawMutex, Bytes, 1> = Channel::new();

/// Queues a frame for the line, without waiting.
pub(crate) fn send(frame: &[u8]) {
    if let Ok(bytes) = Bytes::from_slice(frame) {
        // Drop it if the line is behind: nobody waits for it, and the flight controller asks again.
        let _ = NEXT.try_send(bytes);
    }
}

/// Sends forever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut line: UartTx<'static, Async>) -> ! {
    loop {
        let frame = NEXT.receive().await;
        // An error on a transmit-only line cannot be reported.
        let _ = line.write(&frame).await;
    }
}
