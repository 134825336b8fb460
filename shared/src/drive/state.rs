//! State of the drive from period to period: that of each mode, and that which all share.

use super::config::Config;
use super::io::{Bridge, Setpoint};
use super::phase::Phase;
use super::shared::Shared;
use super::snapshot::Snapshot;
use super::transitions::{Why, next};
use super::{charge, excite, foc, off, schedule, self_test, six_step, tone};
use crate::control::{inductance, observer};
use crate::protection::Fault;
use crate::trace::Trace;
use crate::units::{AdcCounts, Angle, Flux, Speed};

/// No kind of set-point.
const UNDECIDED: u8 = u8::MAX;

/// The last fault that has turned the bridge off; any before the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastFault {
    /// Faults since the start.
    pub count: u32,
    /// What it was.
    pub fault: Fault,
    /// The phase that it ended.
    pub phase: Phase,
}

/// Everything that `step` remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub(super) phase: Phase,
    /// The kind of set-point for which field-oriented control drives, or [`UNDECIDED`].
    decided: u8,
    /// True if the present phase, one of rest, has just begun.
    enters_rest: bool,
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
    /// The state at power-up: idle, without fault.
    pub fn new(config: &Config) -> Self {
        Self {
            phase: Phase::Idle,
            decided: UNDECIDED,
            enters_rest: false,
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

    /// Goes on under a new configuration. Where its units differ, all but the faults starts anew:
    /// the numbers would mean something else. That is for a drive at rest.
    pub fn adopt(&mut self, before: &Config, now: &Config) {
        self.decided = UNDECIDED;
        if before.scale != now.scale {
            self.restart(now);
        }
        // A factor that was found for another inductance, or is no longer kept up.
        let stated = |config: &Config| config.adapt_l.as_ref().map(|adapt| adapt.gain);
        if stated(before) != stated(now) {
            self.foc.loops.inductance = inductance::State::default();
        }
    }

    /// As at power-up, but for the faults. Part by part: a whole state in between would take a KB of
    /// the interrupt's stack.
    fn restart(&mut self, config: &Config) {
        let latch = self.shared.latch.clone();
        self.phase = Phase::Idle;
        self.enters_rest = false;
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

    /// Returns true if field-oriented control drives for this kind of set-point: only its schedule says when
    /// the mode is looked at again.
    #[inline(always)] // in each period
    pub(super) fn is_decided_for(&self, setpoint: &Setpoint) -> bool {
        self.decided == setpoint.kind()
    }

    /// Returns true if field-oriented control drives.
    #[inline(always)] // in each period
    pub(super) fn is_decided(&self) -> bool {
        self.decided != UNDECIDED
    }

    /// The bridge in the period in which a phase of rest has just begun. Its own work begins in the next period:
    /// what is at the terminals now has been driven.
    pub(super) fn enters_rest(&mut self) -> Option<Bridge> {
        core::mem::take(&mut self.enters_rest).then(|| {
            self.shared.applied.rest();
            if self.phase == Phase::Brake {
                Bridge::Brake
            } else {
                Bridge::Off
            }
        })
    }

    /// Notes that the phase suits this set-point.
    pub(super) fn set_decided_for(&mut self, config: &Config, setpoint: &Setpoint) {
        self.decided = if self.phase.drives() && config.six_step.is_none() {
            setpoint.kind()
        } else {
            UNDECIDED
        };
    }

    /// Changes the phase, by the table of [`transitions`](super::transitions): here, and where all begins
    /// anew under other units, and nowhere else.
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
        self.phase = to;
        schedule::choose(&mut self.foc.loops.slot, to.is_open_loop());
        if to.is_off() || to == Phase::Brake || why == Why::Retried {
            self.rest(from, why);
        }
        match (why, &config.six_step) {
            (Why::Sensed, _) => {
                self.charge.begin(config, self.off.rotor);
                self.shared.applied.forget();
            }
            (Why::Resumed, None) => foc::begin::resume(config, &mut self.foc, &self.shared),
            (Why::Resumed | Why::Released, Some(_)) if to.drives() => {
                six_step::period::resume(&mut self.six_step);
            }
            _ => {}
        }
    }

    /// Ends any drive: nothing is known of the rotor's position. The speed that is reported stays where
    /// it was the rotor's: the shaft turns on.
    fn rest(&mut self, from: Phase, why: Why) {
        let shared = &mut self.shared;
        shared.seen.phase = self.phase;
        shared.zeros.restart();
        self.off.begin();
        self.excite = excite::State::default();
        self.self_test = self_test::State::default();
        self.tone.end(match (from, why) {
            (Phase::Brake, Why::Tone) => true,
            // On the way to a tone, or back from one that has not come to be played.
            (Phase::Idle, Why::Tone) | (Phase::Sense | Phase::Charge, Why::Released) => {
                self.tone.shorted_before
            }
            _ => false,
        });
        if from.is_off() && self.phase.is_off() {
            // All else has been at rest since the bridge was turned off.
            return;
        }
        if from.is_open_loop() {
            // That was the frame's speed, which the rotor may not have followed.
            shared.seen.speed = Speed::ZERO;
        }
        if !from.is_off() && from != Phase::Charge {
            self.off.forget();
        }
        self.enters_rest = why != Why::Retried;
        self.decided = UNDECIDED;
        shared.progress = Default::default();
        shared.seen.rest();
        self.foc.rest();
        self.six_step.rest();
    }

    /// Tells where the rotor will be at the coming sample, as an encoder does: its electrical angle
    /// and speed with the phases in the order a, b, c. Only
    /// [`observer::Config::Given`] listens.
    pub fn place(&mut self, theta: Angle, omega: Speed) {
        self.foc.observer.given.place(theta, omega);
    }

    /// Magnitude of a phase's reading that turns the bridge off now.
    #[inline(always)] // in each period
    pub fn trip_level(&self) -> AdcCounts {
        self.shared.protection.trip
    }

    /// The rotor as the last period saw it: its electrical angle with the phases in the order a, b, c, and its speed
    /// the way it turns.
    #[inline(always)] // in each period
    pub fn rotor(&self) -> (Angle, Speed) {
        (self.shared.seen.angle, self.shared.seen.speed)
    }

    /// Returns true if the motor is turned, or slowed down.
    #[inline(always)] // a comparison
    pub fn drives(&self) -> bool {
        self.phase.drives()
    }

    /// The last fault that has turned the bridge off.
    pub fn last_fault(&self) -> LastFault {
        let latch = &self.shared.latch;
        let (fault, phase) = latch.last;
        LastFault {
            count: latch.count,
            fault,
            phase,
        }
    }

    /// A copy for the tasks.
    // Made where it is put, not copied there.
    #[inline(always)]
    pub fn snapshot(&self) -> Snapshot {
        let shared = &self.shared;
        let seen = &shared.seen;
        let signed = |speed: Speed| if shared.reversed { -speed } else { speed };
        let losses = if self.phase.drives() {
            self.six_step.losses()
        } else {
            // What the six-step drive counts is left where it was when it ended.
            six_step::state::Losses::default()
        };
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
            currents: shared.shown,
            bus: shared.protection.bus,
            bus_current: seen.bus_current,
            bounds: shared.protection.bounds,
            trip: self.trip_level(),
            sensor_fault: observer::sensor_fault(&self.foc.observer),
            failed_starts: shared.failed_starts.max(losses.failed_starts),
            lost_periods: shared.progress.lost_periods,
            missed_sextants: losses.missed_sextants,
        }
    }

    /// The adapted inductance over the one that the parameters state.
    pub fn inductance(&self) -> inductance::Factor {
        self.foc.loops.inductance.factor
    }

    /// λ̂ of the phases in the order of the configured direction, where flux crossings are observed
    /// (`CTL_OBSERVER` 1 and 2); else zero.
    pub fn flux_linkages(&self) -> [Flux; 3] {
        self.foc.observer.edges.flux.lambda
    }

    /// ω* of the drive in use; that of the other rests at zero.
    fn speed_reference(&self) -> Speed {
        let six_step = self.six_step.planner.reference;
        self.foc.loops.speed.reference().max(six_step)
    }

    /// Every word of the control state, one after the other: what two machines must agree on.
    // One copy where it is called, or the words' place would go through memory.
    #[inline(always)]
    pub fn trace(&self, config: &Config, out: &mut impl FnMut(u32)) {
        // Taken apart in full, so that a new field is not forgotten here.
        let Self {
            phase,
            decided,
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
        decided.trace(out);
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
