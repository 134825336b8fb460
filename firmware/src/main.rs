//! Firmware image for one board; see the library's documentation.
#![no_std]
#![no_main]

#[cfg(not(any(feature = "b-g431b-esc1", feature = "vesc4-f405")))]
compile_error!(
    "choose a board: --features b-g431b-esc1 or, for instance, --features vesc4-f405-r001"
);

mod handlers;
mod memory;
mod start_up;

use embassy_executor::Spawner;
use siskin_firmware::board::{Hardware, NAME};
use siskin_firmware::image::{Image, is_whole};
use siskin_firmware::tasks::Fit;
use siskin_firmware::{damaged, tasks};

#[unsafe(no_mangle)]
#[unsafe(link_section = ".image")]
static IMAGE: Image = Image::of(NAME);

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    // Its pins keep the gates off until the control drives them.
    let mut hardware = Hardware::claim();
    if !is_whole() {
        damaged::tell(hardware);
    }
    // Locals of this task are constructed in place. In a static the ESC would be moved from the stack, which
    // would need another 2.9 KB for that alone.
    let mut fit = Fit::default();
    let mut esc = tasks::power_up(&mut hardware.flash, &mut fit);
    let mut main_task = tasks::start(spawner, hardware, &mut esc, fit);
    main_task.attend().await
}
