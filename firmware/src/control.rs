//! The interrupt at the end of the injected conversions, once a PWM period: sample, `step`, bridge.
//!
//! It alone has priority 0. It takes no critical section, does not log and calls no driver that
//! does. Critical sections of the tasks still mask it, for microseconds: they use PRIMASK.

use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use siskin_control::drive::{Config, State, step};

use crate::exchange::{InterruptCell, InterruptEnd};
use crate::panic::{Failure, fail};
use crate::pwm::Pwm;
use crate::sense::Sensors;

/// Priority of every interrupt but this one.
const PRIORITY_OF_OTHERS: Priority = Priority::P8;

/// External interrupts of the STM32G431 (its reference manual, vector table).
const INTERRUPTS: usize = 102;

static CONTROL: InterruptCell<Control> = InterruptCell::new();

/// Everything that the interrupt owns.
pub(crate) struct Control {
    config: Config,
    state: State,
    pwm: Pwm,
    sensors: Sensors,
    end: InterruptEnd,
}

impl Control {
    /// A control at power-up.
    pub(crate) fn new(config: Config, pwm: Pwm, sensors: Sensors, end: InterruptEnd) -> Self {
        let state = State::new(&config);
        Self {
            config,
            state,
            pwm,
            sensors,
            end,
        }
    }

    /// One control period.
    fn run(&mut self) {
        self.pwm.commutate();
        let sample = self.sensors.sample();
        let setpoint = self.end.setpoint();
        let bridge = step(&self.config, &mut self.state, sample, setpoint);
        self.pwm.apply(bridge);
        self.end.publish(self.state.snapshot());
        if self.sensors.converted() {
            // The next sample came before this one was done with: the processor is too slow for
            // this PWM frequency, and every duty would be late.
            fail(Failure::Overrun, 0, 0);
        }
    }
}

/// Lowers the priority of every interrupt. embassy leaves those that it enables, the clock's and
/// the DMA's, at 0; later ones are covered too, since every line is.
pub(crate) fn lower_all_interrupts() {
    for line in 0..INTERRUPTS {
        // SAFETY: one byte of the NVIC's priorities, below the 240 that the architecture has; no
        // critical section relies on priorities (they use PRIMASK).
        unsafe { (*cortex_m::peripheral::NVIC::PTR).ipr[line].write(PRIORITY_OF_OTHERS.into()) }
    }
}

/// Starts the PWM and, with it, the interrupt.
pub(crate) fn start(mut control: Control) {
    control.pwm.start();
    assert!(CONTROL.put(control), "the control is started once");
    interrupt::ADC1_2.set_priority(Priority::P0);
    // SAFETY: what the interrupt needs is in place, and no critical section relies on its being
    // masked by the NVIC.
    unsafe { interrupt::ADC1_2.enable() };
}

#[interrupt]
fn ADC1_2() {
    CONTROL.with(Control::run);
}
