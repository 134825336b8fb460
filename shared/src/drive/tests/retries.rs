//! Faults of a drive that has proven itself, and of one that has not.

use siskin_units::Angle;

use super::*;

/// Beyond the trip of 28 A.
const OVER_CURRENT: [f64; 3] = [-15.0, -15.0, 30.0];

/// Far longer than any pause, s.
const LONG_S: f32 = 3.0;

/// A drive with a given rotor position, which turns at 3000 rpm whatever the bridge does, or stands.
struct Flight {
    bench: Bench,
    theta: Angle,
    stands: bool,
}

impl Flight {
    fn new(changes: &[(ParamId, f32)]) -> Self {
        let mut bench = Bench::new(changes);
        bench.config = bench
            .config
            .with_position_given(siskin_params::parts::Bench::HERE);
        let theta = Angle::ZERO;
        Self {
            bench,
            theta,
            stands: false,
        }
    }

    /// Both drives, at a speed that gives six-step enough periods per sextant.
    fn both(change: (ParamId, f32)) -> [Self; 2] {
        [0.0, 1.0].map(|drive| {
            let slow = (ParamId::CtlRpmMax, 4500.0);
            Self::new(&[(ParamId::CtlDrive, drive), slow, change])
        })
    }

    /// Both drives in flight, each with the set-point that turns it.
    fn proven(change: (ParamId, f32)) -> [(Self, Setpoint); 2] {
        Self::both(change).map(|flight| {
            let flight = flight.flown(true);
            let turn = flight.bench.turn();
            (flight, turn)
        })
    }

    fn fly(&mut self, sample: Sample, setpoint: Setpoint) {
        let rpm = if self.stands { 0.0 } else { 3000.0 };
        let omega = self.bench.config.scale.speed_from_rpm(rpm);
        self.theta = self.theta.wrapping_add(omega.over_period());
        self.bench.state.place(self.theta, omega);
        self.bench.run(1, sample, setpoint);
    }

    /// Runs for this many seconds without current.
    fn quiet(&mut self, seconds: f32, setpoint: Setpoint) {
        for _ in 0..self.bench.periods(seconds) {
            self.fly(sample([0.0; 3], 24.0), setpoint);
        }
    }

    /// Flies until the drive has proven itself, or for half that time.
    fn flown(mut self, proven: bool) -> Self {
        let turn = self.bench.turn();
        self.quiet(if proven { 0.4 } else { 0.2 }, turn);
        assert_eq!(self.bench.phase(), Phase::Run);
        self
    }

    /// Causes an over-current once the bridge is on.
    fn trip(&mut self) {
        let turn = self.bench.turn();
        let before = self.bench.state.snapshot().fault_count;
        while self.bench.faults().is_empty() {
            let off = self.bench.state.phase.is_off();
            let currents = if off { [0.0; 3] } else { OVER_CURRENT };
            self.fly(sample(currents, 24.0), turn);
        }
        assert!(self.bench.faults().contains(Fault::OverCurrent));
        assert_eq!(self.bench.phase(), Phase::Idle);
        assert_eq!(self.bench.state.snapshot().fault_count, before + 1);
    }

    /// Returns the seconds under this set-point until the fault ends, if it does.
    fn pause_s(&mut self, setpoint: Setpoint) -> Option<f32> {
        let periods = self.bench.periods(LONG_S);
        let ended = (0..periods).find(|_| {
            self.fly(sample([0.0; 3], 24.0), setpoint);
            self.bench.faults().is_empty()
        });
        ended.map(|periods| periods as f32 * self.bench.config.scale.period_s)
    }
}

const IN_FLIGHT: (ParamId, f32) = (ParamId::LimPolicy, 1.0);

#[test]
fn a_proven_drive_is_tried_again_three_times_with_growing_pauses_and_then_held() {
    for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
        for wanted_s in [0.02, 0.08, 0.32] {
            flight.trip();
            let pause_s = flight.pause_s(turn).expect("it is tried again");
            assert!((pause_s - wanted_s).abs() < 1e-3, "{pause_s}");
        }
        flight.trip();
        assert_eq!(flight.pause_s(turn), None);
        // Zero throttle ends it, and nothing remains of the previous flight.
        assert!(flight.pause_s(Setpoint::Zero).is_some());
        flight.trip();
        assert_eq!(flight.pause_s(turn), None);
    }
}

#[test]
fn a_retry_that_proves_itself_has_all_retries_again() {
    for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
        for _ in 0..5 {
            flight.trip();
            let pause_s = flight.pause_s(turn).expect("it is tried again");
            assert!((pause_s - 0.02).abs() < 1e-3, "{pause_s}");
            flight = flight.flown(true);
        }
    }
}

#[test]
fn a_pause_begins_when_the_cause_is_gone() {
    for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
        for _ in 0..flight.bench.periods(1.0) {
            flight.fly(sample([0.0; 3], 8.0), turn);
        }
        assert!(flight.bench.faults().contains(Fault::UnderVoltage));
        let pause_s = flight.pause_s(turn).expect("it is tried again");
        assert!((pause_s - 0.02).abs() < 2e-3, "{pause_s}");
    }
}

#[test]
fn zero_throttle_and_stop_take_the_retries() {
    for stopped in [Setpoint::Zero, Setpoint::Stop] {
        for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
            flight.trip();
            flight.quiet(1e-3, stopped);
            assert_eq!(flight.pause_s(turn), None, "{stopped:?}");
        }
        for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
            flight.stands = true;
            flight.quiet(0.01, stopped);
            flight.stands = false;
            flight.trip();
            assert_eq!(flight.pause_s(turn), None, "{stopped:?}, in the next start");
        }
    }
}

#[test]
fn a_start_that_has_not_proven_itself_is_not_tried_again() {
    for flight in Flight::both(IN_FLIGHT) {
        let mut flight = flight.flown(false);
        let turn = flight.bench.turn();
        flight.trip();
        assert_eq!(flight.pause_s(turn), None);
    }
}

#[test]
fn on_the_bench_a_fault_holds_until_zero_throttle() {
    for (mut flight, turn) in Flight::proven((ParamId::LimPolicy, 0.0)) {
        flight.trip();
        assert_eq!(flight.pause_s(turn), None);
        let pause_s = flight.pause_s(Setpoint::Zero).expect("zero throttle");
        assert!((pause_s - 0.3).abs() < 1e-3, "{pause_s}");
    }
}

#[test]
fn what_cannot_pass_by_itself_is_not_tried_again() {
    for fault in Fault::ALL {
        for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
            flight.quiet(1e-3, Setpoint::Fault(fault));
            let tried = flight.pause_s(turn).is_some();
            assert_eq!(tried, fault.is_retried(), "{fault:?}");
        }
    }
}

#[test]
fn two_faults_of_which_one_cannot_pass_hold() {
    for (mut flight, turn) in Flight::proven(IN_FLIGHT) {
        flight.trip();
        flight.quiet(1e-3, Setpoint::Fault(Fault::OverTemperature));
        assert_eq!(flight.pause_s(turn), None);
    }
}
