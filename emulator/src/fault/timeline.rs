//! What is in force at a time.

use super::{Fault, Kind, Side};
use crate::plant::Breaks;
use crate::wire::WireErrors;

/// Everything that is wrong at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InForce {
    /// Broken wires and switches.
    pub breaks: Breaks,
    /// What stuck current sensors read, A.
    pub stuck_a: [Option<f64>; 3],
    /// How far the current sensors' zeros have moved, A.
    pub drift_a: [f64; 3],
    /// By which shares of the bench's the motor's resistance and flux have grown.
    pub motor_drift: [f64; 2],
    /// Extra noise on the currents, A rms.
    pub noise_a: f64,
    /// What stuck Hall sensors read.
    pub hall: [Option<bool>; 3],
    /// Voltage that the supply lacks, V.
    pub sag_v: f64,
    /// The supply is disconnected.
    pub disconnected: bool,
    /// The most that the supply gives in a brown-out, V.
    pub brown_out_v: Option<f64>,
    /// A fault of the bus has begun, whether it still acts or not.
    pub bus_weakened: bool,
    /// The shaft is held at standstill.
    pub blocked: bool,
    /// Sum of all kicks so far, rad/s.
    pub kicked_rad_s: f64,
    /// Wind, as a speed of the propeller, rad/s.
    pub wind_rad_s: f64,
    /// Torque on the shaft, Nm.
    pub torque_nm: f64,
    /// What is wrong with the throttle wire.
    pub wire: WireErrors,
    /// Number of resets that have begun.
    pub resets: usize,
    /// The chip is held in reset.
    pub held: bool,
    /// The flash refuses to change.
    pub flash_fails: bool,
}

/// The faults over time.
#[derive(Clone, Debug)]
pub struct Timeline {
    faults: Vec<Fault>,
    /// When to look again, s.
    pub due_s: f64,
    /// What was in force at the last look.
    pub now: InForce,
    /// Lasting effects of faults that are no longer in the list.
    past: InForce,
}

impl Timeline {
    /// Creates a time line; nothing is in force before the first look.
    pub fn new(faults: Vec<Fault>) -> Self {
        let due_s = faults.iter().map(|fault| fault.at_s);
        Self {
            due_s: due_s.fold(f64::INFINITY, f64::min),
            now: InForce::default(),
            past: InForce::default(),
            faults,
        }
    }

    /// Adds a fault at a time, replacing one of its kind, phase and switch that has begun.
    pub fn inject(&mut self, t_s: f64, fault: Fault) {
        self.forget(t_s, |old| old.kind.is_like(&fault.kind));
        self.faults.push(fault);
        self.due_s = t_s;
    }

    /// Returns the faults that have not been mended.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Ends everything that has begun. Its effect on the shaft stays.
    pub fn mend(&mut self, t_s: f64) {
        self.forget(t_s, |_| true);
        self.due_s = t_s;
    }

    /// Removes faults that have begun.
    fn forget(&mut self, t_s: f64, which: impl Fn(&Fault) -> bool) {
        for fault in self
            .faults
            .extract_if(.., |fault| fault.has_begun(t_s) && which(fault))
        {
            self.past.grow(&fault, t_s);
        }
        // These end with their fault.
        self.past.drift_a = [0.0; 3];
        self.past.motor_drift = [0.0; 2];
        self.past.held = false;
    }

    /// Looks at `t_s`, which does not decrease; returns what was in force before.
    pub fn look(&mut self, t_s: f64) -> InForce {
        self.due_s = self.next_s(t_s);
        let now = self.at(t_s);
        std::mem::replace(&mut self.now, now)
    }

    /// Returns what is in force at a time. Of two faults of a kind and phase that set a value the later entry counts;
    /// what adds up is added.
    fn at(&self, t_s: f64) -> InForce {
        let mut now = self.past;
        for fault in self.faults.iter().filter(|fault| fault.has_begun(t_s)) {
            now.grow(fault, t_s);
            if fault.acts(t_s) {
                now.add(fault.kind);
            }
        }
        now
    }

    /// Returns when something changes after `t_s`: `t_s` itself if it does in every period.
    fn next_s(&self, t_s: f64) -> f64 {
        // A weakened bus recovers after its fault.
        if self.past.bus_weakened || self.faults.iter().any(|fault| fault.moves(t_s)) {
            return t_s;
        }
        let times = self.faults.iter();
        let times = times.flat_map(|fault| [fault.at_s, fault.end_s()]);
        times
            .filter(|at_s| *at_s > t_s)
            .fold(f64::INFINITY, f64::min)
    }
}

/// The least share to which all drifts together change the motor's resistance or flux.
const LEAST_DRIFT: f64 = -0.9;

impl InForce {
    fn drift_motor(&mut self, which: usize, share: f64) {
        let drift = &mut self.motor_drift[which];
        *drift = (*drift + share).max(LEAST_DRIFT);
    }

    /// Adds the lasting effect of a fault, whether it still acts or not.
    fn grow(&mut self, fault: &Fault, t_s: f64) {
        self.bus_weakened |= fault.kind.weakens_bus();
        match fault.kind {
            Kind::OffsetDrift(phase, amps) => self.drift_a[phase] += amps * fault.share(t_s),
            Kind::ResistanceDrift(share) => self.drift_motor(0, share * fault.share(t_s)),
            Kind::FluxDrift(share) => self.drift_motor(1, share * fault.share(t_s)),
            Kind::RotorKick(rad_s) => self.kicked_rad_s += rad_s * fault.share(t_s),
            Kind::Reset => {
                self.resets += 1;
                self.held |= fault.for_s.is_some() && fault.acts(t_s);
            }
            _ => {}
        }
    }

    /// Adds a fault that acts.
    fn add(&mut self, kind: Kind) {
        match kind {
            Kind::RotorBlocked => self.blocked = true,
            Kind::PhaseOpen(phase) => self.breaks.0[phase].wire = true,
            Kind::MosfetOpen(phase, side) => self.breaks.0[phase].open[index(side)] = true,
            Kind::MosfetShort(phase, side) => self.breaks.0[phase].shorted[index(side)] = true,
            Kind::SensorStuck(phase, amps) => self.stuck_a[phase] = Some(amps),
            Kind::Noise(amps) => self.noise_a = libm::hypot(self.noise_a, amps),
            Kind::HallStuck(phase, level) => self.hall[phase] = Some(level),
            Kind::BusSag(volts) => self.sag_v += volts,
            Kind::BusDisconnect => self.disconnected = true,
            Kind::BrownOut(volts) => self.brown_out_v = Some(volts),
            Kind::Gust(rad_s) => self.wind_rad_s += rad_s,
            Kind::Strike(nm) => self.torque_nm += nm,
            Kind::SignalLoss => self.wire.lost = true,
            Kind::BitErrors(rate) => self.wire.bit_error_rate = rate,
            Kind::Jitter(ns) => self.wire.jitter_ns = ns,
            Kind::FlashFail => self.flash_fails = true,
            Kind::OffsetDrift(..)
            | Kind::ResistanceDrift(_)
            | Kind::FluxDrift(_)
            | Kind::RotorKick(_)
            | Kind::Reset => {}
        }
    }
}

/// Returns a switch's index in [`crate::plant::LegBreaks`].
fn index(side: Side) -> usize {
    match side {
        Side::Low => 0,
        Side::High => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(at_s: f64, for_s: Option<f64>, kind: Kind) -> Fault {
        Fault { at_s, for_s, kind }
    }

    #[test]
    fn a_fault_acts_for_its_time_or_to_the_end() {
        let timeline = Timeline::new(vec![
            fault(1.0, Some(0.5), Kind::PhaseOpen(2)),
            fault(1.2, None, Kind::BusSag(3.0)),
            fault(1.4, Some(1.0), Kind::BusSag(2.0)),
        ]);
        let open = |t_s| timeline.at(t_s).breaks.0[2].wire;
        assert_eq!([0.99, 1.0, 1.49, 1.5].map(open), [false, true, true, false]);
        let sag_v = |t_s| timeline.at(t_s).sag_v;
        assert_eq!([1.1, 1.3, 1.5, 9.0].map(sag_v), [0.0, 3.0, 5.0, 3.0]);
    }

    #[test]
    fn drifts_and_kicks_grow_over_their_time_and_stay() {
        let timeline = Timeline::new(vec![
            fault(1.0, Some(2.0), Kind::OffsetDrift(1, 4.0)),
            fault(1.0, None, Kind::OffsetDrift(0, -1.0)),
            fault(2.0, None, Kind::RotorKick(50.0)),
            fault(1.0, Some(4.0), Kind::ResistanceDrift(0.4)),
            fault(1.0, None, Kind::FluxDrift(-0.08)),
        ]);
        assert_eq!(timeline.at(0.5), InForce::default());
        assert_eq!(timeline.at(3.0).motor_drift, [0.2, -0.08]);
        assert_eq!(timeline.at(9.0).motor_drift, [0.4, -0.08]);
        // Some of each motor is left.
        let three = Timeline::new(vec![fault(1.0, None, Kind::FluxDrift(-0.45)); 3]);
        assert_eq!(three.at(9.0).motor_drift, [0.0, -0.9]);
        assert_eq!(timeline.at(1.5).drift_a, [-1.0, 1.0, 0.0]);
        assert_eq!(timeline.at(9.0).drift_a, [-1.0, 4.0, 0.0]);
        assert_eq!(timeline.at(1.9).kicked_rad_s, 0.0);
        assert_eq!(timeline.at(9.0).kicked_rad_s, 50.0);
    }

    #[test]
    fn it_is_looked_at_when_something_changes() {
        let mut timeline = Timeline::new(vec![
            fault(1.0, Some(0.5), Kind::RotorBlocked),
            fault(2.0, Some(1.0), Kind::OffsetDrift(0, 1.0)),
        ]);
        assert_eq!(timeline.due_s, 1.0);
        let mut due = |t_s| {
            timeline.look(t_s);
            timeline.due_s
        };
        assert_eq!([1.0, 1.5, 2.25].map(&mut due), [1.5, 2.0, 2.25]);
        assert_eq!(due(3.0), f64::INFINITY);
        assert_eq!(timeline.now.drift_a[0], 1.0);
    }

    #[test]
    fn what_is_injected_takes_the_place_of_its_like_and_can_be_mended() {
        let mut timeline = Timeline::new(vec![fault(9.0, None, Kind::BusDisconnect)]);
        for (t_s, kind) in [
            (1.0, Kind::Strike(0.1)),
            (2.0, Kind::Strike(0.2)),
            (2.0, Kind::RotorKick(50.0)),
            (3.0, Kind::RotorKick(50.0)),
            (3.0, Kind::OffsetDrift(1, 2.0)),
            (3.0, Kind::MosfetOpen(1, Side::Low)),
            (3.0, Kind::MosfetOpen(1, Side::High)),
            (3.0, Kind::Reset),
        ] {
            timeline.inject(t_s, fault(t_s, None, kind));
            assert_eq!(timeline.due_s, t_s);
            timeline.look(t_s);
        }
        assert_eq!(timeline.now.torque_nm, 0.2);
        assert_eq!(
            (timeline.now.kicked_rad_s, timeline.now.drift_a[1]),
            (100.0, 2.0)
        );
        assert_eq!(timeline.now.breaks.0[1].open, [true, true]);
        timeline.mend(4.0);
        timeline.look(4.0);
        let left = InForce {
            kicked_rad_s: 100.0,
            resets: 1,
            ..InForce::default()
        };
        assert_eq!((timeline.now, timeline.due_s), (left, 9.0));
        timeline.look(9.0);
        assert!(timeline.now.disconnected);
        timeline.mend(10.0);
        timeline.look(10.0);
        assert_eq!(timeline.due_s, 10.0, "the bus is watched");
        assert!(!timeline.now.disconnected);
    }

    #[test]
    fn a_reset_is_counted_and_held_only_with_a_time() {
        let timeline = Timeline::new(vec![
            fault(1.0, None, Kind::Reset),
            fault(2.0, Some(0.5), Kind::Reset),
        ]);
        let seen = |t_s| (timeline.at(t_s).resets, timeline.at(t_s).held);
        assert_eq!(seen(0.9), (0, false));
        assert_eq!(seen(1.0), (1, false));
        assert_eq!(seen(2.2), (2, true));
        assert_eq!(seen(2.5), (2, false));
    }
}
