//! The self-test by command, on the emulated ESC: a sound one passes, each defect is named, the motor does
//! not turn, and it runs only when a motor may be turned. An identification ends at a defect, too.

mod station;

use mavlink::dialects::ardupilotmega::{MavCmd, MavResult};
use siskin_emulator::device::Start;
use siskin_emulator::fault::{Fault, Kind, Side};
use siskin_params::{ParamId, Params};
use station::{HALF, Station, ZERO};

const CHECK: MavCmd = MavCmd::MAV_CMD_RUN_PREARM_CHECKS;

/// Creates an ESC with these defects and parameters.
fn bench(kinds: &[Kind], params: &[(ParamId, f32)]) -> Station {
    let at_s = 0.2;
    let fault = |kind: &Kind| Fault {
        at_s,
        for_s: None,
        kind: *kind,
    };
    Station::new(Start {
        overrides: params.to_vec(),
        faults: kinds.iter().map(fault).collect(),
        ..Start::default()
    })
}

/// Runs a whole self-test; returns how it ends.
fn check(station: &mut Station) -> MavResult {
    station.ask(CHECK, 0.0);
    station.run(1500, None);
    let (result, _) = *station.acks.last().expect("it is acknowledged");
    result
}

/// Returns what is out of bounds, from the text that reports it.
fn named(station: &Station) -> Vec<&str> {
    let told = station
        .texts
        .iter()
        .find_map(|text| text.strip_prefix("Self-test: "));
    told.map_or(Vec::new(), |names| names.split(", ").collect())
}

#[test]
fn a_sound_esc_passes_and_its_motor_does_not_turn() {
    for changes in [
        &[][..],
        &[(ParamId::MotStop, 0.0)],
        &[(ParamId::CtlDrive, 1.0), (ParamId::CtlRpmMax, 4500.0)],
        &[(ParamId::CtlRpmMax, 2000.0), (ParamId::PwmFreqHz, 8_000.0)],
        &[(ParamId::PwmFreqHz, 48_000.0)],
        &[(ParamId::MotDir, 1.0)],
        &[(ParamId::LimPhaseA, 5.0)],
    ] {
        let mut station = bench(&[], changes);
        assert_eq!(
            check(&mut station),
            MavResult::MAV_RESULT_ACCEPTED,
            "{changes:?}"
        );
        assert!(station.texts.is_empty(), "{:?}", station.texts);
        let going = &station.acks[..station.acks.len() - 1];
        assert!(
            going
                .iter()
                .all(|(result, _)| *result == MavResult::MAV_RESULT_IN_PROGRESS)
        );
        let percents: Vec<_> = going.iter().map(|(_, percent)| *percent).collect();
        assert_eq!(percents, [255, 30, 40, 50, 60, 70, 80, 90]);
        // A fifth of LIM_PHASE_A, plus what a period or two of delay add.
        let limit = Params::default().get(ParamId::LimPhaseA);
        assert!(
            station.current_a < 0.35 * f64::from(limit),
            "{}",
            station.current_a
        );
        assert!(station.rpm < 30.0, "{} rpm", station.rpm);
        // Again, once it has finished.
        assert_eq!(check(&mut station), MavResult::MAV_RESULT_ACCEPTED);
    }
}

#[test]
fn each_defect_is_named() {
    for (phase, letter) in ["a", "b", "c"].into_iter().enumerate() {
        let own = |kind: &str| format!("{kind}_{letter}");
        for (kind, item) in [
            (Kind::MosfetOpen(phase, Side::High), own("high")),
            (Kind::MosfetOpen(phase, Side::Low), own("low")),
            (Kind::MosfetShort(phase, Side::High), own("rest")),
            (Kind::PhaseOpen(phase), own("motor")),
            (Kind::SensorStuck(phase, 0.0), own("noise")),
            (Kind::SensorStuck(phase, 30.0), own("zero")),
            (Kind::OffsetDrift(phase, 6.0), own("zero")),
            (Kind::OffsetDrift(phase, -6.0), own("zero")),
        ] {
            // The tunes would find an offset first.
            let mut station = bench(&[kind], &[(ParamId::MotToneA, 0.0)]);
            assert_eq!(
                check(&mut station),
                MavResult::MAV_RESULT_FAILED,
                "{kind:?}"
            );
            let named = named(&station);
            assert!(named.contains(&item.as_str()), "{kind:?}: {named:?}");
            assert!(station.rpm < 60.0, "{kind:?}: {} rpm", station.rpm);
        }
    }
    let mut station = bench(&[Kind::Noise(1.0)], &[]);
    assert_eq!(check(&mut station), MavResult::MAV_RESULT_FAILED);
    assert_eq!(named(&station)[..3], ["noise_a", "noise_b", "noise_c"]);
}

/// A short in another leg shows while one is pulled up with rising duty: by the test's current, before one
/// that trips. The first leg pulled has none before it, and shoots through as it would at a start.
#[test]
fn a_shorted_low_side_is_named_by_a_small_current() {
    for phase in 0..3 {
        let short = Kind::MosfetShort(phase, Side::Low);
        let mut station = bench(&[short], &[(ParamId::MotToneA, 0.0)]);
        assert_eq!(check(&mut station), MavResult::MAV_RESULT_FAILED);
        let item = ["high_a", "off_b", "off_c"][phase];
        assert!(named(&station).contains(&item), "{:?}", named(&station));
        let tripped = station
            .texts
            .iter()
            .any(|text| text == "Fault: over-current");
        assert_eq!(tripped, phase == 0, "{:?}", station.texts);
        if phase > 0 {
            assert!(station.current_a < 7.0, "{} A", station.current_a);
        }
    }
}

#[test]
fn it_is_done_at_rest_alone_and_ends_with_any_throttle() {
    // At zero throttle, as without a wire.
    let mut station = bench(&[], &[]);
    station.run(500, Some(ZERO));
    station.ask(CHECK, 0.0);
    station.run(1500, Some(ZERO));
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_ACCEPTED
    );

    // The throttle takes over the motor within the time of the frame that opens it.
    station.acks.clear();
    station.ask(CHECK, 0.0);
    station.run(150, Some(ZERO));
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_IN_PROGRESS
    );
    station.run(3, Some(HALF));
    station.pulls = 0;
    station.run(5, Some(HALF));
    assert!(station.pulls < 30, "{}", station.pulls);
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_FAILED
    );
    station.run(2000, Some(HALF));
    assert!(station.rpm > 3000.0, "{}", station.rpm);

    // While it turns or coasts, there is no self-test.
    station.acks.clear();
    station.pulls = 0;
    station.ask(CHECK, 0.0);
    station.run(50, Some(HALF));
    let rejected = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
    assert_eq!(station.acks, [(rejected, 0)]);
    assert_eq!(station.pulls, 0);
}

/// An identification's excitation regulates what the sensors read: one that is stuck must not let the others' current rise.
#[test]
fn a_stuck_current_sensor_ends_an_identification_before_the_windings_carry_more_than_the_limit() {
    for (phase, reads_a) in [(0, 0.0), (0, -5.0), (1, 3.0), (2, -20.0), (2, 8.0)] {
        for at_s in [0.0, 1.5, 2.5, 3.5, 4.5] {
            let stuck = Fault {
                at_s,
                for_s: None,
                kind: Kind::SensorStuck(phase, reads_a),
            };
            let mut station = Station::new(Start {
                faults: vec![stuck],
                ..Start::default()
            });
            let limit_a = f64::from(station.device.esc().params().get(ParamId::LimPhaseA));
            station.ask(MavCmd::MAV_CMD_USER_1, 1.0);
            station.run(7_000, None);
            let case = (phase, reads_a, at_s, &station.texts);
            assert!(
                station.current_a < limit_a,
                "{} A: {case:?}",
                station.current_a
            );
            let done = station
                .texts
                .iter()
                .any(|text| text == "Identification: done");
            assert!(!done, "{case:?}");
        }
    }
}
