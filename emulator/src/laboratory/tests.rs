use siskin_control::drive::Phase;

use super::*;
use crate::rack::{EscState, Shaft};
use crate::record::Row;
use crate::scenario::{self, stand};

const MS: u64 = 1_000_000;

fn setup(escs: usize) -> Setup {
    let standing = stand("bosso", toml::Table::new()).unwrap();
    let signal = "bidirectional-dshot600".to_owned().try_into().unwrap();
    Setup {
        bench: standing.bench,
        escs,
        signal,
        params: standing.params,
        storage: None,
        records: false,
        traces: true,
    }
}

fn laboratory(escs: usize) -> Laboratory {
    Laboratory::set_up(setup(escs)).unwrap().0
}

/// Arms, and runs at half throttle for a while.
fn run_up(laboratory: &mut Laboratory) {
    laboratory.go_on_to(400 * MS).unwrap();
    for esc in 0..laboratory.rack().escs().len() {
        laboratory.set_throttle(esc, Some(0.5));
    }
    laboratory.go_on_to(2000 * MS).unwrap();
}

fn states(laboratory: &Laboratory) -> Vec<EscState> {
    laboratory.rack().states().collect()
}

#[test]
fn however_time_is_cut_it_is_the_same() {
    let (mut whole, mut cut) = (laboratory(2), laboratory(2));
    run_up(&mut whole);
    for until_ns in (0..=2000 * MS).step_by(370_001) {
        if until_ns > 400 * MS {
            let now_ns = 400 * MS;
            cut.go_on_to(now_ns).unwrap();
            cut.set_throttle(0, Some(0.5));
            cut.set_throttle(1, Some(0.5));
        }
        cut.go_on_to(until_ns).unwrap();
    }
    cut.go_on_to(2000 * MS).unwrap();
    assert_eq!(whole.trace_hash(1), cut.trace_hash(1));
    let rpm: Vec<_> = states(&whole).iter().map(|state| state.rpm).collect();
    assert!(rpm.iter().all(|rpm| (rpm - 3150.0).abs() < 30.0), "{rpm:?}");
    assert_eq!(
        rpm,
        states(&cut)
            .iter()
            .map(|state| state.rpm)
            .collect::<Vec<_>>()
    );
}

/// On each plant, and with a motor that is not ideal.
#[test]
fn a_shaft_that_runs_away_ends_the_run_at_once_and_says_when() {
    for plant in ["averaged", "switching"] {
        let mut bench = toml::Table::new();
        bench.insert("plant".to_owned(), plant.into());
        let standing = stand("whoop", bench).unwrap();
        let (mut laboratory, _) = Laboratory::set_up(Setup {
            bench: standing.bench,
            params: standing.params,
            ..setup(1)
        })
        .unwrap();
        laboratory.go_on_to(400 * MS).unwrap();
        let shaft = Shaft {
            torque_nm: Some(100.0),
            wind_rpm: None,
        };
        let change = Environment {
            shafts: vec![shaft],
            ..Environment::default()
        };
        laboratory.surround(&change).unwrap();
        let began = std::time::Instant::now();
        let line = laboratory.go_on_to(3000 * MS).unwrap_err().to_string();
        assert!(
            began.elapsed().as_secs_f64() < 1.0,
            "{plant}: {:?}",
            began.elapsed()
        );
        let at = line.strip_prefix("the simulated motor diverged at 0.40");
        assert!(
            at.is_some() && line.contains("a torque on the shaft"),
            "{line}"
        );
    }
}

#[test]
fn an_advance_in_several_strides_has_all_answers_and_one_mean() {
    let (mut whole, mut cut) = (laboratory(1), laboratory(1));
    for laboratory in [&mut whole, &mut cut] {
        run_up(laboratory);
        laboratory.begin();
    }
    whole.go_on_to(2100 * MS).unwrap();
    for until_ms in [2003, 2050, 2100] {
        cut.go_on_to(until_ms * MS).unwrap();
    }
    assert_eq!(whole.rack().answers(), cut.rack().answers());
    assert!((99..=100).contains(&cut.rack().answers().len()));
    assert_eq!(states(&whole), states(&cut));
}

#[test]
fn a_silent_wire_stops_the_motor() {
    let mut laboratory = laboratory(1);
    run_up(&mut laboratory);
    laboratory.set_throttle(0, None);
    laboratory.go_on_to(2400 * MS).unwrap();
    let state = states(&laboratory)[0];
    assert!(!state.armed && state.phase != Phase::Run, "{state:?}");
}

#[test]
fn a_parameter_is_set_as_by_a_ground_station() {
    let mut laboratory = laboratory(2);
    laboratory.set_param(1, ParamId::CtlRpmMax, 5000.0).unwrap();
    assert_eq!(laboratory.param(1, ParamId::CtlRpmMax), 5000.0);
    assert_ne!(laboratory.param(0, ParamId::CtlRpmMax), 5000.0);
    // No drive with so little inductance fits the board.
    let error = laboratory.set_param(0, ParamId::MotLUh, 0.1).unwrap_err();
    assert!(
        error.to_string().starts_with("MOT_L_UH = 0.1 is refused: "),
        "{error}"
    );
    run_up(&mut laboratory);
    let error = laboratory
        .set_param(0, ParamId::MotPolePairs, 7.0)
        .unwrap_err();
    assert!(error.to_string().ends_with("the motor turns"), "{error}");
}

#[test]
fn faults_are_listed_until_they_are_mended() {
    let mut laboratory = laboratory(2);
    run_up(&mut laboratory);
    let text = "at_s = 2.0, kind = 'rotor_blocked'";
    laboratory.inject(1, scenario::fault(text).unwrap(), text.to_owned());
    laboratory.go_on_to(2100 * MS).unwrap();
    assert!(states(&laboratory)[1].rpm == 0.0 && states(&laboratory)[0].rpm > 3000.0);
    assert_eq!(laboratory.faults(1), [text]);
    laboratory.mend(1);
    assert!(laboratory.faults(1).is_empty() && laboratory.faults(0).is_empty());
}

#[test]
fn surroundings_are_checked_before_any_of_them_acts() {
    let mut laboratory = laboratory(1);
    let shaft = Shaft {
        torque_nm: Some(1e3),
        wind_rpm: None,
    };
    let change = Environment {
        supply_v: Some(20.0),
        shafts: vec![shaft],
        ..Environment::default()
    };
    let error = laboratory.surround(&change).unwrap_err();
    assert_eq!(
        error.to_string(),
        "torque = 1000 is out of range; give -100 to 100"
    );
    laboratory.go_on_to(100 * MS).unwrap();
    assert!((states(&laboratory)[0].bus_v - 24.0).abs() < 0.1);
    let change = Environment {
        supply_v: Some(20.0),
        ..Environment::default()
    };
    laboratory.surround(&change).unwrap();
    laboratory.go_on_to(200 * MS).unwrap();
    assert!((states(&laboratory)[0].bus_v - 20.0).abs() < 0.1);
}

#[test]
fn mavlink_waits_to_be_taken_and_records_too() {
    let mut laboratory = Laboratory::set_up(Setup {
        records: true,
        ..setup(1)
    });
    let laboratory = &mut laboratory.as_mut().unwrap().0;
    laboratory.go_on_to(2000 * MS).unwrap();
    assert_eq!(laboratory.take_sent(1), [0xfd]);
    assert!(laboratory.take_sent(usize::MAX).len() > 100);
    assert!(laboratory.take_sent(1).is_empty());
    let bytes = laboratory.take_recorded(0).unwrap();
    let (rows, rest) = bytes.as_chunks::<{ Row::PACKED_BYTES }>();
    assert!(rest.is_empty() && rows.len() > 10_000);
    // Time, and 24 V at its place.
    assert_eq!(rows[0][..8], [0; 8]);
    assert_eq!(rows[0][74..78], 24.0_f32.to_le_bytes());
    assert_eq!(laboratory.take_recorded(0), Some(Vec::new()));
}
