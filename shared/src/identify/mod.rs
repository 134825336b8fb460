//! Identification: measures R, L, flux and inertia of an unknown motor in some ten seconds.
//!
//! It assumes nothing about the motor but its pole pairs, which only the inertia needs. The drive is rebuilt as the
//! figures come in, and at the end as it was before: they stand in a [`Report`] and change no parameter until someone
//! has them kept. It turns the motor, up to four tenths of the speed that the supply allows, so it begins under the
//! rule of what may turn a motor, and any throttle, fault or failed start ends it.
//!
//! | step | the drive | what follows |
//! |---|---|---|
//! | each phase is excited by two currents | [`Setpoint::Excite`]: the rotor stands aligned | R from the difference of the voltages, and what the dead time takes from the rest |
//! | then by a square wave, along the current and across it | likewise | L on both axes |
//! | spin | six-step, with a share of the supply | a rough flux |
//! | up and down | field-oriented, with a torque each way | the flux, from the voltage that the current does not account for; the inertia, from both runs' currents and changes of speed |
//!
//! Both signs of a current, two levels of it, a run each way: an error of the dead time, of a sensor's gain, or of drag
//! that grows with speed squared is common to both measurements and cancels in their difference.

mod means;
mod report;
mod shaft;
mod winding;

use fixed::types::I1F31;

pub use report::{Figure, Line, Report};

use siskin_params::choice::CtlDrive;
use siskin_params::parts::Identification;
use siskin_params::{Choice, Kind, ParamId, Params};
use siskin_units::{Scale, Speed};

use crate::drive::{Excitation, Phase, Ripple, Setpoint, Snapshot};
use means::{EXCITED_POLLS, Means, OperatingPoint, SPUN_POLLS, seconds};
use report::Motor;
use shaft::Shaft;
use winding::Winding;

/// The excitations of a phase: the share of the greatest current, and the square wave.
const EXCITATIONS: [(f32, Ripple); 4] = [
    (0.5, Ripple::None),
    (1.0, Ripple::None),
    (1.0, Ripple::Along),
    (1.0, Ripple::Across),
];

const EXCITATIONS_PER_PHASE: u8 = EXCITATIONS.len() as u8;

/// The number of excitations over all phases.
const EXCITED: u8 = 3 * EXCITATIONS_PER_PHASE;

/// The greatest current of an excitation, and that of a run, over `LIM_PHASE_A`.
const EXCITED_SHARE: f32 = 0.5;
const RUN_SHARE: f32 = 0.4;

/// Share of the supply that spins the motor.
const SPIN_SHARE: I1F31 = I1F31::lit("0.25");

/// Time in which a run's torque rises to its greatest, s: a light rotor gets to speed sooner.
const RISE_S: f32 = 1.0;
/// How far it has risen when a run begins, s: with less, a caught rotor would slow down and be lost.
const BEGUN_S: f32 = 0.15;
/// The torque against the rotation over the torque at the end of the run up.
const AGAINST: f32 = 0.5;
/// Time between two polls, s.
const POLL_S: f32 = 1e-3;

/// Time until the drive has been rebuilt, s.
const ADOPTED_S: f32 = 0.02;
/// Time until a rotor has swung to another phase's axis, and until a current has reached another level, s.
const ALIGNED_S: f32 = 0.4;
const SETTLED_S: f32 = 0.1;
/// The means of an excitation span 512 periods.
const SETTLED_PERIODS: f32 = 4096.0;
/// The longest that the voltage takes to reach the end of its range.
const RISEN_PERIODS: f32 = 20_000.0;
/// The longest time for a step, s.
const LONGEST_S: f32 = 8.0;

/// The step of an identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The drive forgets the motor.
    Reset,
    /// An excitation, by number: four of each phase.
    Excite(u8),
    /// Six-step.
    Spin,
    /// The bridge turns off.
    Release,
    /// The drive is rebuilt with the results so far.
    Rebuild,
    /// A torque along the rotation.
    Up,
    /// A torque against it.
    Down,
    /// The same until the rotor is slow: a light one would coast for a minute.
    Halt,
}

/// The outcome of a poll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It goes on; percent done.
    Progress(u8),
    /// Build the drive for the motor as far as it is known by now.
    Assume,
    /// It has ended, with success or for this reason. Build the drive from the parameters.
    Done(Result<(), &'static str>),
}

/// The drive's state at a poll.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// The time, µs.
    pub now_us: u64,
    /// Of the drive.
    pub snapshot: &'a Snapshot,
    /// Its units.
    pub scale: &'a Scale,
    /// `LIM_PHASE_A`, A.
    pub limit_a: f32,
    /// True if nothing else asks the motor to turn.
    pub rests: bool,
}

impl Inputs<'_> {
    fn bus_v(&self) -> f32 {
        self.scale.volts(self.snapshot.bus)
    }
}

/// An identification and its results.
#[derive(Clone, Debug)]
pub struct Identify {
    /// `None` while none is under way.
    step: Option<(Identification, Step)>,
    since_us: u64,
    setpoint: Setpoint,
    means: Means,
    winding: Winding,
    shaft: Shaft,
    /// The motor as far as it is known, and the greatest speed to build the drive for, rpm.
    motor: Motor,
    rpm_max: f32,
    /// How long the torque has risen, s.
    risen_s: f32,
    /// The speed at which the means of the spin began.
    speed: Speed,
    /// The results.
    pub report: Report,
}

impl Default for Identify {
    fn default() -> Self {
        Self {
            step: None,
            since_us: 0,
            setpoint: Setpoint::Stop,
            means: Means::default(),
            winding: Winding::default(),
            shaft: Shaft::default(),
            motor: Motor::default(),
            rpm_max: 0.0,
            risen_s: BEGUN_S,
            speed: Speed::ZERO,
            report: Report::default(),
        }
    }
}

impl Identify {
    /// Begins an identification.
    pub fn begin(&mut self, now_us: u64) -> Outcome {
        let Some(part) = Identification::get() else {
            return Outcome::Done(Err("not in this image"));
        };
        *self = Self::default();
        self.enter(now_us, (part, Step::Reset), Setpoint::Stop);
        Outcome::Assume
    }

    /// Ends the one under way, if any, for this reason.
    pub fn end(&mut self, reason: &'static str) -> Option<Outcome> {
        (self.step.take()).map(|_| Outcome::Done(Err(reason)))
    }

    /// Returns true while one is under way.
    pub fn is_under_way(&self) -> bool {
        self.step.is_some()
    }

    /// Returns the drive's set-point while one is under way.
    pub fn setpoint(&self) -> Option<Setpoint> {
        self.is_under_way().then_some(self.setpoint)
    }

    /// Advances it; call it about every millisecond.
    // Out of line: its stack is free for what the caller does next.
    #[inline(never)]
    pub fn poll(&mut self, inputs: &Inputs) -> Option<Outcome> {
        let step = self.step?;
        let passed_s = seconds(inputs.now_us, self.since_us);
        let result = if !inputs.rests {
            Err("the throttle is open")
        } else if !inputs.snapshot.faults.is_empty() {
            Err("a fault holds")
        } else if passed_s > LONGEST_S {
            Err("it does not turn properly")
        } else {
            self.advance(inputs, step, passed_s)
        };
        result.unwrap_or_else(|reason| self.end(reason))
    }

    fn advance(
        &mut self,
        inputs: &Inputs,
        (part, step): (Identification, Step),
        passed_s: f32,
    ) -> Result<Option<Outcome>, &'static str> {
        match step {
            Step::Reset if passed_s > ADOPTED_S => Ok(Some(self.excite(inputs, part, 0))),
            Step::Rebuild if passed_s > ADOPTED_S => {
                self.enter(inputs.now_us, (part, Step::Up), self.torque(inputs, 1.0));
                Ok(Some(Outcome::Progress(80)))
            }
            Step::Reset | Step::Rebuild => Ok(None),
            Step::Excite(number) => self.measure_excitation(inputs, part, number, passed_s),
            Step::Spin => Ok(self.measure_spin(inputs, part)),
            Step::Release => Ok(self.await_release(inputs, part, passed_s)),
            Step::Up => self.measure_run(inputs, part, false),
            Step::Down => self.measure_run(inputs, part, true),
            Step::Halt if inputs.snapshot.phase == Phase::Run => Ok(None),
            Step::Halt => {
                self.step = None;
                Ok(Some(Outcome::Done(Ok(()))))
            }
        }
    }

    // Out of line: each step ends with one.
    #[inline(never)]
    fn enter(&mut self, now_us: u64, step: (Identification, Step), setpoint: Setpoint) {
        self.step = Some(step);
        self.since_us = now_us;
        self.setpoint = setpoint;
        self.means = Means::default();
    }

    fn excite(&mut self, inputs: &Inputs, part: Identification, number: u8) -> Outcome {
        let (share, ripple) = EXCITATIONS[usize::from(number % EXCITATIONS_PER_PHASE)];
        let current_a = share * EXCITED_SHARE * inputs.limit_a;
        let current = inputs.scale.current_from_a(current_a);
        let excitation = Excitation::new(part, number / EXCITATIONS_PER_PHASE, current, ripple);
        let setpoint = Setpoint::Excite(excitation);
        self.enter(inputs.now_us, (part, Step::Excite(number)), setpoint);
        Outcome::Progress(5 * number)
    }

    /// Measures a winding.
    fn measure_excitation(
        &mut self,
        inputs: &Inputs,
        part: Identification,
        number: u8,
        passed_s: f32,
    ) -> Result<Option<Outcome>, &'static str> {
        let (snapshot, period_s) = (inputs.snapshot, inputs.scale.period_s);
        let phase = usize::from(number / EXCITATIONS_PER_PHASE);
        let excitation_of_phase = number % EXCITATIONS_PER_PHASE;
        if self.means.polls == 0 {
            let Setpoint::Excite(excitation) = self.setpoint else {
                return Ok(None);
            };
            let asked = excitation.current();
            let settled_s = if excitation_of_phase == winding::LOWER {
                ALIGNED_S
            } else {
                SETTLED_S
            };
            let settled = passed_s > settled_s + SETTLED_PERIODS * period_s;
            let reached = (snapshot.i.d - asked).abs() < asked >> 5;
            // If the supply is too weak for the current, what flows is as good.
            let risen = reached || passed_s > RISEN_PERIODS * period_s;
            if snapshot.phase != Phase::Tone || !settled || !risen {
                return Ok(None);
            }
        }
        self.means.add(snapshot, inputs.scale);
        if self.means.polls < EXCITED_POLLS {
            return Ok(None);
        }
        self.winding
            .take(phase, excitation_of_phase, self.means.get(), period_s);
        if number + 1 < EXCITED {
            return Ok(Some(self.excite(inputs, part, number + 1)));
        }
        let supply = (inputs.scale, inputs.bus_v());
        self.winding
            .evaluate(&mut self.report, &mut self.motor, supply)?;
        let setpoint = Setpoint::Voltage(SPIN_SHARE);
        self.enter(inputs.now_us, (part, Step::Spin), setpoint);
        Ok(Some(Outcome::Progress(60)))
    }

    /// Measures a rotor turned by six-step.
    fn measure_spin(&mut self, inputs: &Inputs, part: Identification) -> Option<Outcome> {
        let snapshot = inputs.snapshot;
        if snapshot.phase != Phase::Run {
            return None;
        }
        // Restarts until the speed is steady.
        if (snapshot.speed - self.speed).abs() > self.speed >> 5 {
            self.speed = snapshot.speed;
            self.means = Means::default();
        }
        self.means.add(snapshot, inputs.scale);
        if self.means.polls < SPUN_POLLS {
            return None;
        }
        let dead_v = self.winding.dead_v();
        self.motor.flux_wb = Shaft::rough_flux_wb(self.means.get(), &self.motor, dead_v);
        self.enter(inputs.now_us, (part, Step::Release), Setpoint::Stop);
        Some(Outcome::Progress(70))
    }

    /// Waits until the bridge is off: only then can the drive be rebuilt.
    fn await_release(
        &mut self,
        inputs: &Inputs,
        part: Identification,
        passed_s: f32,
    ) -> Option<Outcome> {
        if inputs.snapshot.phase != Phase::Idle || passed_s < ADOPTED_S {
            return None;
        }
        self.rpm_max = self
            .shaft
            .choose_speed(inputs.bus_v(), &self.motor, inputs.scale);
        self.enter(inputs.now_us, (part, Step::Rebuild), Setpoint::Stop);
        Some(Outcome::Assume)
    }

    /// Measures a run.
    fn measure_run(
        &mut self,
        inputs: &Inputs,
        part: Identification,
        down: bool,
    ) -> Result<Option<Outcome>, &'static str> {
        if inputs.snapshot.phase != Phase::Run {
            return Ok(None);
        }
        if !down {
            self.risen_s = (self.risen_s + POLL_S).min(RISE_S);
            self.setpoint = self.torque(inputs, 1.0);
        }
        let point = OperatingPoint::of(inputs.snapshot, inputs.scale);
        if !self.shaft.measure(inputs.now_us, point, down, &self.motor) {
            return Ok(None);
        }
        if !down {
            let setpoint = self.torque(inputs, -AGAINST);
            self.enter(inputs.now_us, (part, Step::Down), setpoint);
            return Ok(Some(Outcome::Progress(90)));
        }
        self.shaft
            .evaluate(&mut self.report, inputs.scale.pole_pairs)?;
        self.enter(inputs.now_us, (part, Step::Halt), self.setpoint);
        Ok(None)
    }

    /// Returns the torque reached by now, in this direction.
    // Out of line: three calls.
    #[inline(never)]
    fn torque(&self, inputs: &Inputs, way: f32) -> Setpoint {
        let current_a = way * RUN_SHARE * self.risen_s / RISE_S * inputs.limit_a;
        Setpoint::Torque(inputs.scale.current_from_a(current_a))
    }

    /// Replaces the parameters' motor by the one known so far, and what follows from it.
    pub(crate) fn assume(&self, params: &mut Params) {
        for id in ParamId::ALL {
            // The PWM's frequency stays what the timer runs at.
            if id.entry().kind == Kind::FromMotor && id != ParamId::PwmFreqHz {
                let _ = params.set(id, 0.0);
            }
        }
        for (id, value) in [
            (ParamId::MotRMohm, 1e3 * self.motor.r_ohm),
            (ParamId::MotLUh, 1e6 * self.motor.l_h),
            (ParamId::MotFluxMwb, 1e3 * self.motor.flux_wb),
            (ParamId::MotJGcm2, 0.0),
            // Braked by the low sides alone, a motor could drive more than the limit.
            (ParamId::MotStop, 0.0),
            (CtlDrive::PARAM, f32::from(CtlDrive::Automatic.number())),
            (ParamId::CtlRpmMax, self.rpm_max),
        ] {
            // A figure out of range is left out; the check of the resulting drive reports it.
            let _ = params.set(id, value);
        }
    }
}
