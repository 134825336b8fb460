//! VESC 4.10 class: STM32F405, gate driver DRV8302, two low-side shunts.
//!
//! Phases a, b, c of the control are timer channels 1, 3 and 2: the shunts are in a and b (the VESC firmware
//! drives two-shunt boards in this order).
//!
//! A DRV8302 has no SPI. Six inputs or three, its over-current threshold, whether it then limits or shuts down,
//! and the amplifiers' gain are set by straps (SLES267, pins M_PWM, OC_ADJ, M_OC, GAIN), which makers of this
//! class of boards choose differently. So nothing here relies on its limiter: the control's own trip bounds the
//! current. nFAULT reports whatever has shut the driver down: gate supply undervoltage, over-temperature, and
//! over-current if strapped so.

use core::mem;

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel, Exten, InjectedAdc, SampleTime};
use embassy_stm32::gpio::{Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{
    ADC1, ADC2, ADC3, DMA1_CH1, DMA1_CH3, DMA1_CH4, DMA1_CH5, DMA2_CH2, DMA2_CH6, IWDG, PB5, PB10,
    PC6, PC7, TIM1, TIM3, TIM6, USART3, USART6,
};
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{Ch1, Ch2, Dma, UpDma};
use embassy_stm32::usart::{self, Uart, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, interrupt, pac, rcc, triggers};
use siskin_control::check::{Item, Own};
use siskin_units::AdcCounts;

use super::parts::parts;
use super::wiring::{GateDriverPins, Slot, Wiring};
use crate::chip::{self, capture};
use crate::circuit::vesc4_f405::ZERO_COUNTS;
use crate::hall;
use crate::priority;
use crate::storage::Storage;

pub use crate::chip::TIMER_HZ;
pub use crate::circuit::vesc4_f405::{BOARD, NAME, NTC};

/// Sampling time of the phase currents: 15 cycles of the converters' 21 MHz, in clocks of the 168 MHz timer.
pub(crate) const SAMPLING_CLOCKS: u16 = 120;

/// Nothing breaks the PWM: nFAULT is at PC12, and the timer's break at PA6 and PB12 only (DS8626, alternate
/// functions).
pub(crate) const BREAKS: bool = false;

/// KISS telemetry has a pin of its own.
pub(crate) const KISS_TAKES_A_SENSOR: bool = false;

/// Pins on port C.
pub(crate) const GATE_DRIVER: Option<GateDriverPins> = Some(GateDriverPins {
    enable: 10,
    fault: 12,
});

/// The phases, from 0, on timer channels 1, 2, 3.
pub(crate) const PHASES: [usize; 3] = [0, 2, 1];

/// Slots refer to the sequences in [`Hardware::claim`].
pub(crate) const WIRING: Wiring = Wiring {
    currents: [Some(Slot(0, 0)), Some(Slot(1, 0)), None],
    zero: ZERO_COUNTS,
    // As in the VESC firmware.
    rises: true,
    terminals: [Slot(0, 1), Slot(1, 1), Slot(1, 2)],
    bus: Slot(0, 2),
    // The second and third are swapped like the phases. As in the VESC firmware from the 4.5 on (`hw_45.h` to
    // `hw_410.h`); the 4.0 had the third at PB8.
    hall: hall::Pins([hall::Pin::B(6), hall::Pin::C(11), hall::Pin::B(7)]),
};

bind_interrupts!(struct Interrupts {
    USART6 => usart::InterruptHandler<USART6>;
    DMA1_STREAM1 => dma::InterruptHandler<DMA1_CH1>;
    DMA1_STREAM3 => dma::InterruptHandler<DMA1_CH3>;
    DMA1_STREAM4 => dma::InterruptHandler<DMA1_CH4>;
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
    DMA2_STREAM2 => dma::InterruptHandler<DMA2_CH2>;
    DMA2_STREAM6 => dma::InterruptHandler<DMA2_CH6>;
});

/// Timers and pin of the throttle wire.
pub(crate) mod wire {
    use embassy_stm32::pac;
    use embassy_stm32::pac::timer::regs::CcerGp16;
    use embassy_stm32::pac::timer::vals::{CcmrOutputCcs, Ocm};
    use embassy_stm32::pac::timer::{TimGp16, TimGp32};
    use embassy_stm32::peripherals::{TIM3, TIM6};

    use super::capture;

    /// Captures edges.
    pub(crate) type CaptureTimer = TIM3;
    /// Its registers.
    // SAFETY: the same block; the upper halves of its words, which only this view has, read as zeros.
    pub(crate) const CAPTURE: TimGp32 = unsafe { TimGp32::from_ptr(pac::TIM3.as_ptr()) };
    /// Width of its counter, bits.
    pub(crate) const TIMER_BITS: u32 = 16;
    /// Divider of its clock: 16 bits last 3.1 ms.
    pub(crate) const PRESCALER: u16 = 4;
    /// Its tick rate.
    pub(crate) const TICK_HZ: u32 = super::TIMER_HZ / 2 / PRESCALER as u32;
    /// Its channel at the pin, from 0.
    pub(crate) const SIGNAL_CHANNEL: usize = 1;
    /// Paces replies: of the timers whose update DMA1 serves, one without channels.
    pub(crate) type PaceTimer = TIM6;
    /// Its registers.
    // SAFETY: the same block; this view has the part common to all timers.
    pub(crate) const PACE: TimGp16 = unsafe { TimGp16::from_ptr(pac::TIM6.as_ptr()) };
    /// Its clock rate.
    pub(crate) const PACE_HZ: u32 = super::TIMER_HZ / 2;

    /// Returns the register that the DMA writes while the pin is driven: the capture timer's CCER.
    ///
    /// Not a port's register: only DMA2 reaches the ports, and serving an AHB peripheral alongside one on APB2,
    /// as the serial line is, corrupts data (ES0182, 2.1.10). DMA1 cannot reach a port at all, and its
    /// transfers to timers are what the HAL's types allow for this one.
    pub(crate) fn level_register() -> *mut u32 {
        CAPTURE.ccer().as_ptr().cast()
    }

    /// Returns the word that sets the pin to a level: the channel's output is forced active, and inverting its
    /// polarity, otherwise used to capture falling edges, makes that low. The other channel keeps running.
    pub(crate) fn level_word(level: bool) -> u32 {
        let mut enable = CcerGp16(0);
        enable.set_cce(0, true);
        enable.set_cce(SIGNAL_CHANNEL, true);
        enable.set_ccp(SIGNAL_CHANNEL, !level);
        enable.0
    }

    /// Drives the pin, initially high, or releases it and captures its edges.
    pub(crate) fn drive_pin(on: bool) {
        // A channel's direction may only change while it is off (RM0090, 18.4.7).
        CAPTURE.ccer().modify(|w| w.set_cce(SIGNAL_CHANNEL, false));
        if on {
            CAPTURE.ccmr_output(0).modify(|w| {
                w.set_ccs(SIGNAL_CHANNEL, CcmrOutputCcs::OUTPUT);
                w.set_ocm(SIGNAL_CHANNEL, Ocm::FORCE_ACTIVE);
            });
        } else {
            capture::capture_on(CAPTURE, SIGNAL_CHANNEL, SIGNAL_CHANNEL);
        }
        CAPTURE.ccer().write_value(CcerGp16(level_word(on)));
    }
}

parts! {
    throttle: PB5 at TIM3 Ch2,
    executor: CAN2_SCE,
    edges: DMA1_CH4 DMA1_CH5,
    replies: TIM6 DMA1_CH1,
}

/// The gate signals, set up; [`crate::interrupt::start`] takes them.
pub struct Bridge {
    _timer: Peri<'static, TIM1>,
    enable: Output<'static>,
    _fault: Input<'static>,
}

/// The two converters, triggered by the PWM timer once per period.
///
/// A reading takes 15 cycles at 21 MHz of sampling and 12 of conversion, 1.29 µs. The sampling windows, in µs
/// from the counter's top, are below; both sequences end at 3.5 µs:
///
/// | converter | | | |
/// |---|---|---|---|
/// | first | current a −0.36 to 0.36 | terminal a 0.93 to 1.64 | supply 2.21 to 2.93 |
/// | second | current b −0.36 to 0.36 | terminal b 0.93 to 1.64 | terminal c 2.21 to 2.93 |
pub struct Converters {
    _first: InjectedAdc<'static, ADC1, 3>,
    _second: InjectedAdc<'static, ADC2, 3>,
}

/// MAVLink's serial line.
pub struct Mavlink {
    uart: Peri<'static, USART6>,
    pins: (Peri<'static, PC7>, Peri<'static, PC6>),
    dma: (Peri<'static, DMA2_CH6>, Peri<'static, DMA2_CH2>),
}

impl Mavlink {
    /// Opens the line at a rate within the parameter's range.
    pub fn open(self, baud: u32) -> Uart<'static, Async> {
        let mut config = usart::Config::default();
        config.baudrate = baud;
        // Noise on an input with nothing plugged in would be bytes.
        config.rx_pull = Pull::Up;
        let ((rx, tx), (out, into)) = (self.pins, self.dma);
        Uart::new(self.uart, rx, tx, out, into, Interrupts, config)
            .expect("84 MHz divides to every rate of the parameter")
    }
}

/// KISS telemetry, on its own pin.
pub struct Kiss {
    uart: Peri<'static, USART3>,
    pin: Peri<'static, PB10>,
    dma: Peri<'static, DMA1_CH3>,
}

impl Kiss {
    /// Opens the line.
    pub fn open(self) -> UartTx<'static, Async> {
        let config = usart::Config::default();
        UartTx::new(self.uart, self.pin, self.dma, Interrupts, config)
            .expect("42 MHz divides to 115200 baud")
    }
}

/// Transistor temperature sensor.
pub struct Temperature {
    converter: Adc<'static, ADC3>,
    pin: AnyAdcChannel<'static, ADC3>,
}

impl Temperature {
    /// Returns the thermistor's reading, for [`NTC`], after waiting 10 µs.
    pub fn read(&mut self, _periods: fn() -> u32) -> AdcCounts {
        let counts = self
            .converter
            .blocking_read(&mut self.pin, SampleTime::CYCLES144);
        AdcCounts::from_num(counts)
    }
}

impl Hardware {
    /// Starts the chip, and sets up pins and converters. The gate driver stays off. Call it once.
    #[inline(never)] // its stack is free for what comes next
    pub fn claim() -> Self {
        let p = chip::start();
        // Before any interrupt is used: critical sections rely on it.
        priority::lower_all(chip::INTERRUPTS);
        let enable = Output::new(p.PC10, Level::Low, Speed::Low);
        rcc::enable_and_reset::<TIM1>();
        // A debugger halt then stops the timer too, and the bridge is off.
        pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));

        // The pull-down keeps the gates off while nothing drives the pin.
        let gate = PwmPinConfig {
            output_type: OutputType::PushPull,
            speed: Speed::VeryHigh,
            pull: Pull::Down,
        };
        // Dropping a pin would release it: these stay the timer's for good.
        mem::forget((
            PwmPin::<TIM1, _>::new_with_config(p.PA8, gate),
            ComplementaryPwmPin::<TIM1, _>::new_with_config(p.PB13, gate),
            PwmPin::<TIM1, _>::new_with_config(p.PA9, gate),
            ComplementaryPwmPin::<TIM1, _>::new_with_config(p.PB14, gate),
            PwmPin::<TIM1, _>::new_with_config(p.PA10, gate),
            ComplementaryPwmPin::<TIM1, _>::new_with_config(p.PB15, gate),
        ));
        // Hall sensors are open-collector; without them the pull-ups read 7.
        mem::forget((
            Input::new(p.PB6, Pull::Up),
            Input::new(p.PB7, Pull::Up),
            Input::new(p.PC11, Pull::Up),
        ));
        // The amplifiers measure: calibration mode is off.
        mem::forget(Output::new(p.PB12, Level::Low, Speed::Low));

        let long = SampleTime::CYCLES15;
        let first = [
            (p.PB1.degrade_adc(), long),
            (p.PA2.degrade_adc(), long),
            (p.PC2.degrade_adc(), long),
        ];
        let second = [
            (p.PB0.degrade_adc(), long),
            (p.PA0.degrade_adc(), long),
            (p.PA1.degrade_adc(), long),
        ];
        let converters = Converters {
            _second: Adc::new(p.ADC2).setup_injected_conversions(
                second,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                false,
            ),
            _first: Adc::new(p.ADC1).setup_injected_conversions(
                first,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                true,
            ),
        };
        Self {
            bridge: Bridge {
                _timer: p.TIM1,
                enable,
                _fault: Input::new(p.PC12, Pull::Up),
            },
            converters,
            light: Output::new(p.PC4, Level::Low, Speed::Low),
            throttle: Throttle {
                pin: p.PB5,
                _timers: (p.TIM3, p.TIM6),
                rising: p.DMA1_CH4,
                falling: p.DMA1_CH5,
                reply: p.DMA1_CH1,
            },
            mavlink: Mavlink {
                uart: p.USART6,
                pins: (p.PC7, p.PC6),
                dma: (p.DMA2_CH6, p.DMA2_CH2),
            },
            kiss: Kiss {
                uart: p.USART3,
                pin: p.PB10,
                dma: p.DMA1_CH3,
            },
            flash: Storage::new(p.FLASH),
            watchdog: p.IWDG,
            temperature: Temperature {
                converter: Adc::new(p.ADC3),
                pin: p.PA3.degrade_adc(),
            },
        }
    }
}

/// Enables the gate driver and waits 20 ms, before the interrupt takes over: the driver takes up to 10 ms, and
/// its amplifiers must settle before their zeros are measured.
pub(crate) fn prepare(mut bridge: Bridge, converters: Converters) {
    bridge.enable.set_high();
    mem::forget((bridge, converters));
    cortex_m::asm::delay(TIMER_HZ / 50);
}

/// Does nothing: no hardware trip has an adjustable level.
pub(crate) fn set_trip(_phase_a: f32) {}

/// Measures nothing: this board has neither comparators nor such option bytes.
pub(crate) fn own(_item: Item) -> Own {
    Own::Absent
}
