//! Starts the interrupt.

use core::cell::UnsafeCell;

use cortex_m::peripheral::{NVIC, SCB};
use embassy_stm32::interrupt;

use super::period::Interrupt;
use super::registers::Registers;
use crate::board;
use crate::chip;
use crate::exchange::{InterruptCell, RunningEnd};
use crate::priority;

#[unsafe(link_section = ".control_state")]
static INTERRUPT: InterruptCell<Interrupt> = InterruptCell::new();

/// Starts the PWM and its interrupt, with all switches off until a set-point turns the motor.
///
/// Waits up to 20 ms for gate driver and amplifiers.
///
/// # Panics
/// If called again.
// Out of line, like the board's `claim`: their stack is free again before the tasks start.
#[inline(never)]
pub fn start(bridge: board::Bridge, converters: board::Converters, end: RunningEnd) {
    // SAFETY: the processor's own peripherals; nothing but the code below uses the vector table's address, and
    // embassy has not been given it.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    vectors_in_ram(&mut core.SCB);
    board::prepare(bridge, converters);
    #[cfg(feature = "stm32f405")]
    super::gate_driver::begin();
    // SAFETY: the interrupt is not enabled, and this runs in thread mode.
    let put = unsafe { INTERRUPT.put(|| Interrupt::new(Registers::CHIP, end)) };
    assert!(put, "the interrupt is started once");
    // SAFETY: as above; the cell is filled.
    critical_section::with(|_| unsafe { INTERRUPT.with(Interrupt::begin) });
    priority::set(chip::CONVERTED as usize, priority::PWM);
    // SAFETY: everything the interrupt needs is in place, and no critical section relies on masking it.
    unsafe { NVIC::unmask(chip::CONVERTED) };
}

/// Sets the hardware over-current trip for a phase current limit of `phase_a`, peak A: 1.6 times that, at most
/// the board's rating. A board without such a trip only has the software's.
pub fn set_trip(phase_a: f32) {
    board::set_trip(phase_a);
}

/// Moves the vector table to where flash erases cannot stall it.
fn vectors_in_ram(scb: &mut SCB) {
    unsafe extern "C" {
        static __vector_table: UnsafeCell<u32>;
        static __ram_vectors: UnsafeCell<u32>;
        static __ram_vectors_end: UnsafeCell<u32>;
    }
    // SAFETY: the linker script reserves this room at the destination, no longer than the table and
    // aligned to 512, and nothing else is there. The table is written before it is used.
    unsafe {
        let to = __ram_vectors.get();
        let words = __ram_vectors_end.get().offset_from(to) as usize;
        __vector_table.get().copy_to_nonoverlapping(to, words);
        scb.vtor.write(to as u32);
    }
    cortex_m::asm::dsb();
}

/// End of the injected conversions.
#[cfg(feature = "stm32g431")]
#[interrupt]
#[unsafe(link_section = ".control")]
fn ADC1_2() {
    // SAFETY: this is the interrupt; it is enabled once the cell is filled.
    unsafe { INTERRUPT.with(Interrupt::run) };
}

/// End of the injected conversions.
#[cfg(feature = "stm32f405")]
#[interrupt]
#[unsafe(link_section = ".control")]
fn ADC() {
    // SAFETY: this is the interrupt; it is enabled once the cell is filled.
    unsafe { INTERRUPT.with(Interrupt::run) };
}
