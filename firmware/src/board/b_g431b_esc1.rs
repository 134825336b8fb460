//! B-G431B-ESC1: STM32G431CB, three low-side shunts through on-chip op-amps, 6S, 40 A peak.
//!
//! The board's phases U, V, W are a, b, c of the control.

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
use siskin_units::AdcCounts;

use super::parts::parts;
use super::wiring::{GateDriverPins, Slot, Wiring};
use crate::chip::comparators::{self, Unfound};
use crate::chip::pins::{self, Pin, Port, Use};
use crate::chip::{self, capture, converters, op_amps};
use crate::circuit::b_g431b_esc1::{
    BIAS_V, RATING_A, SHUNT_DIVIDER, SHUNT_OHM, V_PER_COUNT, ZERO_COUNTS,
};
use crate::circuit::trip_level::TripCircuit;
use crate::hall;
use crate::priority;
use crate::storage::Storage;

pub use crate::chip::TIMER_HZ;
pub use crate::circuit::b_g431b_esc1::{BOARD, NAME, NTC};

/// Sampling time of the phase currents: 12.5 cycles of the converters' 42.5 MHz, in clocks of the 170 MHz
/// timer: 0.29 µs, above the 0.2 µs that an op-amp's output needs.
pub(crate) const SAMPLING_CLOCKS: u16 = 50;

/// The comparators break the PWM.
pub(crate) const BREAKS: bool = true;

/// KISS telemetry takes a Hall sensor's pin.
pub(crate) const KISS_TAKES_A_SENSOR: bool = true;

/// No gate driver with a fault output.
pub(crate) const GATE_DRIVER: Option<GateDriverPins> = None;

/// The phases, from 0, on timer channels 1, 2, 3.
pub(crate) const PHASES: [usize; 3] = [0, 1, 2];

/// Slots refer to [`FIRST`] and [`SECOND`].
pub(crate) const WIRING: Wiring = Wiring {
    currents: [Some(Slot(0, 0)), Some(Slot(1, 0)), Some(Slot(0, 1))],
    zero: ZERO_COUNTS,
    // Current into the motor comes up through the low side's shunt and makes its voltage negative.
    rises: false,
    terminals: [Slot(1, 1), Slot(1, 2), Slot(0, 2)],
    bus: Slot(0, 3),
    hall: hall::Pins([hall::Pin::B(6), hall::Pin::B(7), hall::Pin::B(8)]),
};

/// Pins with a fixed function. The analogue ones need no set-up, including the op-amps' inverting inputs PA3,
/// PA5 and PB2, which the board connects to the shunts' grounds.
const PINS: [Pin; 10] = [
    (Port::A, 8, Use::Gate(6)),
    (Port::C, 13, Use::Gate(4)),
    (Port::A, 9, Use::Gate(6)),
    (Port::A, 12, Use::Gate(6)),
    (Port::A, 10, Use::Gate(6)),
    (Port::B, 15, Use::Gate(4)),
    // Driven low, this is the ground of the terminal dividers.
    (Port::B, 5, Use::Low),
    // Hall sensors are open-collector; without them the pull-ups read 7. Telemetry may take the first one's
    // pin.
    (Port::B, 6, Use::PulledUp),
    (Port::B, 7, Use::PulledUp),
    (Port::B, 8, Use::PulledUp),
];
const _: () = assert!(
    pins::exist_once(&PINS),
    "a pin is named twice or does not exist"
);

/// First converter's channels: op-amp 1 internally, op-amp 3 at PB1, PB11, PA0. The 16 kΩ supply divider at PA0
/// is sampled longer than the terminals' 1.8 kΩ.
const FIRST: [(u8, SampleTime); 4] = [
    (13, SampleTime::CYCLES12_5),
    (12, SampleTime::CYCLES12_5),
    (14, SampleTime::CYCLES24_5),
    (1, SampleTime::CYCLES47_5),
];

/// Second converter's channels: op-amp 2 internally, PA4, PC4.
const SECOND: [(u8, SampleTime); 3] = [
    (16, SampleTime::CYCLES12_5),
    (17, SampleTime::CYCLES24_5),
    (5, SampleTime::CYCLES24_5),
];

/// First converter's channel for the thermistor, PB14.
const THERMISTOR: u8 = 5;

/// The circuit in front of the comparators, which sense the op-amps' inputs.
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

/// Timers and pin of the throttle wire.
pub(crate) mod wire {
    use embassy_stm32::pac;
    use embassy_stm32::pac::gpio::Gpio;
    use embassy_stm32::pac::gpio::vals::Moder;
    use embassy_stm32::pac::timer::{TimGp16, TimGp32};
    use embassy_stm32::peripherals::{TIM2, TIM3};

    /// Captures edges.
    pub(crate) type CaptureTimer = TIM2;
    /// Its registers.
    pub(crate) const CAPTURE: TimGp32 = pac::TIM2;
    /// Width of its counter, bits.
    pub(crate) const TIMER_BITS: u32 = 32;
    /// Divider of its clock.
    pub(crate) const PRESCALER: u16 = 1;
    /// Its tick rate.
    pub(crate) const TICK_HZ: u32 = super::TIMER_HZ;
    /// Its channel at the pin, from 0.
    pub(crate) const SIGNAL_CHANNEL: usize = 0;
    /// Paces replies.
    pub(crate) type PaceTimer = TIM3;
    /// Its registers.
    pub(crate) const PACE: TimGp16 = pac::TIM3;
    /// Its clock rate.
    pub(crate) const PACE_HZ: u32 = super::TIMER_HZ;
    /// The pin's port.
    const PORT: Gpio = pac::GPIOA;
    /// The pin's number in the port.
    const PIN: usize = 15;

    /// Returns the register that the DMA writes while the pin is driven: the port's set/reset register.
    pub(crate) fn level_register() -> *mut u32 {
        PORT.bsrr().as_ptr().cast()
    }

    /// Returns the word that sets the pin to a level.
    pub(crate) fn level_word(level: bool) -> u32 {
        // The register's upper half resets pins.
        1 << if level { PIN } else { PIN + 16 }
    }

    /// Drives the pin, initially high, or releases it.
    pub(crate) fn drive_pin(on: bool) {
        PORT.bsrr().write(|w| w.set_bs(PIN, true));
        let mode = if on { Moder::OUTPUT } else { Moder::ALTERNATE };
        PORT.moder().modify(|w| w.set_moder(PIN, mode));
    }
}

parts! {
    throttle: PA15 at TIM2 Ch1,
    executor: USART3,
    edges: DMA1_CH4 DMA1_CH5,
    replies: TIM3 DMA1_CH6,
}

/// The gate signals, set up; [`crate::interrupt::start`] takes them.
pub struct Bridge {
    _timer: Peri<'static, TIM1>,
}

/// The two converters, triggered by the PWM timer once per period.
///
/// A conversion takes 12.5 cycles at 42.5 MHz after sampling. The sampling windows, in µs from the counter's
/// top, are below; the end of the first converter's sequence, at 3.3 µs, is the end of both:
///
/// | converter | | | | |
/// |---|---|---|---|---|
/// | first | current a −0.15 to 0.15 | current c 0.44 to 0.74 | terminal c 1.03 to 1.61 | supply 1.90 to 3.02 |
/// | second | current b −0.15 to 0.15 | terminal a 0.44 to 1.02 | terminal b 1.31 to 1.89 | |
///
/// In the 0.59 µs after a and b, c changes by −(e + R·i)/L: 2.4 % of itself in the bench motor at 6000 rpm (virtual
/// board). A third of that is in the current vector. It stays there: a c made of the other two would have none of it,
/// but √2 of the vector's noise. With their sum zero by construction no sensor could be seen to drift, a short in c
/// would be the comparator's alone, and where a phase is off, what its high side's diode carries would be missing in
/// the other two.
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
    /// Opens the line at a rate within the parameter's range.
    pub fn open(self, baud: u32) -> Uart<'static, Async> {
        let mut config = usart::Config::default();
        config.baudrate = chip::hal_baud(baud);
        // Noise on an input without a partner, as with the ST-LINK's half broken off, would be bytes.
        config.rx_pull = Pull::Up;
        let ((rx, tx), (out, into)) = (self.pins, self.dma);
        Uart::new(self.uart, rx, tx, out, into, Interrupts, config)
            .expect("170 MHz divides to every rate of the parameter")
    }
}

/// Baud rate of KISS telemetry.
const KISS_HZ: u32 = 115_200;

/// KISS telemetry, on the pin of Hall sensor a.
pub struct Kiss {
    uart: Peri<'static, USART1>,
    pin: Peri<'static, PB6>,
    dma: Peri<'static, DMA1_CH3>,
}

impl Kiss {
    /// Takes over the Hall sensor's pin: only for a motor without sensors.
    pub fn open(self) -> UartTx<'static, Async> {
        let mut config = usart::Config::default();
        config.baudrate = chip::hal_baud(KISS_HZ);
        // A sensor on this pin is an open collector, and would short a high output. With 100 pF of wire the chip's
        // pull-up of 40 kΩ alone (data sheet, I/O static characteristics) is half up after 2.8 µs, of a bit's 8.7 µs.
        config.tx_config = usart::OutputConfig::OpenDrainPullUp;
        UartTx::new(self.uart, self.pin, self.dma, Interrupts, config)
            .expect("170 MHz divides to 115200 baud")
    }
}

/// Board temperature sensor.
pub struct Temperature {
    reading: converters::Reading,
}

impl Temperature {
    /// Returns the thermistor's reading, for [`NTC`], after waiting some 8 µs. `periods` counts the control
    /// periods.
    pub fn read(&mut self, periods: fn() -> u32) -> AdcCounts {
        AdcCounts::from_num(self.reading.counts(periods))
    }
}

impl Hardware {
    /// Starts the chip, and sets up pins, op-amps, comparators and converters. The gate signals are low until
    /// the timer drives them. Call it once.
    #[inline(never)] // its stack is free for what comes next
    pub fn claim() -> Self {
        let p = chip::start();
        // Before any interrupt is used: critical sections rely on it.
        priority::lower_all(chip::INTERRUPTS);
        rcc::enable_and_reset::<TIM1>();
        // A debugger halt then stops the timer too, and the bridge is off.
        pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
        comparators::set_up(TRIP.level(RATING_A));
        chip::break_on_lock_up();

        pins::set_up(&PINS);
        // Op-amp 3's internal output leads to the second converter, which samples b at that time.
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

/// Waits 1 ms for the amplifiers to settle, before the interrupt takes over.
pub(crate) fn prepare(_bridge: Bridge, _converters: Converters) {
    cortex_m::asm::delay(TIMER_HZ / 1000);
}

/// Sets the comparators' level for a phase current limit, peak A.
pub(crate) fn set_trip(phase_a: f32) {
    comparators::set_level(TRIP.level(phase_a));
}

/// nBOOT0 and nSWBOOT0 in the option bytes (RM0440, FLASH_OPTR): with the first set and the second clear the
/// chip boots from flash whatever the level of PB8 (BOOT0), which is a Hall sensor input here.
const BOOT_OPTIONS: (u32, u32) = (1 << 27, 1 << 26);

/// Measures this board's own self-test items. Full scale and the slow oscillator are not measured.
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
