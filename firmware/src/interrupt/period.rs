//! One control period.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use siskin_control::drive::{Bridge, Config, Fault, Setpoint, State, step};
use siskin_control::record::{self, Record};

use super::gate_driver::GateDriver;
use super::overruns::Overruns;
use super::publication::Publication;
use super::pwm::Pwm;
use super::registers::Registers;
use super::sample::sample;
use super::timing::Timing;
use crate::chip::{self, TIMER_HZ};
use crate::exchange::RunningEnd;

static PERIODS: AtomicU32 = AtomicU32::new(0);

/// Periods after too many overruns in which the control does nothing, with the bridge off: the tasks have most of the
/// processor, however long a period of the control takes.
const RESPITE_PERIODS: u8 = 16;

/// In memory that start-up does not clear. On the G431 it would go in the CCM, close to its writer and clear of
/// DMA traffic: the SRAM is for the tasks and the stack.
#[unsafe(link_section = ".fault_record")]
static RECORD: Record = Record::new();

/// Returns the control periods since start-up, wrapping; while it counts, the interrupt is alive.
pub fn periods() -> u32 {
    PERIODS.load(Ordering::Relaxed)
}

/// Returns the fault record, which this interrupt writes.
pub fn record() -> &'static Record {
    &RECORD
}

/// Everything the interrupt owns.
pub struct Interrupt {
    registers: Registers,
    pwm: Pwm,
    gate_driver: GateDriver,
    state: State,
    end: RunningEnd,
    /// A fault that this interrupt has found, for the control in the next period.
    found: Option<Fault>,
    /// The set-point of a period with such a fault, or after a hardware trip: the control handles it like a fault that
    /// it finds itself.
    trip: Setpoint,
    overruns: Overruns,
    /// Periods for which the control still does nothing.
    respite: u8,
    publication: Publication,
}

impl Interrupt {
    /// Creates the interrupt at power-up, with the timer set up and all switches off.
    pub fn new(registers: Registers, end: RunningEnd) -> Self {
        Self {
            registers,
            pwm: end.with_config(|config| Pwm::new(registers.timer, Timing::new(config, TIMER_HZ))),
            gate_driver: GateDriver::new(registers.port_c),
            state: end.with_config(State::new),
            found: None,
            trip: Setpoint::Fault(Fault::OverCurrent),
            overruns: Overruns::default(),
            respite: 0,
            publication: end.with_config(|config| Publication::new(config.scale.period_s)),
            end,
        }
    }

    /// Starts the PWM.
    pub(super) fn begin(&mut self) {
        self.pwm.start();
    }

    /// Runs one control period.
    #[inline(always)] // in each period
    pub fn run(&mut self) {
        chip::acknowledge(&self.registers.converters);
        if chip::flash::is_writing() {
            self.hold();
        } else {
            self.control();
        }
    }

    /// Handles a period while the flash is written and nothing can be fetched from it: the bridge, at rest
    /// before, is off. A hardware alarm meanwhile is reported in the first period afterwards.
    #[cold]
    #[inline(never)] // only some periods
    fn hold(&mut self) {
        self.pwm.commutate();
        self.pwm.off();
        if !self.gate_driver.ready() {
            self.found = Some(Fault::OverCurrent);
        }
        count(&PERIODS);
    }

    /// Handles any other period.
    #[inline(never)] // the tests count its instructions
    fn control(&mut self) {
        self.pwm.commutate();
        self.end.listen();
        self.adopt();
        let tripped = self.pwm.broken() || !self.gate_driver.ready() || self.found.is_some();
        if tripped && !self.trip() {
            return;
        }
        // By reference: a set-point built here would be copied through registers, field by field.
        let setpoint = *if tripped {
            &self.trip
        } else {
            self.end.setpoint()
        };
        let sample = sample(&self.registers);
        let state = &mut self.state;
        let phase = state.phase();
        let bridge = self
            .end
            .with_config(|config| step(config, state, sample, setpoint));
        self.pwm.apply(bridge);
        let period = count(&PERIODS);
        if record::KEPT {
            let state = &self.state;
            self.end
                .with_config(|config| RECORD.note(config, state, (&sample, &bridge), period));
        }
        let Self { state, pwm, .. } = self;
        if self
            .publication
            .is_now(|| state.has_done_little(phase) && !pwm.is_deferred())
        {
            self.publish();
        }
        if NVIC::is_pending(chip::CONVERTED) && self.overruns.note(period) {
            self.give_up();
        }
    }

    /// Prepares the set-point of a period with a fault; returns false if the control has a respite. A break that comes with
    /// another fault waits for its own period.
    #[cold]
    #[inline(never)] // only some periods
    fn trip(&mut self) -> bool {
        if self.respite > 0 {
            self.respite -= 1;
            count(&PERIODS);
            return false;
        }
        let fault = self.found.take().unwrap_or_else(|| {
            self.pwm.clear_break();
            Fault::OverCurrent
        });
        self.trip = Setpoint::Fault(fault);
        true
    }

    /// Every duty comes late: turns the bridge off at once, which the control hears of after its respite.
    #[cold]
    #[inline(never)] // only where periods are too long
    fn give_up(&mut self) {
        self.pwm.apply(Bridge::Off);
        self.found = Some(Fault::Overrun);
        self.respite = RESPITE_PERIODS;
    }

    #[inline(never)] // only some periods
    fn publish(&mut self) {
        self.end.publish(self.state.snapshot());
    }

    /// Switches to an offered configuration, if any.
    #[inline(always)] // in each period
    fn adopt(&mut self) {
        let Self { state, end, .. } = self;
        end.adopt(|before, now| adopt(state, before, now));
    }
}

#[cold]
#[inline(never)] // only some periods
fn adopt(state: &mut State, before: &Config, now: &Config) {
    state.adopt(before, now);
}

/// Increments a counter and returns its previous value. With a single writer it need not be atomic.
#[inline(always)] // in each period
fn count(counter: &AtomicU32) -> u32 {
    let before = counter.load(Ordering::Relaxed);
    counter.store(before.wrapping_add(1), Ordering::Relaxed);
    before
}
