//! What a control period remembers, and what of it the tasks may know.

use super::{Config, Fault, Faults, Phase, pull, six_step, tone};
use crate::control::catch::Rotor;
use crate::control::inductance::Factor;
use crate::control::modulator::Supply;
use crate::control::regulator::Reference;
use crate::control::speed::Bounds;
use crate::control::transform::{AlphaBeta, Dq, Order};
use crate::control::{
    catch, dead_time, inductance, observer, planner, regulator, sensing, speed, start, torque,
};
use crate::math::SinCos;
use crate::protection;
use crate::trace::Trace;
use crate::units::{AdcCounts, Angle, Current, Duty, Flux, Speed, Voltage};

/// The sample at which the bridge is turned off, and one for a period of delay.
const SETTLING_PERIODS: u8 = 2;

/// No kind of set-point.
pub(super) const NOT_PLAIN: u8 = u8::MAX;

/// Everything that `step` remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub(super) phase: Phase,
    /// The kind of set-point under which the next period is a plain one, or [`NOT_PLAIN`].
    pub(super) plain: u8,
    /// Samples for which a phase may be unreadable.
    pub(super) unread: u8,
    /// Which piece of the slow work this period has done.
    pub(super) turn: u8,
    /// The phases' order as the control sees it.
    pub(super) order: Order,
    pub(super) faults: Faults,
    pub(super) fault_count: u32,
    /// Periods at zero throttle since the last sample that was a fault.
    pub(super) clear_periods: u32,
    pub(super) lost_periods: u32,
    /// Whether the motor turns, or is to turn, against the configured direction.
    pub(super) reversed: bool,
    /// Attempts of a start that have failed.
    pub(super) failed_starts: u8,
    /// Periods for which Run has been slow.
    pub(super) slow_periods: u32,
    /// Periods since Run began, as far as they matter.
    pub(super) run_periods: u32,
    /// Samples that may still show a current from before the bridge was off.
    pub(super) settling_periods: u8,
    /// Measurements of the currents' zeros since Sense began.
    pub(super) looks: u8,
    /// Periods of Charge so far.
    pub(super) charge_periods: u32,
    pub(super) sensing: sensing::State,
    pub(super) catch: catch::State,
    /// What the open terminals have told of the rotor, with the phases in the order a, b, c.
    pub(super) rotor: Rotor,
    pub(super) observer: observer::State,
    pub(super) regulator: regulator::State,
    pub(super) speed: speed::State,
    pub(super) inductance: inductance::State,
    /// Change of ω* in the last period.
    pub(super) planned: Speed,
    pub(super) torque: torque::State,
    /// What is wanted of the current regulator.
    pub(super) wanted: Reference,
    /// i_d* at this speed.
    pub(super) i_d: Current,
    /// Bounds of i_q* at this speed.
    pub(super) bounds: Bounds,
    /// How far the frame turns until the voltage acts.
    pub(super) ahead: SinCos,
    /// The wanted current as the dead time's compensation takes it.
    pub(super) certainty: dead_time::Certainty,
    /// What the supply gives.
    pub(super) supply: Supply,
    /// i_q* less i_q where the voltage was limited.
    pub(super) missing: Current,
    pub(super) start: start::State,
    pub(super) tone: tone::Playing,
    pub(super) pulling: pull::Pulling,
    pub(super) protection: protection::State,
    pub(super) six_step: six_step::State,
    /// The voltages of the last two commands in the stator's frame, the latest first.
    pub(super) commanded: [AlphaBeta<Voltage>; 2],
    /// The last two commands' duties of the phases a, b, c, the latest first.
    pub(super) applied: [[Duty; 3]; 2],
    /// What the last period has seen and done, for telemetry.
    pub(super) seen: Seen,
}

/// The last period's quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) phase: Phase,
    pub(super) angle: Angle,
    pub(super) speed: Speed,
    pub(super) i: Dq<Current>,
    pub(super) u: Dq<Voltage>,
    pub(super) bus_current: Current,
}

/// What the tasks may know of the control, copied out of the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// What the drive did in the last period.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// How often a fault has turned the bridge off since the start.
    pub fault_count: u32,
    /// Electrical angle of the control's frame at the sample, with the phases in the order a, b, c:
    /// the rotor's as estimated in Run and Stopping, an imposed one in Park and Ramp.
    pub angle: Angle,
    /// Estimated electrical speed, negative against the configured direction.
    pub speed: Speed,
    /// Reference of the electrical speed.
    pub speed_reference: Speed,
    /// Measured current in the estimated rotor's frame.
    pub i: Dq<Current>,
    /// Voltage that was commanded.
    pub u: Dq<Voltage>,
    /// Supply voltage.
    pub bus: Voltage,
    /// Current from the supply, 1.5·(v·i)/V_bus; negative while braking.
    pub bus_current: Current,
    /// Magnitude of a phase's reading that turns the bridge off.
    pub trip: AdcCounts,
    /// The adapted inductance over the one that the parameters state.
    pub inductance: Factor,
    /// Whether a position sensor is at fault.
    pub sensor_fault: bool,
    /// Attempts of the present start that have failed.
    pub failed_starts: u8,
    /// Periods in a row for which the observer's state has been out of its range.
    pub lost_periods: u32,
    /// Sextants in a row in which the six-step drive has seen no crossing where it drives.
    pub missed_sextants: u8,
}

impl State {
    /// The state at power-up: idle, without fault.
    pub fn new(config: &Config) -> Self {
        Self {
            phase: Phase::Idle,
            plain: NOT_PLAIN,
            unread: 0,
            turn: 0,
            order: Order::NORMAL,
            faults: Faults::NONE,
            fault_count: 0,
            clear_periods: 0,
            lost_periods: 0,
            reversed: false,
            failed_starts: 0,
            slow_periods: 0,
            run_periods: 0,
            settling_periods: 0,
            looks: 0,
            charge_periods: 0,
            sensing: sensing::State::default(),
            catch: catch::State::new(&config.catch),
            rotor: Rotor::Unknown,
            observer: observer::State::default(),
            regulator: regulator::State::default(),
            speed: speed::State::default(),
            start: start::State::default(),
            tone: tone::Playing::default(),
            pulling: pull::Pulling::default(),
            inductance: inductance::State::default(),
            planned: Speed::ZERO,
            torque: torque::State::default(),
            wanted: Reference::default(),
            i_d: Current::ZERO,
            bounds: Bounds::default(),
            ahead: SinCos::of(Angle::ZERO),
            certainty: Dq::default(),
            supply: Supply::new(&config.modulator, Voltage::ZERO, Voltage::ZERO),
            missing: Current::ZERO,
            protection: protection::State::new(&config.protection),
            six_step: six_step::State::default(),
            commanded: [AlphaBeta::default(); 2],
            applied: [[Duty::ZERO; 3]; 2],
            seen: Seen {
                phase: Phase::Idle,
                angle: Angle::ZERO,
                speed: Speed::ZERO,
                i: Dq::default(),
                u: Dq::default(),
                bus_current: Current::ZERO,
            },
        }
    }

    /// Goes on under a new configuration. Where its units differ, all but the faults starts anew:
    /// the numbers would mean something else. That is for a drive at rest.
    pub fn adopt(&mut self, before: &Config, now: &Config) {
        self.plain = NOT_PLAIN;
        if before.scale != now.scale {
            // In two steps: a state in between would take a KB of the interrupt's stack.
            let (faults, fault_count) = (self.faults, self.fault_count);
            *self = Self::new(now);
            self.faults = faults;
            self.fault_count = fault_count;
        }
        // A factor that was found for another inductance, or is no longer kept up.
        let stated = |config: &Config| config.adapt_l.as_ref().map(|adapt| adapt.gain);
        if stated(before) != stated(now) {
            self.inductance = inductance::State::default();
        }
    }

    /// Tells where the rotor will be at the coming sample, as an encoder does: its electrical angle
    /// and speed with the phases in the order a, b, c. Only
    /// [`observer::Config::Given`] listens.
    pub fn place(&mut self, theta: Angle, omega: Speed) {
        self.observer.given.place(theta, omega);
    }

    /// Magnitude of a phase's reading that turns the bridge off now.
    #[inline(always)]
    pub fn trip_level(&self) -> AdcCounts {
        self.protection.trip
    }

    /// What the tasks may know.
    // Made where it is put, not copied there.
    #[inline(always)]
    pub fn snapshot(&self) -> Snapshot {
        let signed = |speed: Speed| if self.reversed { -speed } else { speed };
        let (failed, missed) = if self.phase.drives() {
            self.six_step.trouble()
        } else {
            // What the six-step drive counts is left where it was when it ended.
            (0, 0)
        };
        Snapshot {
            phase: self.seen.phase,
            faults: self.faults,
            fault_count: self.fault_count,
            angle: self.seen.angle,
            speed: signed(self.seen.speed),
            speed_reference: signed(self.reference()),
            i: self.seen.i,
            u: self.seen.u,
            bus: self.protection.bus,
            bus_current: self.seen.bus_current,
            trip: self.trip_level(),
            inductance: self.inductance.factor,
            sensor_fault: observer::sensor_fault(&self.observer),
            failed_starts: self.failed_starts.max(failed),
            lost_periods: self.lost_periods,
            missed_sextants: missed,
        }
    }

    /// λ̂ of the phases in the order of the configured direction, where flux crossings are observed
    /// (`CTL_OBSERVER` 1 and 2); else zero.
    pub fn flux_linkages(&self) -> [Flux; 3] {
        self.observer.edges.flux.lambda
    }

    /// Every word of the control state, one after the other: what two machines must agree on.
    // One copy where it is called, or the words' place would go through memory.
    #[inline(always)]
    pub fn trace(&self, config: &Config, out: &mut impl FnMut(u32)) {
        // Taken apart in full, so that a new field is not forgotten here.
        let Self {
            phase,
            plain,
            unread,
            turn,
            order,
            faults,
            fault_count,
            clear_periods,
            lost_periods,
            reversed,
            failed_starts,
            slow_periods,
            run_periods,
            settling_periods,
            looks,
            charge_periods,
            sensing,
            catch,
            rotor,
            observer,
            regulator,
            speed,
            inductance,
            planned,
            torque: torque::State { i_q },
            wanted,
            i_d,
            bounds,
            ahead,
            certainty,
            supply,
            missing,
            start,
            tone,
            pulling,
            protection,
            six_step,
            commanded,
            applied,
            seen,
        } = self;
        for word in [
            *phase as u32,
            u32::from(*plain),
            u32::from(*unread),
            u32::from(*turn),
            u32::from(*order == Order::SWAPPED),
            u32::from(faults.bits()),
            *fault_count,
            *clear_periods,
            *lost_periods,
            u32::from(*reversed),
            u32::from(*failed_starts),
            *slow_periods,
            *run_periods,
            u32::from(*settling_periods),
            u32::from(*looks),
            *charge_periods,
            u32::from(protection.over_current_samples),
            seen.phase as u32,
        ] {
            out(word);
        }
        for bits in [
            planned.to_bits(),
            i_q.to_bits(),
            missing.to_bits(),
            protection.trip.to_bits(),
            protection.bus.to_bits(),
            protection.bounds.min.to_bits(),
            protection.bounds.max.to_bits(),
            commanded[0].alpha.to_bits(),
            commanded[0].beta.to_bits(),
            commanded[1].alpha.to_bits(),
            commanded[1].beta.to_bits(),
            seen.angle.to_bits(),
            seen.speed.to_bits(),
            seen.i.d.to_bits(),
            seen.i.q.to_bits(),
            seen.u.d.to_bits(),
            seen.u.q.to_bits(),
            seen.bus_current.to_bits(),
            wanted.i.d.to_bits(),
            wanted.i.q.to_bits(),
            wanted.i_q_step.to_bits(),
            wanted.u_q.to_bits(),
            i_d.to_bits(),
            bounds.min.to_bits(),
            bounds.max.to_bits(),
            ahead.cos.to_bits(),
            ahead.sin.to_bits(),
            certainty.d.to_bits(),
            certainty.q.to_bits(),
            supply.bus.to_bits(),
            supply.reciprocal.to_bits(),
            supply.longest.length().to_bits(),
            supply.readable.to_bits(),
        ] {
            out(bits as u32);
        }
        for duty in applied.as_flattened() {
            out(duty.to_bits());
        }
        // As many words whatever is known, so that a word's place tells what it is.
        let (kind, theta, omega) = match rotor {
            Rotor::Unknown => (0, Angle::ZERO, Speed::ZERO),
            Rotor::Standing => (1, Angle::ZERO, Speed::ZERO),
            Rotor::Turning { theta, omega } => (2, *theta, *omega),
        };
        out(kind);
        out(theta.to_bits() as u32);
        out(omega.to_bits() as u32);
        regulator.trace(out);
        speed.trace(out);
        inductance.trace(out);
        sensing.trace(out);
        catch.trace(out);
        observer.trace(&config.observer, out);
        start.trace(out);
        tone.trace(out);
        if config.six_step.is_some() {
            six_step.trace(out);
        }
        pulling.trace(out);
    }

    /// ω* of the drive in use; that of the other rests at zero.
    fn reference(&self) -> Speed {
        self.speed.reference().max(self.six_step.planner.reference)
    }

    /// Turns the bridge off until zero throttle, for this reason.
    #[cold]
    pub(super) fn trip(&mut self, fault: Fault) {
        self.clear_periods = 0;
        if self.faults.contains(fault) && self.phase == Phase::Idle {
            return;
        }
        if !self.faults.contains(fault) {
            self.fault_count = self.fault_count.saturating_add(1);
        }
        self.faults.insert(fault);
        self.rest(Phase::Idle);
    }

    /// Ends any drive: idle, parked or braked, nothing known of the rotor's position. The speed
    /// that is reported stays where it was the rotor's: the shaft turns on.
    #[cold]
    pub(super) fn rest(&mut self, phase: Phase) {
        let off = |phase| matches!(phase, Phase::Idle | Phase::Sense);
        if off(self.phase) && off(phase) {
            // All else has been at rest since the bridge was turned off.
            self.listen(phase);
            return;
        }
        if matches!(self.phase, Phase::Park | Phase::Ramp) {
            // That was the frame's speed, which the rotor may not have followed.
            self.seen.speed = Speed::ZERO;
        }
        if !matches!(self.phase, Phase::Idle | Phase::Sense | Phase::Charge) {
            // What the terminals told before they were driven is over.
            self.rotor = Rotor::Unknown;
            self.catch.restart();
        }
        self.listen(phase);
        self.plain = NOT_PLAIN;
        self.lost_periods = 0;
        self.slow_periods = 0;
        self.run_periods = 0;
        self.charge_periods = 0;
        self.commanded = [AlphaBeta::default(); 2];
        self.planned = Speed::ZERO;
        self.missing = Current::ZERO;
        self.torque = torque::State::default();
        self.wanted = Reference::default();
        self.inductance.begin();
        self.seen.i = Dq::default();
        self.seen.u = Dq::default();
        self.seen.bus_current = Current::ZERO;
        self.start = start::State::default();
        self.speed = speed::State::default();
        self.six_step.planner = planner::State::default();
        self.regulator = regulator::State::default();
    }

    /// Begins a phase in which nothing has been measured yet.
    #[inline(always)]
    fn listen(&mut self, phase: Phase) {
        self.phase = phase;
        self.seen.phase = phase;
        self.settling_periods = SETTLING_PERIODS;
        self.sensing.restart();
        self.looks = 0;
        self.tone.end();
        self.pulling = pull::Pulling::default();
    }

    /// Until the open terminals tell the shaft's speed, what is reported falls as slowly as a large
    /// propeller coasts.
    pub(super) fn coast(&mut self, config: &Config) {
        let lost = config.coast.apply(self.seen.speed) + Speed::DELTA;
        self.seen.speed = self.seen.speed.saturating_sub(lost).max(Speed::ZERO);
    }
}
