//! Which parts have a clock, and which are in reset.

use crate::chip::{Context, Signal, Unmodelled};

/// The reset registers; [`ENABLES_AFTER`] bytes after each is an enable register with the same bits.
const RESETS: [u32; 6] = [AHB1, AHB2, 0x30, APB1, APB1_MORE, APB2];

const AHB1: u32 = 0x28;
const AHB2: u32 = 0x2c;
const APB1: u32 = 0x38;
const APB1_MORE: u32 = 0x3c;
const APB2: u32 = 0x40;

/// From a reset register to the enable register of the same parts.
const ENABLES_AFTER: u32 = 0x20;

/// Parts by their 1 KiB block, with their reset register and bit. Anything else needs no clock of its own.
const PARTS: [(u32, u32, u8); 49] = [
    (0x4002_0000, AHB1, 0),      // DMA1
    (0x4002_0400, AHB1, 1),      // DMA2
    (0x4002_0800, AHB1, 2),      // DMAMUX1
    (0x4002_0c00, AHB1, 3),      // CORDIC
    (0x4002_1400, AHB1, 4),      // FMAC
    (0x4002_2000, AHB1, 8),      // FLASH
    (0x4002_3000, AHB1, 12),     // CRC
    (0x4800_0000, AHB2, 0),      // GPIOA
    (0x4800_0400, AHB2, 1),      // GPIOB
    (0x4800_0800, AHB2, 2),      // GPIOC
    (0x4800_0c00, AHB2, 3),      // GPIOD
    (0x4800_1000, AHB2, 4),      // GPIOE
    (0x4800_1400, AHB2, 5),      // GPIOF
    (0x4800_1800, AHB2, 6),      // GPIOG
    (0x5000_0000, AHB2, 13),     // ADC1, ADC2 and what they share
    (0x5000_0800, AHB2, 16),     // DAC1
    (0x5000_1000, AHB2, 18),     // DAC3
    (0x5006_0800, AHB2, 26),     // RNG
    (0x4000_0000, APB1, 0),      // TIM2
    (0x4000_0400, APB1, 1),      // TIM3
    (0x4000_0800, APB1, 2),      // TIM4
    (0x4000_1000, APB1, 4),      // TIM6
    (0x4000_1400, APB1, 5),      // TIM7
    (0x4000_2000, APB1, 8),      // CRS
    (0x4000_2400, APB1, RTC),    // TAMP
    (0x4000_2800, APB1, RTC),    // RTC
    (0x4000_2c00, APB1, 11),     // WWDG
    (0x4000_3800, APB1, 14),     // SPI2
    (0x4000_3c00, APB1, 15),     // SPI3
    (0x4000_4400, APB1, 17),     // USART2
    (0x4000_4800, APB1, 18),     // USART3
    (0x4000_4c00, APB1, 19),     // UART4
    (0x4000_5400, APB1, 21),     // I2C1
    (0x4000_5800, APB1, 22),     // I2C2
    (0x4000_5c00, APB1, 23),     // USB
    (0x4000_6400, APB1, 25),     // FDCAN1
    (0x4000_7000, APB1, 28),     // PWR
    (0x4000_7800, APB1, 30),     // I2C3
    (0x4000_7c00, APB1, 31),     // LPTIM1
    (0x4000_8000, APB1_MORE, 0), // LPUART1
    (0x4000_a000, APB1_MORE, 8), // UCPD1
    (0x4001_0000, APB2, SYSCFG), // SYSCFG, VREFBUF, comparators, op-amps
    (0x4001_2c00, APB2, 11),     // TIM1
    (0x4001_3000, APB2, 12),     // SPI1
    (0x4001_3400, APB2, 13),     // TIM8
    (0x4001_3800, APB2, 14),     // USART1
    (0x4001_4000, APB2, 16),     // TIM15
    (0x4001_4400, APB2, 17),     // TIM16
    (0x4001_4800, APB2, 18),     // TIM17
];

/// RTCAPBEN, which has no reset bit.
const RTC: u8 = 10;

/// SYSCFGEN.
const SYSCFG: u8 = 0;

/// The registers.
#[derive(Debug)]
pub(super) struct Gates {
    enabled: [u32; RESETS.len()],
    resets: [u32; RESETS.len()],
}

impl Gates {
    /// Creates them as after a reset: the flash and the RTC's registers have their clock.
    pub(super) fn new() -> Self {
        Self {
            enabled: [1 << 8, 0, 0, 1 << RTC, 0, 0],
            resets: [0; RESETS.len()],
        }
    }

    /// Returns whether the part at this address has a clock, or needs none.
    pub(super) fn open(&self, address: u32) -> bool {
        let place = address & !0x3ff;
        let part = PARTS.iter().find(|part| part.0 == place);
        part.is_none_or(|(_, register, bit)| {
            position(*register).is_some_and(|index| self.enabled[index] >> bit & 1 == 1)
        })
    }

    pub(super) fn read(&self, offset: u32) -> Result<u32, Unmodelled> {
        if let Some(index) = position(offset) {
            Ok(self.resets[index])
        } else if let Some(index) = position(offset.wrapping_sub(ENABLES_AFTER)) {
            Ok(self.enabled[index])
        } else {
            Err(Unmodelled)
        }
    }

    pub(super) fn write(
        &mut self,
        offset: u32,
        value: u32,
        context: &mut Context,
    ) -> Result<(), Unmodelled> {
        if let Some(index) = position(offset) {
            let begins = value & !self.resets[index];
            let bits = (0..32).filter(|bit| begins >> bit & 1 == 1);
            let signals = bits.map(|bit| Signal::ResetPart(offset, bit));
            context.signals.extend(signals);
            self.resets[index] = value;
        } else if let Some(index) = position(offset.wrapping_sub(ENABLES_AFTER)) {
            self.enabled[index] = value;
        } else {
            return Err(Unmodelled);
        }
        Ok(())
    }
}

fn position(reset_register: u32) -> Option<usize> {
    RESETS.iter().position(|offset| *offset == reset_register)
}
