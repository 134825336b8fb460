//! A single converter.

use stm32_metapac::adc::regs::{Cfgr, Cr, Ier, Isr, Jsqr, Smpr, Smpr2, Sqr1};
use stm32_metapac::adc::vals::{Adstp, Exten, SampleTime};

use crate::chip::Unmodelled;
use crate::time::{self, Cycles, NEVER};

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const CFGR: u32 = 0x0c;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const SQR1: u32 = 0x30;
const DR: u32 = 0x40;
const JSQR: u32 = 0x4c;
const JDR1: u32 = 0x80;
const JDR4: u32 = 0x8c;
const DIFSEL: u32 = 0xb0;

/// CFGR after a reset, which the image leaves alone: JSQR without a queue, regular conversions one at a
/// time by the program, right-aligned 12 bits.
const PLAIN: Cfgr = Cfgr(1 << 31);

/// TIM1_TRGO among the injected sequence's triggers (RM0440, ADC1/2 external triggers for injected
/// channels).
const TIM1_TRGO: u8 = 0;

/// The analogue supply, V: the converters' reference.
const SUPPLY_V: f64 = 3.3;
/// Full scale in counts.
const COUNTS: f64 = 4096.0;

/// The regulator's start-up time, ns (data sheet: at most 20 µs).
const REGULATOR_NS: u64 = 20_000;

// In half periods of the converter's clock.

/// The calibration (data sheet).
const CALIBRATION: Cycles = 2 * 116;
/// After calibration, how long the converter must not be enabled (RM0440, calibration).
const AFTER_CALIBRATION: Cycles = 2 * 4;
/// From enabling until ready: one conversion (data sheet), the shortest.
const STABLE: Cycles = 2 * (2 + 12) + 2;
/// From a trigger to the sampling: 1.5 to 2.5 clocks with the asynchronous clock (data sheet, t_LATR); the
/// middle.
const LATENCY: Cycles = 2 * 2;
/// The same if a regular conversion has to be aborted: 2.5 to 3.5 (t_LATRINJ).
const ABORTING_LATENCY: Cycles = 2 * 3;
/// From the end of the sampling to the result.
const CONVERSION: Cycles = 25;

/// What is converted.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Group {
    /// The program's conversion.
    Regular,
    /// An injected rank, from 0.
    Injected(usize),
}

/// What a converter is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Off, or not converting.
    Rest,
    /// Becomes ready then.
    Start(Cycles),
    /// Samples until then.
    Sampling(Group, Cycles),
    /// Converts until then.
    Converting(Group, Cycles),
}

/// A converter.
#[derive(Clone, Debug)]
pub(super) struct Converter {
    flags: Isr,
    enables: Ier,
    control: Cr,
    samplings: (Smpr, Smpr2),
    regular: Sqr1,
    injected: Jsqr,
    data: u16,
    injected_data: [u16; 4],
    phase: Phase,
    regulated_from: Cycles,
    calibrated_at: Option<Cycles>,
    enabled_not_before: Cycles,
    held: u16,
    ignored: u64,
    /// Whether it errs as ES0431 (2.5.8) says, and whether it is about to.
    misleads: bool,
    errs: bool,
}

impl Default for Converter {
    fn default() -> Self {
        let mut control = Cr(0);
        control.set_deeppwd(true);
        Self {
            flags: Isr(0),
            enables: Ier(0),
            control,
            samplings: (Smpr(0), Smpr2(0)),
            regular: Sqr1(0),
            injected: Jsqr(0),
            data: 0,
            injected_data: [0; 4],
            phase: Phase::Rest,
            regulated_from: NEVER,
            calibrated_at: None,
            enabled_not_before: 0,
            held: 0,
            ignored: 0,
            misleads: false,
            errs: false,
        }
    }
}

impl Converter {
    pub(super) fn reset(&mut self) {
        *self = Self {
            misleads: self.misleads,
            ..Self::default()
        };
    }

    /// Makes the first regular conversion after each injected sequence convert channel 0.
    pub(super) fn mislead(&mut self) {
        self.misleads = true;
    }

    pub(super) fn flags(&self) -> u32 {
        self.flags.0
    }

    /// Returns whether a flag requests the interrupt.
    pub(super) fn interrupts(&self) -> bool {
        self.flags.0 & self.enables.0 != 0
    }

    /// Returns whether it is enabled.
    pub(super) fn on(&self) -> bool {
        self.control.aden()
    }

    pub(super) fn injected(&self) -> [u16; 4] {
        self.injected_data
    }

    pub(super) fn ignored(&self) -> u64 {
        self.ignored
    }

    pub(super) fn read(&mut self, offset: u32) -> Result<u32, Unmodelled> {
        Ok(match offset {
            ISR => self.flags.0,
            IER => self.enables.0,
            CR => self.control.0,
            CFGR => PLAIN.0,
            SMPR1 => self.samplings.0.0,
            SMPR2 => self.samplings.1.0,
            SQR1 => self.regular.0,
            DR => {
                self.flags.set_eoc(false);
                self.data.into()
            }
            JSQR => self.injected.0,
            JDR1..=JDR4 => {
                self.flags.set_jeoc(false);
                self.injected_data[(offset - JDR1) as usize / 4].into()
            }
            DIFSEL => 0,
            _ => return Err(Unmodelled),
        })
    }

    /// Writes a register; `clock` is half a converter clock.
    pub(super) fn write(
        &mut self,
        offset: u32,
        value: u32,
        clock: Option<Cycles>,
        now: Cycles,
    ) -> Result<(), Unmodelled> {
        let [regular, injected] = [self.control.adstart(), self.control.jadstart()];
        // What must not change now (RM0440, at each register) may be written with its old value.
        let (locked, was) = match offset {
            CFGR => (true, PLAIN.0),
            SMPR1 => (regular || injected, self.samplings.0.0),
            SMPR2 => (regular || injected, self.samplings.1.0),
            SQR1 => (regular, self.regular.0),
            JSQR => (injected, self.injected.0),
            DIFSEL => (true, 0),
            _ => (false, 0),
        };
        if locked {
            return if value == was {
                Ok(())
            } else {
                Err(Unmodelled)
            };
        }
        match offset {
            ISR => self.flags.0 &= !value,
            IER => {
                // ADRDY to JEOS.
                if value & !0x7f != 0 {
                    return Err(Unmodelled);
                }
                self.enables = Ier(value);
            }
            CR => return self.control(Cr(value), clock.ok_or(Unmodelled)?, now),
            SMPR1 => {
                // Channels 0 to 9, three bits each.
                if value >> 30 != 0 {
                    return Err(Unmodelled);
                }
                self.samplings.0 = Smpr(value);
            }
            SMPR2 => {
                // Channels 10 to 18.
                if value >> 27 != 0 {
                    return Err(Unmodelled);
                }
                self.samplings.1 = Smpr2(value);
            }
            SQR1 => {
                if Sqr1(value).l() != 0 {
                    return Err(Unmodelled);
                }
                self.regular = Sqr1(value);
            }
            JSQR => self.injected = Jsqr(value),
            _ => return Err(Unmodelled),
        }
        Ok(())
    }

    /// Writes CR, whose bits the program sets and, except for the supply's, the converter clears.
    fn control(&mut self, new: Cr, clock: Cycles, now: Cycles) -> Result<(), Unmodelled> {
        let old = self.control;
        // A bit written back as it was read is another order if the converter has cleared it meanwhile:
        // each order must be written alone (RM0440, ADC_CR: zeros have no effect).
        let again = (old.aden() && new.aden())
            || (old.adcal() && new.adcal())
            || (old.adstart() && new.adstart())
            || (old.jadstart() && new.jadstart());
        let unknown =
            again || new.addis() || new.adstp() == Adstp::STOP || new.jadstp() == Adstp::STOP;
        // An enabled converter cannot go without its supply.
        let supplied = new.advregen() && !new.deeppwd();
        if unknown || old.aden() && !supplied {
            return Err(Unmodelled);
        }
        if !supplied {
            self.regulated_from = NEVER;
        } else if self.regulated_from == NEVER {
            self.regulated_from = now + time::of_ns(REGULATOR_NS);
        }
        self.control.set_deeppwd(new.deeppwd());
        self.control.set_advregen(new.advregen());
        self.control.set_adcaldif(new.adcaldif());
        if new.adcal() && !old.adcal() {
            if now < self.regulated_from || old.aden() {
                return Err(Unmodelled);
            }
            self.control.set_adcal(true);
            let end = now + CALIBRATION * clock;
            self.calibrated_at = Some(end);
            self.enabled_not_before = end + AFTER_CALIBRATION * clock;
        }
        if new.aden() && !old.aden() {
            if now < self.regulated_from || now < self.enabled_not_before || new.adcal() {
                return Err(Unmodelled);
            }
            self.control.set_aden(true);
            self.phase = Phase::Start(now + STABLE * clock);
        }
        if new.jadstart() && !old.jadstart() {
            self.arm()?;
        }
        if new.adstart() && !old.adstart() {
            self.ready()?;
            self.control.set_adstart(true);
            if self.phase == Phase::Rest {
                self.sample(Group::Regular, now + LATENCY * clock, clock);
            }
        }
        Ok(())
    }

    /// Starts to wait for triggers.
    fn arm(&mut self) -> Result<(), Unmodelled> {
        self.ready()?;
        let [edge, trigger] = [self.injected.jexten().to_bits(), self.injected.jextsel()];
        if edge != Exten::RISING_EDGE.to_bits() || trigger != TIM1_TRGO {
            return Err(Unmodelled);
        }
        self.control.set_jadstart(true);
        Ok(())
    }

    /// Checks that the converter is enabled and ready, which a conversion needs.
    fn ready(&self) -> Result<(), Unmodelled> {
        let ready = self.control.aden() && !matches!(self.phase, Phase::Start(_));
        ready.then_some(()).ok_or(Unmodelled)
    }

    pub(super) fn trigger(&mut self, clock: Cycles, now: Cycles) {
        if !self.control.jadstart() {
            return;
        }
        self.errs = self.misleads;
        let latency = match self.phase {
            Phase::Sampling(Group::Injected(_), _) | Phase::Converting(Group::Injected(_), _) => {
                self.ignored += 1;
                return;
            }
            // It starts over afterwards.
            Phase::Sampling(Group::Regular, _) | Phase::Converting(Group::Regular, _) => {
                ABORTING_LATENCY
            }
            Phase::Rest | Phase::Start(_) => LATENCY,
        };
        self.sample(Group::Injected(0), now + latency * clock, clock);
    }

    fn channel(&self, group: Group) -> u8 {
        match group {
            Group::Regular => self.regular.sq(0),
            Group::Injected(rank) => self.injected.jsq(rank),
        }
    }

    /// Samples from then on.
    fn sample(&mut self, group: Group, from: Cycles, clock: Cycles) {
        let channel = usize::from(self.channel(group));
        let time = match channel {
            0..=9 => self.samplings.0.smp(channel),
            10..=18 => self.samplings.1.smp(channel - 10),
            // No input has these numbers.
            _ => SampleTime::CYCLES2_5,
        };
        self.phase = Phase::Sampling(group, from + halves(time) * clock);
    }

    /// Takes the voltage at the end of the sampling.
    pub(super) fn sampled(&mut self, volts: f64) {
        // Rounded down to a step of the ladder; the cast clamps at 0.
        let counts = (volts / SUPPLY_V * COUNTS) as u16;
        self.held = counts.min(COUNTS as u16 - 1);
    }

    pub(super) fn due(&self) -> Cycles {
        let phase = match self.phase {
            Phase::Rest => NEVER,
            Phase::Start(end) | Phase::Sampling(_, end) | Phase::Converting(_, end) => end,
        };
        phase.min(self.calibrated_at.unwrap_or(NEVER))
    }

    /// Does what is due, and returns the channel to be sampled now.
    pub(super) fn act(&mut self, clock: Cycles, now: Cycles) -> Option<u8> {
        if self.calibrated_at.is_some_and(|end| end <= now) {
            self.calibrated_at = None;
            self.control.set_adcal(false);
        }
        match self.phase {
            Phase::Start(end) if end <= now => {
                self.flags.set_adrdy(true);
                self.phase = Phase::Rest;
            }
            Phase::Sampling(group, end) if end <= now => {
                self.phase = Phase::Converting(group, end + CONVERSION * clock);
                // The flag is only the regular conversion's (RM0440, end of sampling phase).
                if group == Group::Regular {
                    self.flags.set_eosmp(true);
                    if std::mem::take(&mut self.errs) {
                        return Some(0);
                    }
                }
                return Some(self.channel(group));
            }
            Phase::Converting(group, end) if end <= now => self.converted(group, end, clock),
            _ => {}
        }
        None
    }

    fn converted(&mut self, group: Group, end: Cycles, clock: Cycles) {
        self.phase = Phase::Rest;
        match group {
            Group::Regular => {
                // Without OVRMOD, an unread result stays.
                if self.flags.eoc() {
                    self.flags.set_ovr(true);
                } else {
                    self.data = self.held;
                }
                self.flags.set_eoc(true);
                self.flags.set_eos(true);
                self.control.set_adstart(false);
            }
            Group::Injected(rank) => {
                self.injected_data[rank] = self.held;
                self.flags.set_jeoc(true);
                if rank < usize::from(self.injected.jl()) {
                    self.sample(Group::Injected(rank + 1), end, clock);
                    return;
                }
                self.flags.set_jeos(true);
                // A regular conversion that was requested meanwhile, or aborted for the sequence.
                if self.control.adstart() {
                    self.sample(Group::Regular, end, clock);
                }
            }
        }
    }
}

/// Returns a sampling time in half clocks (RM0440, ADC_SMPR1).
fn halves(time: SampleTime) -> Cycles {
    match time {
        SampleTime::CYCLES2_5 => 5,
        SampleTime::CYCLES6_5 => 13,
        SampleTime::CYCLES12_5 => 25,
        SampleTime::CYCLES24_5 => 49,
        SampleTime::CYCLES47_5 => 95,
        SampleTime::CYCLES92_5 => 185,
        SampleTime::CYCLES247_5 => 495,
        SampleTime::CYCLES640_5 => 1281,
    }
}
