//! B-G431B-ESC1: STM32G431CB, three low-side shunts through the chip's own op-amps, 6S, 40 A peak.
//!
//! Phases U, V, W of the board are a, b, c of the control.

use embassy_stm32::adc::{Adc, AdcChannel, AdcConfig, Exten, InjectedAdc, SampleTime};
use embassy_stm32::gpio::{Level, Output, OutputType, Pull, Speed};
use embassy_stm32::opamp::{OpAmp, OpAmpGain, OpAmpSpeed};
use embassy_stm32::peripherals::{ADC1, ADC2, OPAMP1, OPAMP2, OPAMP3};
use embassy_stm32::rcc::{Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux::Adcsel};
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::{Config, Peripherals, pac, triggers};
use siskin_control::control::delay::Delay;
use siskin_control::params::Board;
use static_cell::StaticCell;

use crate::pwm::BridgePins;

/// Volts of one count: 12 bits of the 3.3 V supply.
const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Each phase's shunt in the low side.
const SHUNT_OHM: f32 = 0.003;

/// From the shunt to the converter: the resistors' 4/7 and the op-amp's 16.
const SHUNT_GAIN: f32 = 64.0 / 7.0;

/// From the supply to the converter.
const BUS_DIVIDER: f32 = 18.0 / (18.0 + 169.0);

/// For how long the phase currents are sampled: 12.5 cycles of the converters' 42.5 MHz, in
/// clocks of the timer's 170 MHz. 0.29 µs, above the 0.2 µs that an op-amp's output needs.
pub(crate) const SAMPLING_CLOCKS: u16 = 50;

/// What the control must know of this board.
pub(crate) const BOARD: Board = Board {
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * SHUNT_GAIN),
    bus_v_per_count: V_PER_COUNT / BUS_DIVIDER,
    // The board's rating. The converter shows more: ±60 A about the middle of its range.
    current_range_a: 40.0,
    // The duties computed in one period are applied from the next counter's top on.
    delay: Delay::One,
    // The first sampling window is centred on the counter's top, so half of it (0.15 µs), the
    // default dead time (0.5 µs) and 1 µs for the amplifier to settle must fit before the top: an
    // estimate until it is measured. After the top phase c is done in 0.73 µs.
    low_side_on_s: 3.3e-6,
};

/// The two converters, which the PWM timer triggers once a period.
pub(crate) struct Converters {
    /// Phase a, then the supply. Its sequence is the longer one: its end is the end of both.
    pub(crate) a_bus: InjectedAdc<'static, ADC1, 2>,
    /// Phase b, then c.
    pub(crate) b_c: InjectedAdc<'static, ADC2, 2>,
}

/// The parts of the board, set up.
pub(crate) struct Hardware {
    /// Gate signals.
    pub(crate) bridge: BridgePins,
    /// Currents and supply.
    pub(crate) converters: Converters,
    /// The LED.
    pub(crate) light: Output<'static>,
}

/// 170 MHz from the internal 16 MHz: sources disagree on the crystal's frequency.
pub(crate) fn clock() -> Config {
    let mut config = Config::default();
    config.rcc.hsi = true;
    config.rcc.pll = Some(Pll {
        source: PllSource::HSI,
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.adc12sel = Adcsel::SYS;
    config
}

impl Hardware {
    /// Sets up the pins, the op-amps and the converters. The gate signals are low until the timer
    /// drives them.
    pub(crate) fn claim(p: Peripherals) -> Self {
        // The pull keeps the gates off while nothing drives the pin.
        let gate = PwmPinConfig {
            output_type: OutputType::PushPull,
            speed: Speed::VeryHigh,
            pull: Pull::Down,
        };
        let bridge = BridgePins {
            timer: p.TIM1,
            a: (
                PwmPin::new_with_config(p.PA8, gate),
                ComplementaryPwmPin::new_with_config(p.PC13, gate),
            ),
            b: (
                PwmPin::new_with_config(p.PA9, gate),
                ComplementaryPwmPin::new_with_config(p.PA12, gate),
            ),
            c: (
                PwmPin::new_with_config(p.PA10, gate),
                ComplementaryPwmPin::new_with_config(p.PB15, gate),
            ),
        };

        static AMPLIFIER_A: StaticCell<OpAmp<'static, OPAMP1>> = StaticCell::new();
        static AMPLIFIER_B: StaticCell<OpAmp<'static, OPAMP2>> = StaticCell::new();
        static AMPLIFIER_C: StaticCell<OpAmp<'static, OPAMP3>> = StaticCell::new();
        let fast = OpAmpSpeed::HighSpeed;
        let a = AMPLIFIER_A.init(OpAmp::new(p.OPAMP1, fast));
        let b = AMPLIFIER_B.init(OpAmp::new(p.OPAMP2, fast));
        let c = AMPLIFIER_C.init(OpAmp::new(p.OPAMP3, fast));
        let a = a.pga_int(p.PA1, OpAmpGain::Mul16).degrade_adc();
        let b = b.pga_int(p.PA7, OpAmpGain::Mul16).degrade_adc();
        let c = c.pga_int(p.PB0, OpAmpGain::Mul16).degrade_adc();
        // `degrade_adc` drops the output that it is given, and a dropped output turns its op-amp
        // off (embassy-stm32 0.6).
        for amplifier in [pac::OPAMP1, pac::OPAMP2, pac::OPAMP3] {
            amplifier.csr().modify(|w| w.set_opampen(true));
        }

        // The supply's divider has 16 kΩ and is sampled longer.
        let a_bus = [
            (a, SampleTime::CYCLES12_5),
            (p.PA0.degrade_adc(), SampleTime::CYCLES47_5),
        ];
        let b_c = [(b, SampleTime::CYCLES12_5), (c, SampleTime::CYCLES12_5)];
        let converters = Converters {
            b_c: Adc::new(p.ADC2, AdcConfig::default()).setup_injected_conversions(
                b_c,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                false,
            ),
            a_bus: Adc::new(p.ADC1, AdcConfig::default()).setup_injected_conversions(
                a_bus,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                true,
            ),
        };

        Self {
            bridge,
            converters,
            light: Output::new(p.PC6, Level::Low, Speed::Low),
        }
    }
}
