//! Parameters that make no drive together: the motor is off, and the user told, until they do.

use mavlink::dialects::ardupilotmega::MavCmd;

use super::*;

const TWENTIETH: &str = "Motor off: CTL_BW_CUR_HZ 2000.000 above a twentieth of PWM_FREQ_HZ";

impl Bench {
    /// Returns the texts since the last call, put together from chunks, and forgets them.
    fn whole_texts(&mut self) -> Vec<String> {
        let mut whole = Vec::<String>::new();
        let mut goes_on = false;
        for text in self.texts.drain(..) {
            let is_full = text.len() == 50;
            match whole.last_mut() {
                Some(last) if goes_on => last.push_str(&text),
                _ => whole.push(text),
            }
            goes_on = is_full;
        }
        whole
    }

    fn restarted(&self) -> Self {
        let mut bench = Self::with(self.esc.params().clone());
        for _ in 0..3 {
            bench.esc.test_itself(&bench.snapshot, &mut check::Plain);
        }
        bench.poll();
        bench
    }

    fn may_turn(&mut self) -> bool {
        self.frames(400, 0);
        self.esc.telemetry().armed
    }
}

#[test]
fn the_motor_is_off_from_the_value_that_does_not_fit_to_the_one_that_does() {
    let mut bench = Bench::armed();
    let before = bench.config();
    bench.set("CTL_BW_CUR_HZ", 2000.0);
    bench.frames(3, 0);
    assert_eq!(bench.get(ParamId::CtlBwCurHz), 2000.0);
    assert!(!bench.esc.telemetry().armed);
    assert_eq!(bench.requests, [], "the drive keeps what it has");
    bench.frames(1_000, 0);
    assert!(!bench.esc.telemetry().armed);
    assert_eq!(bench.whole_texts(), [TWENTIETH]);

    bench.requests.clear();
    bench.set("CTL_BW_CUR_HZ", 0.0);
    bench.frames(3, 0);
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    assert_eq!(bench.config(), before);
    assert!(!bench.esc.telemetry().armed, "it is to be armed anew");
    assert!(bench.may_turn());
    assert_eq!(bench.whole_texts(), [""; 0]);
}

/// A file sets a parameter every few milliseconds, and what does not fit on the way may at its end.
#[test]
fn a_file_is_told_of_once_and_only_if_it_does_not_fit_in_the_end() {
    for (last, told) in [(0.0, None), (2000.0, Some(TWENTIETH))] {
        let mut bench = Bench::armed();
        for round in 0..100 {
            bench.set("CTL_BW_CUR_HZ", [2000.0, 0.0][round % 2]);
            bench.frames(5, 0);
            bench.set("LIM_BUS_V_MIN", [40.0, 10.0][round % 2]);
            bench.frames(5, 0);
        }
        bench.set("CTL_BW_CUR_HZ", last);
        bench.frames(2_000, 0);
        assert!(bench.whole_texts().iter().map(String::as_str).eq(told));
    }
}

#[test]
fn who_tries_to_arm_is_told_why_not() {
    let arm = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, 1.0);
    let test = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1);
    let identify = |bench: &mut Bench| bench.command(MavCmd::MAV_CMD_USER_1, 1.0);
    let check = |bench: &mut Bench| {
        bench.command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS, 0.0);
        for _ in 0..1_500 {
            bench.frames(1, 0);
            let snapshot = bench.snapshot;
            bench.esc.test_itself(&snapshot, &mut check::Plain);
        }
    };
    let throttle = |bench: &mut Bench| bench.frames(1_000, 500);
    type Act<'a> = &'a dyn Fn(&mut Bench);
    let acts: [(&str, Act); 5] = [
        ("arming", &arm),
        ("motor test", &test),
        ("identification", &identify),
        ("self-test", &check),
        ("throttle", &throttle),
    ];
    for (what, act) in acts {
        let mut bench = Bench::armed();
        bench.set("CTL_BW_CUR_HZ", 2000.0);
        bench.frames(2_000, 0);
        bench.whole_texts();
        act(&mut bench);
        bench.frames(50, 0);
        let told = bench.whole_texts();
        let times = told.iter().filter(|text| *text == TWENTIETH).count();
        assert_eq!(times, 1, "{what}: {told:?}");
        let lower = told.iter().any(|text| text.contains("lower it to arm"));
        assert!(!lower, "{what}: {told:?}");
    }
}

/// The PWM frequency is that of the last start, and the set may need another.
#[test]
fn what_fits_after_a_restart_only_says_so() {
    let mut bench = Bench::armed();
    bench.set("PWM_FREQ_HZ", 48_000.0);
    bench.set("CTL_BW_CUR_HZ", 2000.0);
    bench.frames(1_000, 0);
    assert!(!bench.esc.telemetry().armed);
    let told = ["Motor off: PWM_FREQ_HZ 48000.000 waits for a restart"];
    assert_eq!(bench.whole_texts(), told);
    let mut bench = bench.restarted();
    assert!(bench.may_turn());
    assert_eq!(bench.get(ParamId::PwmFreqHz), 48_000.0);
}

/// What is stored is what a restart finds.
#[test]
fn a_restart_with_what_does_not_fit_keeps_the_values_and_the_motor_off() {
    let mut bench = Bench::armed();
    bench.set("MOT_POLE_PAIRS", 11.0);
    bench.set("CTL_BW_CUR_HZ", 2000.0);
    bench.frames(1_500, 0);
    assert!(bench.requests.contains(&Request::Keep), "it is stored");
    let before = bench.esc.params().clone();

    let mut bench = bench.restarted();
    assert_eq!(bench.esc.params(), &before);
    assert!(
        bench.config().scale.period_s > 0.0,
        "the drive has one that fits"
    );
    assert!(!bench.may_turn());
    let told = bench.whole_texts();
    let times = told.iter().filter(|text| *text == TWENTIETH).count();
    assert_eq!(times, 1, "{told:?}");
    bench.set("CTL_BW_CUR_HZ", 1000.0);
    bench.frames(10, 0);
    assert!(bench.may_turn());
    assert_eq!(bench.get(ParamId::MotPolePairs), 11.0);
    let hz = 1.0 / bench.config().scale.period_s;
    assert!((hz - 24_000.0).abs() < 1.0, "{hz}");
}

/// It may be a fraction.
#[test]
fn the_text_has_the_value_as_it_was_set() {
    let mut bench = Bench::armed();
    bench.set("LIM_BUS_V_MIN", 30.25);
    bench.frames(1_000, 0);
    let told = ["Motor off: LIM_BUS_V_MIN 30.250 not below LIM_BUS_V_MAX"];
    assert_eq!(bench.whole_texts(), told);
}

/// While it turns, the motor keeps a set that makes a drive.
#[test]
fn what_does_not_fit_is_refused_while_the_motor_turns() {
    let mut bench = Bench::armed();
    bench.snapshot.phase = Phase::Run;
    bench.frames(2, 500);
    for (name, value) in [("CTL_BW_CUR_HZ", 2000.0), ("CTL_BW_SPD_HZ", 200.0)] {
        let id = ParamId::find(name).expect("in the table");
        let before = bench.get(id);
        bench.set(name, value);
        bench.frames(2, 500);
        assert_eq!(bench.get(id), before);
        assert!(bench.esc.telemetry().armed);
    }
}
