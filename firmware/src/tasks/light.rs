//! The light, by which a person without a ground station sees what is wrong.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::gpio::Output;
use embassy_time::Timer;

use crate::exchange::SnapshotReader;

/// Whether a flight controller has ordered the light to be on.
static ORDERED: AtomicBool = AtomicBool::new(false);

/// Turns the light on or off by order; faults are shown before it.
pub(crate) fn order(on: bool) {
    ORDERED.store(on, Ordering::Relaxed);
}

/// Flashes once when all is well, and n + 2 times for the fault with the lowest number n; then comes
/// a pause. Dark: the control does not run.
#[embassy_executor::task]
pub(crate) async fn show(mut light: Output<'static>, snapshot: &'static SnapshotReader) -> ! {
    loop {
        let fault = snapshot.read().map(|s| s.faults.iter().next());
        let flashes = match fault {
            None => 0,
            Some(None) if ORDERED.load(Ordering::Relaxed) => {
                light.set_high();
                Timer::after_millis(100).await;
                continue;
            }
            Some(None) => 1,
            Some(Some(fault)) => fault as u64 + 2,
        };
        for _ in 0..flashes {
            light.set_high();
            Timer::after_millis(50).await;
            light.set_low();
            Timer::after_millis(200).await;
        }
        light.set_low();
        Timer::after_millis(1750).await;
    }
}
