//! Telemetry on the serial line that flight controllers read (KISS, 115200 baud), and the ESC's
//! information.

use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use heapless::Vec;
use siskin_control::answer::info;

type Bytes = Vec<u8, { info::BYTES }>;

/// The throttle's side leaves so much time between two that the one before is gone.
static NEXT: Channel<CriticalSectionRawMutex, Bytes, 1> = Channel::new();

/// Hands a frame to the line, without waiting.
pub(crate) fn send(frame: &[u8]) {
    if let Ok(bytes) = Bytes::from_slice(frame) {
        // A line that is behind has nobody who waits for this one: the flight controller asks again.
        let _ = NEXT.try_send(bytes);
    }
}

/// Sends for ever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut line: UartTx<'static, Async>) -> ! {
    loop {
        let frame = NEXT.receive().await;
        // An error on a line that only sends cannot be reported.
        let _ = line.write(&frame).await;
    }
}
