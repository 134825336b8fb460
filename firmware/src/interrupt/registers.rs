//! The registers that the interrupt accesses; their blocks may also be plain memory.

use core::sync::atomic::AtomicU32;

use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::timer::TimAdv;
use embassy_stm32::pac::{ADC1, ADC2, GPIOB, GPIOC};

use crate::chip::bridge;

/// The register blocks that the interrupt accesses.
#[derive(Clone, Copy)]
pub struct Registers {
    /// PWM timer.
    pub(crate) timer: TimAdv,
    /// Converters triggered by the timer.
    pub(crate) converters: [Adc; 2],
    /// Port B: Hall sensors.
    pub(crate) port_b: Gpio,
    /// Port C: the gate driver and, on some boards, a Hall sensor.
    pub(crate) port_c: Gpio,
}

impl Registers {
    /// The chip's own.
    pub const CHIP: Self = Self {
        timer: bridge::TIMER,
        converters: [ADC1, ADC2],
        port_b: GPIOB,
        port_c: GPIOC,
    };
}

/// Words in the largest block: 1 KB.
const WORDS: usize = 256;

/// A register block in plain memory.
type Block = [AtomicU32; WORDS];

/// Memory in place of the blocks, to run the interrupt without its chip and count its instructions on an
/// emulated processor.
pub struct Stand {
    timer: Block,
    pub(super) converters: [Block; 2],
    pub(super) port_b: Block,
    pub(super) port_c: Block,
}

impl Stand {
    /// Creates blocks of zeros: no readings, no flags, and the active-low gate driver alarm inactive.
    #[expect(
        clippy::new_without_default,
        reason = "it is made at compile time, which a default cannot be"
    )]
    pub const fn new() -> Self {
        Self {
            timer: [const { AtomicU32::new(0) }; WORDS],
            converters: [const { [const { AtomicU32::new(0) }; WORDS] }; 2],
            port_b: [const { AtomicU32::new(0) }; WORDS],
            port_c: [const { AtomicU32::new(!0) }; WORDS],
        }
    }

    /// Returns these blocks as registers.
    pub fn registers(&'static self) -> Registers {
        // SAFETY: the pointers are to aligned memory of at least the blocks' sizes, which does not move and may
        // change behind a shared reference.
        unsafe {
            Registers {
                timer: TimAdv::from_ptr(pointer(&self.timer)),
                converters: [
                    Adc::from_ptr(pointer(&self.converters[0])),
                    Adc::from_ptr(pointer(&self.converters[1])),
                ],
                port_b: Gpio::from_ptr(pointer(&self.port_b)),
                port_c: Gpio::from_ptr(pointer(&self.port_c)),
            }
        }
    }
}

fn pointer(block: &'static Block) -> *mut () {
    block.as_ptr().cast_mut().cast()
}
