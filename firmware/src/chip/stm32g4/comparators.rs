//! Comparators that turn the bridge off through TIM1's break input, without the processor.
//!
//! Each compares an op-amp's input with a level from DAC3 (RM0440, tables of the comparators' inputs and of
//! TIM1's break). They see one polarity of a phase's shunt: the reading rises with current out of the motor,
//! which flows down through the low side.

use embassy_stm32::pac::comp::Comp;
use embassy_stm32::pac::comp::vals::{Hysteresis, Inm};
use embassy_stm32::pac::dac::vals::Mode;
use embassy_stm32::pac::timer::regs::SrAdv;
use embassy_stm32::pac::{COMP1, COMP2, COMP4, DAC3, RCC, TIM1};

/// The comparators. All use the first INPSEL input: PA1, PA7 and PB0.
const COMPARATORS: [Comp; 3] = [COMP1, COMP2, COMP4];

/// Their enables in TIM1_AF1, BKCMP1E, 2E and 4E, counted from 0.
const BREAKS: [usize; 3] = [0, 1, 3];

/// The highest level.
const FULL_SCALE: u16 = 4095;

/// Time for the output to follow a level, core cycles: 10 µs, where the DAC takes up to 3 µs without its buffer
/// (STM32G431 data sheet) and the comparator 0.1 µs.
const SETTLE: u32 = 1_700;

/// Sets the comparators up with a level out of 4096, and lets them break the PWM. The timer's clock must be on.
pub(crate) fn set_up(level: u16) {
    RCC.ahb2enr().modify(|w| w.set_dac3en(true));
    RCC.apb2enr().modify(|w| w.set_syscfgen(true));
    DAC3.mcr().write(|w| {
        for channel in 0..2 {
            w.set_mode(channel, Mode::NORMAL_INT_BUFDIS);
        }
        // For a bus above 160 MHz.
        w.set_hfsel(2);
    });
    set_level(level);
    DAC3.cr().modify(|w| {
        for channel in 0..2 {
            w.set_en(channel, true);
        }
    });
    for comparator in COMPARATORS {
        comparator.csr().write(|w| {
            // DAC3 channel 1 for COMP1, channel 2 for the others.
            w.set_inmsel(Inm::DACA);
            w.set_hyst(Hysteresis::NONE);
            w.set_en(true);
        });
    }
    TIM1.af1().write(|w| {
        // No pin breaks.
        w.set_bkine(false);
        for number in BREAKS {
            w.set_bkcmpe(number, true);
        }
    });
}

/// Sets the level, out of 4096.
pub(crate) fn set_level(level: u16) {
    for channel in 0..2 {
        DAC3.dhr12r(channel).write(|w| w.set_dhr(level));
    }
}

/// Why a comparator's level was not found.
pub(crate) enum Unfound {
    /// It does not trip at 0, or trips at full scale.
    Stuck,
    /// The bridge conducts, or started to: it needs the comparators.
    Conducts,
}

/// Returns the highest level, out of 4096, at which a comparator would trip now. Meanwhile no comparator breaks
/// the PWM, for 0.2 ms or, once the bridge starts to conduct, for 30 µs of this function's own time, plus
/// interrupts. If it already conducts, nothing is touched. The control's own trip stays active throughout.
pub(crate) fn search(comparator: usize) -> Result<u16, Unfound> {
    if conducts() {
        return Err(Unfound::Conducts);
    }
    let breaking = TIM1.af1().read();
    TIM1.af1().modify(|w| {
        for number in BREAKS {
            w.set_bkcmpe(number, false);
        }
    });
    let given = DAC3.dhr12r(0).read().dhr();
    let found = bisect(COMPARATORS[comparator]);
    set_level(given);
    cortex_m::asm::delay(SETTLE);
    // Writing 1 leaves bits unchanged.
    let mut others = SrAdv(!0);
    others.set_bif(0, false);
    TIM1.sr().write_value(others);
    TIM1.af1().write_value(breaking);
    found
}

fn bisect(comparator: Comp) -> Result<u16, Unfound> {
    let trips_at = |level| {
        set_level(level);
        cortex_m::asm::delay(SETTLE);
        if conducts() {
            return Err(Unfound::Conducts);
        }
        Ok(comparator.csr().read().value())
    };
    let (mut low, mut high) = (0, FULL_SCALE);
    if !trips_at(low)? || trips_at(high)? {
        return Err(Unfound::Stuck);
    }
    while high - low > 1 {
        let middle = (low + high) / 2;
        if trips_at(middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(low)
}

/// Returns true if a switch is on, or may be from the next commutation on: a leg that is off keeps its low
/// side's output disabled.
fn conducts() -> bool {
    let enables = TIM1.ccer().read();
    TIM1.bdtr().read().moe() && (0..3).any(|channel| enables.ccne(channel))
}
