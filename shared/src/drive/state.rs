//! What a control period remembers, and what of it the tasks may know.

use super::{Config, Fault, Faults};
use crate::control::observer::back_emf;
use crate::control::regulator::observer_based as regulator;
use crate::control::transform::Dq;
use crate::control::{speed, start};
use crate::protection;
use crate::units::{Angle, Current, Speed, Voltage};

/// What the drive is doing (start-up of the second paper, section 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// No drive; the bridge is off.
    Idle,
    /// The rotor is being aligned.
    Park,
    /// The current's vector turns faster and faster and the rotor follows.
    Ramp,
    /// The observer knows the rotor's position: field-oriented control.
    Run,
    /// The shaft coasts without torque or is slowed down to be stopped.
    Stopping,
    /// All low sides are on.
    Brake,
}

/// Everything that `step` remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub(super) phase: Phase,
    pub(super) faults: Faults,
    pub(super) fault_count: u32,
    /// Periods at zero throttle since the last sample that was a fault.
    pub(super) clear_periods: u32,
    pub(super) lost_periods: u32,
    pub(super) observer: back_emf::State,
    pub(super) regulator: regulator::State,
    pub(super) speed: speed::State,
    pub(super) start: start::State,
    pub(super) protection: protection::State,
    /// ω*.
    pub(super) reference: Speed,
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
    /// Electrical angle of the control's frame at the sample: the rotor's as estimated in Run and
    /// Stopping, an imposed one in Park and Ramp.
    pub angle: Angle,
    /// Estimated electrical speed.
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
}

/// Number of words in [`State::trace`].
pub const TRACE_WORDS: usize = 34;

impl State {
    /// The state at power-up: idle, without fault.
    pub fn new(config: &Config) -> Self {
        Self {
            phase: Phase::Idle,
            faults: Faults::NONE,
            fault_count: 0,
            clear_periods: 0,
            lost_periods: 0,
            observer: back_emf::State::default(),
            regulator: regulator::State::default(),
            speed: speed::State::default(),
            start: start::State::default(),
            protection: protection::State::new(&config.protection),
            reference: Speed::ZERO,
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
        if before.scale != now.scale {
            *self = Self {
                faults: self.faults,
                fault_count: self.fault_count,
                ..Self::new(now)
            };
        }
    }

    /// What the tasks may know.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            phase: self.seen.phase,
            faults: self.faults,
            fault_count: self.fault_count,
            angle: self.seen.angle,
            speed: self.seen.speed,
            speed_reference: self.reference,
            i: self.seen.i,
            u: self.seen.u,
            bus: self.protection.bus,
            bus_current: self.seen.bus_current,
        }
    }

    /// Every word of the control state: what two machines must agree on.
    pub fn trace(&self) -> [u32; TRACE_WORDS] {
        // Taken apart in full, so that a new field is not forgotten here.
        let Self {
            phase,
            faults,
            fault_count,
            clear_periods,
            lost_periods,
            observer: o,
            regulator: regulator::State { sigma },
            speed: speed::State { sigma: sigma_omega },
            start:
                start::State {
                    charge,
                    omega_s,
                    yielded,
                },
            protection,
            reference,
            seen,
        } = self;
        let charge = charge.to_bits();
        [
            *phase as i32,
            i32::from(faults.bits()),
            *fault_count as i32,
            *clear_periods as i32,
            *lost_periods as i32,
            o.theta.to_bits(),
            o.i.d.to_bits(),
            o.i.q.to_bits(),
            o.h.d.to_bits(),
            o.h.q.to_bits(),
            o.xi.to_bits(),
            o.omega_f.to_bits(),
            o.u_before.d.to_bits(),
            o.u_before.q.to_bits(),
            sigma.d.to_bits(),
            sigma.q.to_bits(),
            sigma_omega.to_bits(),
            charge as i32,
            (charge >> 32) as i32,
            omega_s.to_bits(),
            yielded.to_bits(),
            protection.bus.to_bits(),
            protection.bounds.min.to_bits(),
            protection.bounds.max.to_bits(),
            i32::from(protection.over_current_samples),
            reference.to_bits(),
            seen.phase as i32,
            seen.angle.to_bits(),
            seen.speed.to_bits(),
            seen.i.d.to_bits(),
            seen.i.q.to_bits(),
            seen.u.d.to_bits(),
            seen.u.q.to_bits(),
            seen.bus_current.to_bits(),
        ]
        .map(|word| word as u32)
    }

    /// Turns the bridge off until zero throttle, for this reason.
    #[cold]
    pub(super) fn trip(&mut self, fault: Fault) {
        if !self.faults.contains(fault) {
            self.fault_count = self.fault_count.saturating_add(1);
        }
        self.faults.insert(fault);
        self.clear_periods = 0;
        self.rest(Phase::Idle);
    }

    /// Ends any drive: idle, parked or braked, nothing known of the rotor's position. The speed
    /// that is reported stays where it was the rotor's: the shaft turns on.
    #[cold]
    pub(super) fn rest(&mut self, phase: Phase) {
        if matches!(self.phase, Phase::Park | Phase::Ramp) {
            // That was the frame's speed, which the rotor may not have followed.
            self.seen.speed = Speed::ZERO;
        }
        self.phase = phase;
        self.lost_periods = 0;
        self.reference = Speed::ZERO;
        self.seen.phase = phase;
        self.seen.i = Dq::default();
        self.seen.u = Dq::default();
        self.seen.bus_current = Current::ZERO;
        self.start = start::State::default();
        self.speed = speed::State::default();
        self.regulator = regulator::State::default();
    }

    /// With the bridge off the shaft cannot be seen: what is reported falls as slowly as a large
    /// propeller coasts.
    pub(super) fn coast(&mut self, config: &Config) {
        let lost = config.coast.apply(self.seen.speed) + Speed::DELTA;
        self.seen.speed = self.seen.speed.saturating_sub(lost).max(Speed::ZERO);
    }
}
