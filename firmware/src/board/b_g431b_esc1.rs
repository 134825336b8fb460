//! B-G431B-ESC1: STM32G431CB, three low-side shunts through the chip's own op-amps, 6S, 40 A peak.
//!
//! Phases U, V, W of the board are a, b, c of the control.

use core::mem;

use embassy_stm32::adc::{Adc, AdcChannel, AdcConfig, Exten, InjectedAdc, SampleTime};
use embassy_stm32::gpio::{Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::opamp::{OpAmp, OpAmpGain, OpAmpSpeed};
use embassy_stm32::peripherals::{ADC1, ADC2, OPAMP1, OPAMP2, OPAMP3};
use embassy_stm32::rcc::{Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux::Adcsel};
use embassy_stm32::timer::complementary_pwm::ComplementaryPwmPin;
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::{Config, Peripherals, pac, triggers};
use siskin_control::control::delay::Delay;
use siskin_control::control::sensing::Shunts;
use siskin_control::image::Image;
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

/// From a terminal to the converter, while PB5 holds the lower resistors at ground: it ends at
/// 18.3 V.
const TERMINAL_DIVIDER: f32 = 2.2 / (2.2 + 10.0);

/// For how long the phase currents are sampled: 12.5 cycles of the converters' 42.5 MHz, in
/// clocks of the timer's 170 MHz. 0.29 µs, above the 0.2 µs that an op-amp's output needs.
pub(crate) const SAMPLING_CLOCKS: u16 = 50;

/// What the control must know of this board.
pub(crate) const BOARD: Board = Board {
    image: Image {
        board: "b-g431b-esc1",
        board_number: 1,
        build: [0; 8],
        serial: [0; 12],
    },
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * SHUNT_GAIN),
    bus_v_per_count: V_PER_COUNT / BUS_DIVIDER,
    terminal_v_per_count: V_PER_COUNT / TERMINAL_DIVIDER,
    shunts: Shunts::Three,
    // The board's rating. The converter shows more: ±60 A about the middle of its range.
    current_range_a: 40.0,
    // The duties computed in one period are applied from the next counter's top on.
    delay: Delay::One,
    // The first sampling window is centred on the counter's top, so half of it (0.15 µs) and 1 µs
    // for the amplifier to settle must fit before the top: an estimate until it is measured.
    low_side_on_s: 2.3e-6,
    // The MOSFETs' gates take up to 80 nC a period, which the L6387 gives back to the bootstrap
    // capacitor through 125 Ω while the low side is on: 3 V less of gate supply with this, in a
    // phase that stays at the greatest duty. It also leaves 2.15 µs after the top with the default
    // dead time, by when the terminals have been sampled.
    refresh_s: 3.3e-6,
    // Five time constants of 125 Ω and 100 nF.
    charge_s: 63e-6,
};

/// The two converters, which the PWM timer triggers once a period, and the Hall sensors' pins.
///
/// A conversion takes 12.5 cycles of 42.5 MHz after its sampling. The sampling windows begin at
/// these times from the counter's top, in µs, and the end of the first converter's sequence is the
/// end of both, at 3.3 µs:
///
/// | converter | | | | |
/// |---|---|---|---|---|
/// | first | current a −0.15 to 0.15 | current c 0.44 to 0.74 | terminal c 1.03 to 1.61 | supply 1.90 to 3.02 |
/// | second | current b −0.15 to 0.15 | terminal a 0.44 to 1.02 | terminal b 1.31 to 1.89 | |
pub(crate) struct Converters {
    /// Phases a and c, terminal c, the supply.
    pub(crate) first: InjectedAdc<'static, ADC1, 4>,
    /// Phase b, terminals a and b.
    pub(crate) second: InjectedAdc<'static, ADC2, 3>,
    /// Hall sensors a, b, c.
    pub(crate) hall: [Input<'static>; 3],
}

/// The parts of the board, set up.
pub(crate) struct Hardware {
    /// Gate signals.
    pub(crate) bridge: BridgePins,
    /// Currents, voltages and Hall sensors.
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
        // This one's internal way leads to the second converter, which has b at that time.
        let mut c_out = p.PB1;
        c.pga_ext(p.PB0, c_out.reborrow(), OpAmpGain::Mul16);
        let c = c_out.degrade_adc();
        // A dropped output turns its op-amp off, and `degrade_adc` drops what it is given
        // (embassy-stm32 0.6).
        for amplifier in [pac::OPAMP1, pac::OPAMP2, pac::OPAMP3] {
            amplifier.csr().modify(|w| w.set_opampen(true));
        }

        // Low, it is the ground of the terminals' dividers. A dropped pin would be given back.
        mem::forget(Output::new(p.PB5, Level::Low, Speed::Low));

        // The supply's divider has 16 kΩ and is sampled longer than the terminals' with 1.8 kΩ.
        let first = [
            (a, SampleTime::CYCLES12_5),
            (c, SampleTime::CYCLES12_5),
            (p.PB11.degrade_adc(), SampleTime::CYCLES24_5),
            (p.PA0.degrade_adc(), SampleTime::CYCLES47_5),
        ];
        let second = [
            (b, SampleTime::CYCLES12_5),
            (p.PA4.degrade_adc(), SampleTime::CYCLES24_5),
            (p.PC4.degrade_adc(), SampleTime::CYCLES24_5),
        ];
        let converters = Converters {
            second: Adc::new(p.ADC2, AdcConfig::default()).setup_injected_conversions(
                second,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                false,
            ),
            first: Adc::new(p.ADC1, AdcConfig::default()).setup_injected_conversions(
                first,
                triggers::TIM1_TRGO,
                Exten::RISING_EDGE,
                true,
            ),
            // Open collectors; without sensors the pulls read 7.
            hall: [
                Input::new(p.PB6, Pull::Up),
                Input::new(p.PB7, Pull::Up),
                Input::new(p.PB8, Pull::Up),
            ],
        };

        Self {
            bridge,
            converters,
            light: Output::new(p.PC6, Level::Low, Speed::Low),
        }
    }
}
