//! B-G431B-ESC1: STM32G431CB, three low-side shunts through the chip's own op-amps, 6S, 40 A peak.
//!
//! Phases U, V, W of the board are a, b, c of the control.

use core::mem;

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::peripherals::{
    DMA1_CH1, DMA1_CH2, DMA1_CH3, DMA1_CH4, DMA1_CH5, DMA1_CH6, IWDG, PA15, PB3, PB4, PB6, TIM1,
    TIM2, TIM3, USART1, USART2,
};
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::{Ch1, Ch2, Dma, UpDma};
use embassy_stm32::usart::{self, Uart, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, interrupt, pac, rcc};
use siskin_control::check::{Item, Kind, Own};
use siskin_control::units::AdcCounts;

use super::parts::parts;
use super::wiring::{GateDriverPins, Slot, Wiring};
use crate::chip::comparators::{self, Unfound};
use crate::chip::pins::{self, Pin, Port, Use};
use crate::chip::{self, capture, converters, op_amps};
use crate::circuit::b_g431b_esc1::{
    BIAS_V, RATING_A, SHUNT_DIVIDER, SHUNT_OHM, V_PER_COUNT, ZERO_COUNTS,
};
use crate::circuit::trip_level::TripCircuit;
use crate::priority;
use crate::storage::Storage;

pub use crate::chip::TIMER_HZ;
pub use crate::circuit::b_g431b_esc1::{BOARD, NAME, NTC};

/// Sampling time of the phase currents: 12.5 cycles of the converters' 42.5 MHz, in
/// clocks of the timer's 170 MHz. 0.29 µs, above the 0.2 µs that an op-amp's output needs.
pub(crate) const SAMPLING_CLOCKS: u16 = 50;

/// The comparators break the PWM.
pub(crate) const BREAKS: bool = true;

/// No gate driver that speaks.
pub(crate) const GATE_DRIVER: Option<GateDriverPins> = None;

/// The phases, from 0, on the timer's channels 1, 2, 3.
pub(crate) const PHASES: [usize; 3] = [0, 1, 2];

/// The order of [`FIRST`] and [`SECOND`].
pub(crate) const WIRING: Wiring = Wiring {
    currents: [Some(Slot(0, 0)), Some(Slot(1, 0)), Some(Slot(0, 1))],
    zero: ZERO_COUNTS,
    // A current into the motor comes up through the low side's shunt and makes its voltage negative.
    rises: false,
    terminals: [Slot(1, 1), Slot(1, 2), Slot(0, 2)],
    bus: Slot(0, 3),
    hall: Some(6),
};

/// The pins that stay as they are. The analogue ones need nothing, the op-amps' inverting inputs PA3, PA5
/// and PB2 among them: the board brings them the shunts' grounds.
const PINS: [Pin; 10] = [
    (Port::A, 8, Use::Gate(6)),
    (Port::C, 13, Use::Gate(4)),
    (Port::A, 9, Use::Gate(6)),
    (Port::A, 12, Use::Gate(6)),
    (Port::A, 10, Use::Gate(6)),
    (Port::B, 15, Use::Gate(4)),
    // Low, it is the ground of the terminals' dividers.
    (Port::B, 5, Use::Low),
    // Hall sensors have open collectors; without sensors the pulls read 7. The telemetry may take the
    // first one's.
    (Port::B, 6, Use::PulledUp),
    (Port::B, 7, Use::PulledUp),
    (Port::B, 8, Use::PulledUp),
];
const _: () = assert!(
    pins::exist_once(&PINS),
    "a pin is named twice or does not exist"
);

/// The first converter's channels: op-amp 1 inside the chip, op-amp 3 at PB1, PB11, PA0. The supply's
/// divider at PA0 has 16 kΩ and is sampled longer than the terminals' with 1.8 kΩ.
const FIRST: [(u8, SampleTime); 4] = [
    (13, SampleTime::CYCLES12_5),
    (12, SampleTime::CYCLES12_5),
    (14, SampleTime::CYCLES24_5),
    (1, SampleTime::CYCLES47_5),
];

/// The second converter's: op-amp 2 inside the chip, PA4, PC4.
const SECOND: [(u8, SampleTime); 3] = [
    (16, SampleTime::CYCLES12_5),
    (17, SampleTime::CYCLES24_5),
    (5, SampleTime::CYCLES24_5),
];

/// The first converter's channel of the thermistor, PB14.
const THERMISTOR: u8 = 5;

/// The comparators' view: they are at the op-amps' inputs.
const TRIP: TripCircuit = TripCircuit {
    bias_v: BIAS_V,
    v_per_a: SHUNT_OHM * SHUNT_DIVIDER,
    rating_a: RATING_A,
    v_per_step: V_PER_COUNT,
};

bind_interrupts!(struct Interrupts {
    USART2 => usart::InterruptHandler<USART2>;
    DMA1_CHANNEL1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<DMA1_CH2>;
    DMA1_CHANNEL3 => dma::InterruptHandler<DMA1_CH3>;
    DMA1_CHANNEL4 => dma::InterruptHandler<DMA1_CH4>;
    DMA1_CHANNEL5 => dma::InterruptHandler<DMA1_CH5>;
    DMA1_CHANNEL6 => dma::InterruptHandler<DMA1_CH6>;
});

/// The throttle wire's timers and pin.
pub(crate) mod wire {
    use embassy_stm32::pac;
    use embassy_stm32::pac::gpio::Gpio;
    use embassy_stm32::pac::gpio::vals::Moder;
    use embassy_stm32::pac::timer::{TimGp16, TimGp32};
    use embassy_stm32::peripherals::{TIM2, TIM3};

    /// Captures the edges.
    pub(crate) type CaptureTimer = TIM2;
    /// Its registers.
    pub(crate) const CAPTURE: TimGp32 = pac::TIM2;
    /// Bits of its counter.
    pub(crate) const TIMER_BITS: u32 = 32;
    /// Divider of its clock.
    pub(crate) const PRESCALER: u16 = 1;
    /// Its rate.
    pub(crate) const TICK_HZ: u32 = super::TIMER_HZ;
    /// Its channel at the pin, from 0.
    pub(crate) const SIGNAL_CHANNEL: usize = 0;
    /// Paces replies.
    pub(crate) type PaceTimer = TIM3;
    /// Its registers.
    pub(crate) const PACE: TimGp16 = pac::TIM3;
    /// Its rate.
    pub(crate) const PACE_HZ: u32 = super::TIMER_HZ;
    /// The pin's port.
    const PORT: Gpio = pac::GPIOA;
    /// The pin's number there.
    const PIN: usize = 15;

    /// The register that the DMA writes while the pin is driven: the port's set and reset register.
    pub(crate) fn level_register() -> *mut u32 {
        PORT.bsrr().as_ptr().cast()
    }

    /// The word to write there for a level.
    pub(crate) fn level_word(level: bool) -> u32 {
        // A zero resets the pin, by the upper half of the register.
        1 << if level { PIN } else { PIN + 16 }
    }

    /// Drives the pin, high at first, or lets it go.
    pub(crate) fn drive_pin(on: bool) {
        PORT.bsrr().write(|w| w.set_bs(PIN, true));
        let mode = if on { Moder::OUTPUT } else { Moder::ALTERNATE };
        PORT.moder().modify(|w| w.set_moder(PIN, mode));
    }
}

parts! {
    throttle: PA15 at TIM2 Ch1,
    executor: FMAC,
    edges: DMA1_CH4 DMA1_CH5,
    replies: TIM3 DMA1_CH6,
}

/// The gate signals, set up; [`crate::interrupt::start`] takes them.
pub struct Bridge {
    _timer: Peri<'static, TIM1>,
}

/// The two converters, which the PWM timer triggers once a period.
///
/// A conversion takes 12.5 cycles of 42.5 MHz after its sampling. The sampling windows begin at
/// these times from the counter's top, in µs, and the end of the first converter's sequence is the
/// end of both, at 3.3 µs:
///
/// | converter | | | | |
/// |---|---|---|---|---|
/// | first | current a −0.15 to 0.15 | current c 0.44 to 0.74 | terminal c 1.03 to 1.61 | supply 1.90 to 3.02 |
/// | second | current b −0.15 to 0.15 | terminal a 0.44 to 1.02 | terminal b 1.31 to 1.89 | |
pub struct Converters {
    _private: (),
}

/// MAVLink's serial line.
pub struct Mavlink {
    uart: Peri<'static, USART2>,
    pins: (Peri<'static, PB4>, Peri<'static, PB3>),
    dma: (Peri<'static, DMA1_CH1>, Peri<'static, DMA1_CH2>),
}

impl Mavlink {
    /// Opens it at a rate that the table of parameters allows.
    pub fn open(self, baud: u32) -> Uart<'static, Async> {
        let mut config = usart::Config::default();
        config.baudrate = chip::hal_baud(baud);
        let ((rx, tx), (out, into)) = (self.pins, self.dma);
        Uart::new(self.uart, rx, tx, out, into, Interrupts, config)
            .expect("170 MHz divides to every rate of the parameter")
    }
}

/// The KISS telemetry's rate.
const KISS_HZ: u32 = 115_200;

/// The KISS telemetry, on the pin of Hall sensor a.
pub struct Kiss {
    uart: Peri<'static, USART1>,
    pin: Peri<'static, PB6>,
    dma: Peri<'static, DMA1_CH3>,
}

impl Kiss {
    /// Takes the pin from the Hall sensor: for a motor without sensors.
    pub fn open(self) -> UartTx<'static, Async> {
        let mut config = usart::Config::default();
        config.baudrate = chip::hal_baud(KISS_HZ);
        UartTx::new(self.uart, self.pin, self.dma, Interrupts, config)
            .expect("170 MHz divides to 115200 baud")
    }
}

/// The board's temperature.
pub struct Temperature {
    reading: converters::Reading,
}

impl Temperature {
    /// The thermistor's reading, for [`NTC`]; it waits some 8 µs for it.
    /// `periods` counts the control periods.
    pub fn read(&mut self, periods: fn() -> u32) -> AdcCounts {
        AdcCounts::from_num(self.reading.counts(periods))
    }
}

impl Hardware {
    /// Starts the chip, and sets up the pins, the op-amps, the comparators and the converters. The
    /// gate signals are low until the timer drives them. To be called once.
    #[inline(never)] // its stack is free for what comes next
    pub fn claim() -> Self {
        let p = chip::start();
        // Before any of them is used: critical sections rely on it.
        priority::lower_all(chip::INTERRUPTS);
        rcc::enable_and_reset::<TIM1>();
        // A debugger that halts the processor stops the timer, and so the bridge is off.
        pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
        comparators::set_up(TRIP.level(RATING_A));
        chip::break_on_lock_up();

        pins::set_up(&PINS);
        // The third one's internal way leads to the second converter, which has b at that time.
        op_amps::amplify_by_16(pac::OPAMP1, true);
        op_amps::amplify_by_16(pac::OPAMP2, true);
        op_amps::amplify_by_16(pac::OPAMP3, false);
        converters::switch_on();
        let temperature = Temperature {
            reading: converters::Reading::new(THERMISTOR),
        };
        converters::convert(pac::ADC2, &SECOND, false);
        converters::convert(pac::ADC1, &FIRST, true);
        Self {
            bridge: Bridge { _timer: p.TIM1 },
            converters: Converters { _private: () },
            light: Output::new(p.PC6, Level::Low, Speed::Low),
            throttle: Throttle {
                pin: p.PA15,
                _timers: (p.TIM2, p.TIM3),
                rising: p.DMA1_CH4,
                falling: p.DMA1_CH5,
                reply: p.DMA1_CH6,
            },
            mavlink: Mavlink {
                uart: p.USART2,
                pins: (p.PB4, p.PB3),
                dma: (p.DMA1_CH1, p.DMA1_CH2),
            },
            kiss: Kiss {
                uart: p.USART1,
                pin: p.PB6,
                dma: p.DMA1_CH3,
            },
            flash: Storage::new(p.FLASH),
            watchdog: p.IWDG,
            temperature,
        }
    }
}

/// Prepares what belongs to the interrupt from then on. It waits 1 ms for the amplifiers to settle.
pub(crate) fn prepare(_bridge: Bridge, _converters: Converters) {
    cortex_m::asm::delay(TIMER_HZ / 1000);
}

/// Sets the comparators' level for a bound on the phase currents, peak amperes.
pub(crate) fn set_trip(phase_a: f32) {
    comparators::set_level(TRIP.level(phase_a));
}

/// nBOOT0 and nSWBOOT0 among the option bytes (RM0440, FLASH_OPTR): with the first set and the second clear the
/// chip starts from its flash whatever the level of PB8, BOOT0, which is a Hall sensor's here.
const BOOT_OPTIONS: (u32, u32) = (1 << 27, 1 << 26);

/// Measures an item of the self-test that is this board's own. The full scale and the slow oscillator are not
/// measured.
pub(crate) fn own(item: Item) -> Own {
    match item.kind {
        Kind::OptionBytes => {
            let (set, clear) = BOOT_OPTIONS;
            let sound = FLASH.optr().read().0 & (set | clear) == set;
            Own::Value(f32::from(u8::from(sound)))
        }
        Kind::Comparator => match comparators::search(item.phase.into()) {
            Ok(level) => Own::Value(TRIP.amperes(level)),
            Err(Unfound::Stuck) => Own::Value(f32::NAN),
            Err(Unfound::Conducts) => Own::Busy,
        },
        _ => Own::Absent,
    }
}
