//! A small image that holds only a test's assembly.
#![no_std]
#![no_main]

use core::arch::global_asm;
use core::panic::PanicInfo;

global_asm!(include_str!(env!("ASSEMBLY")), options(raw));

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    loop {}
}
