//! The drive's state from period to period: each mode's, and the shared one.

use siskin_units::trace::Trace;
use siskin_units::{AdcCounts, Angle, Flux, Speed};

use super::config::Config;
use super::io::{Bridge, Setpoint};
use super::phase::Phase;
use super::shared::Shared;
use super::snapshot::Snapshot;
use super::transitions::{Why, next};
use super::{charge, excite, foc, off, schedule, self_test, six_step, tone};
use crate::control::{inductance, observer};
use crate::protection::Fault;

/// No kind of set-point.
const NO_KIND: u8 = u8::MAX;

/// The last fault that turned the bridge off; an arbitrary one before the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastFault {
    /// Faults since power-up.
    pub count: u32,
    /// What it was.
    pub fault: Fault,
    /// The phase that it ended.
    pub phase: Phase,
}

/// Marks the first period of a phase of rest.
const BEGUN: u8 = u8::MAX;

/// Most periods in which a phase of rest begins, after its first.
const BEGINNING_PERIODS: u8 = 16;

/// Everything that `step` remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub(super) phase: Phase,
    /// The kind of set-point for which field-oriented control drives, or [`NO_KIND`].
    foc_kind: u8,
    /// Periods until the present phase, one of rest, has begun in full; [`BEGUN`] in its first.
    enters_rest: u8,
    pub(super) shared: Shared,
    pub(super) off: off::State,
    pub(super) charge: charge::State,
    pub(super) foc: foc::state::State,
    pub(super) six_step: six_step::state::State,
    pub(super) tone: tone::State,
    pub(super) self_test: self_test::State,
    pub(super) excite: excite::State,
}

impl State {
    /// Creates the power-up state: idle, without fault.
    pub fn new(config: &Config) -> Self {
        Self {
            phase: Phase::Idle,
            foc_kind: NO_KIND,
            enters_rest: 0,
            shared: Shared::new(config),
            off: off::State::new(config),
            charge: charge::State::default(),
            foc: foc::state::State::new(),
            six_step: six_step::state::State::default(),
            tone: tone::State::default(),
            self_test: self_test::State::default(),
            excite: excite::State::default(),
        }
    }

    /// Continues under a new configuration. If its units differ, everything but the faults restarts, because the
    /// numbers would change their meaning; that is for a drive at rest.
    pub fn adopt(&mut self, before: &Config, now: &Config) {
        self.foc_kind = NO_KIND;
        if before.scale != now.scale {
            self.restart(now);
        }
        // A factor found for another inductance, or no longer maintained.
        let stated = |config: &Config| config.adapt_l.as_ref().map(|adapt| adapt.gain);
        if stated(before) != stated(now) {
            self.foc.loops.inductance = inductance::State::default();
        }
    }

    /// Resets to power-up except for the faults. Part by part: a temporary whole state would take a KB of the
    /// interrupt's stack.
    fn restart(&mut self, config: &Config) {
        let latch = self.shared.latch.clone();
        self.phase = Phase::Idle;
        self.enters_rest = 0;
        self.shared = Shared::new(config);
        self.shared.latch = latch;
        self.off = off::State::new(config);
        self.charge = charge::State::default();
        self.foc.restart();
        self.six_step = six_step::state::State::default();
        self.tone = tone::State::default();
        self.self_test = self_test::State::default();
        self.excite = excite::State::default();
    }

    /// Returns true if field-oriented control drives for this kind of set-point: its schedule alone then decides
    /// when to check the mode.
    #[inline(always)] // in each period
    pub(super) fn foc_drives_for(&self, setpoint: &Setpoint) -> bool {
        self.foc_kind == setpoint.kind()
    }

    /// Returns true if field-oriented control drives.
    #[inline(always)] // in each period
    pub(super) fn foc_drives(&self) -> bool {
        self.foc_kind != NO_KIND
    }

    /// Returns the bridge for the first period of a phase of rest. The phase's own work begins in the next period,
    /// because the terminals are still driven in this one. Some periods later the drives forget: a drive may end in a
    /// long period.
    #[inline(always)] // in each period but those of field-oriented control
    pub(super) fn enters_rest(&mut self) -> Option<Bridge> {
        if self.enters_rest == 0 {
            None
        } else {
            self.begin_rest()
        }
    }

    #[cold]
    #[inline(never)] // only some periods
    fn begin_rest(&mut self) -> Option<Bridge> {
        let brakes = self.phase == Phase::Brake;
        if self.enters_rest == BEGUN {
            self.enters_rest = BEGINNING_PERIODS;
            self.shared.applied.rest();
            return Some(if brakes { Bridge::Brake } else { Bridge::Off });
        }
        self.enters_rest -= 1;
        // In Brake the observer runs on, and is to see no voltage. Else the rotor is looked for, which takes long in most
        // periods.
        let is_now = brakes || self.off.does_little() || self.enters_rest == 1;
        if is_now && self.enters_rest > 0 {
            self.forget_drives();
            self.enters_rest = 1;
        }
        None
    }

    /// Returns true until the present phase, one of rest, has begun in full.
    #[inline(always)] // in each period
    pub(super) fn begins_rest(&self) -> bool {
        self.enters_rest != 0
    }

    fn forget_drives(&mut self) {
        self.foc.rest();
        self.six_step.rest();
    }

    /// Records the kind of set-point for which field-oriented control drives, if it drives.
    pub(super) fn set_foc_kind(&mut self, config: &Config, setpoint: &Setpoint) {
        self.foc_kind = if self.phase.drives() && config.six_step.is_none() {
            setpoint.kind()
        } else {
            NO_KIND
        };
    }

    /// Changes the phase by the table in [`transitions`](super::transitions). Apart from a restart under other
    /// units, phases change nowhere else.
    #[cold]
    pub(super) fn change(&mut self, config: &Config, why: Why) {
        if let Why::Tripped(fault) = why
            && !self.shared.latch.note(fault, self.phase)
        {
            return;
        }
        let from = self.phase;
        let Some(to) = next(from, why, config.stop) else {
            debug_assert!(false, "{from:?} does not end by {why:?}");
            return;
        };
        if self.enters_rest != 0 && self.enters_rest != BEGUN {
            // Before the next mode sets anything.
            self.forget_drives();
            self.enters_rest = 0;
        }
        self.phase = to;
        schedule::choose(&mut self.foc.loops.slot, to.is_open_loop());
        if to.is_off() || to == Phase::Brake {
            self.rest(from, why);
        }
        match (why, &config.six_step) {
            (Why::Sensed, _) => {
                self.charge.begin(config, self.off.rotor);
                self.shared.applied.forget();
            }
            (Why::Resumed, None) => foc::begin::resume(config, &mut self.foc, &self.shared),
            (Why::Resumed | Why::Released, Some(_)) if to.drives() => {
                six_step::period::resume(&mut self.six_step, &self.shared);
            }
            _ => {}
        }
    }

    /// Ends any drive: the rotor's position is unknown. The reported speed stays if it was the rotor's: the shaft
    /// keeps turning.
    fn rest(&mut self, from: Phase, why: Why) {
        let shared = &mut self.shared;
        shared.seen.phase = self.phase;
        shared.zeros.restart();
        self.off.begin();
        self.excite = excite::State::default();
        self.self_test = self_test::State::default();
        self.tone.end(match (from, why) {
            (Phase::Brake, Why::Tone) => true,
            // On the way to a tone, or back from one that was never played.
            (Phase::Idle, Why::Tone) | (Phase::Sense | Phase::Charge, Why::Released) => {
                self.tone.shorted_before
            }
            _ => false,
        });
        if from.is_off() && self.phase.is_off() {
            // Everything else has been at rest since the bridge turned off.
            return;
        }
        if from.is_open_loop() {
            // It was the frame's speed, which the rotor may not have followed.
            shared.seen.speed = Speed::ZERO;
        }
        if !from.is_off() && from != Phase::Charge {
            self.off.forget();
        }
        self.enters_rest = BEGUN;
        self.foc_kind = NO_KIND;
        shared.progress = Default::default();
        shared.seen.rest();
    }

    /// Sets the rotor's position at the next sample, as an encoder does: electrical angle and speed for the phase
    /// order a, b, c. Only [`observer::Config::Given`] uses it.
    pub fn place(&mut self, theta: Angle, omega: Speed) {
        self.foc.observer.given.place(theta, omega);
    }

    /// Returns the trip level of a phase current reading.
    #[inline(always)] // in each period
    pub fn trip_level(&self) -> AdcCounts {
        self.shared.protection.trip
    }

    /// Returns the rotor as the last period saw it: electrical angle for the phase order a, b, c, and speed in the
    /// direction of rotation.
    #[inline(always)] // in each period
    pub fn rotor(&self) -> (Angle, Speed) {
        (self.shared.seen.angle, self.shared.seen.speed)
    }

    /// Returns true if the motor is driven or slowed down.
    #[inline(always)] // a comparison
    pub fn drives(&self) -> bool {
        self.phase.drives()
    }

    /// Returns the last fault that turned the bridge off.
    pub fn last_fault(&self) -> LastFault {
        let latch = &self.shared.latch;
        let (fault, phase) = latch.last;
        LastFault {
            count: latch.count,
            fault,
            phase,
        }
    }

    /// Returns the phase.
    #[inline(always)] // in each period
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns true if the last period, which began in this phase, was none of the long ones: the firmware's own work
    /// fits there.
    #[inline(always)] // in each period
    pub fn has_done_little(&self, began_in: Phase) -> bool {
        began_in == self.phase
            && self.enters_rest == 0
            && if self.foc_drives() {
                schedule::is_light(self.foc.loops.slot)
            } else {
                match self.phase {
                    Phase::Tone => false,
                    phase if phase.drives() => self.six_step.has_done_little(),
                    phase => !phase.is_off() || self.off.has_done_little(),
                }
            }
    }

    /// Returns a copy for the tasks.
    // Built in place, not copied.
    #[inline(always)]
    pub fn snapshot(&self) -> Snapshot {
        let shared = &self.shared;
        let seen = &shared.seen;
        let signed = |speed: Speed| if shared.reversed { -speed } else { speed };
        Snapshot {
            phase: seen.phase,
            faults: shared.latch.faults,
            fault_count: shared.latch.count,
            angle: seen.angle,
            speed: signed(seen.speed),
            speed_reference: signed(self.speed_reference()),
            i: seen.i,
            i_q_reference: self.foc.loops.reference.i.q,
            u: seen.u,
            flux: self.foc.observer.compensated.phi,
            currents: shared.shown,
            bus: shared.protection.bus,
            bus_current: seen.bus_current,
            bounds: shared.protection.bounds,
            trip: self.trip_level(),
            sensor_fault: observer::sensor_fault(&self.foc.observer),
            failed_starts: shared.failed_starts,
            lost_periods: shared.progress.lost_periods,
            missed_sextants: self.six_step.missed,
        }
    }

    /// Returns the adapted inductance over the stated one.
    pub fn inductance(&self) -> inductance::Factor {
        self.foc.loops.inductance.factor
    }

    /// Returns λ̂ of the phases in the order of the configured direction, if flux crossings are observed
    /// (`CTL_OBSERVER` 1 and 2), else zero.
    pub fn flux_linkages(&self) -> [Flux; 3] {
        self.foc.observer.edges.flux.lambda
    }

    /// Returns ω* of the drive in use; the other's rests at zero.
    fn speed_reference(&self) -> Speed {
        let six_step = self.six_step.planner.reference;
        self.foc.loops.speed.reference().max(six_step)
    }

    /// Emits every word of the control state in order: what two machines must agree on.
    // Inlined at its callers; otherwise the words would go through memory.
    #[inline(always)]
    pub fn trace(&self, config: &Config, out: &mut impl FnMut(u32)) {
        // Destructured in full, so that a new field cannot be forgotten.
        let Self {
            phase,
            foc_kind,
            enters_rest,
            shared,
            off,
            charge,
            foc,
            six_step,
            tone,
            self_test,
            excite,
        } = self;
        phase.trace(out);
        foc_kind.trace(out);
        enters_rest.trace(out);
        shared.trace(out);
        off.trace(out);
        charge.trace(out);
        foc.trace(config, out);
        if config.six_step.is_some() {
            six_step.trace(out);
        }
        tone.trace(out);
        self_test.trace(out);
        excite.trace(out);
    }
}
