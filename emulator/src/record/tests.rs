use std::collections::BTreeMap;
use std::path::Path;

use siskin_control::build::build;
use siskin_control::drive::{Bridge, Setpoint};
use siskin_params::{BOSSO_BENCH, Delay, Params};
use vcd::{Command, ScopeItem, Value};

use super::{Recorder, Row};
use crate::machine::Onlooker;
use crate::plant::Gate;
use crate::plant::Sensing;
use crate::rig::{Bench, Period, Rig};
use crate::surroundings::Surroundings;
use crate::watch::Watch;

fn rig() -> Rig {
    let sensing = Sensing::default();
    let config = build(&Params::of(&BOSSO_BENCH), &sensing.board(Delay::One)).unwrap();
    let bench = Bench {
        sensing,
        dead_time_s: Some(500e-9),
        initial_angle_turns: 0.3,
        ..Bench::default()
    };
    Rig::new(bench, config)
}

/// Plays a start, calling `also` before each period is recorded, and returns what was recorded.
fn play(
    recorder: &mut Recorder,
    periods: u32,
    mut also: impl FnMut(&mut Recorder, u64),
) -> Vec<(f64, Period, Row)> {
    let mut rig = rig();
    let speed = rig.config().scale.speed_from_rpm(3150.0);
    let periods = (0..periods).map(|k| {
        let setpoint = match k {
            0..100 => Setpoint::Stop,
            _ => Setpoint::Speed(speed),
        };
        let t_s = f64::from(k) * rig.period_s();
        also(recorder, (t_s * 1e9) as u64);
        let period = rig.period(setpoint);
        recorder.period(t_s, &period, &rig).unwrap();
        (t_s, period, Row::of(t_s, &period, &rig))
    });
    periods.collect()
}

fn csv_rows(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    assert_eq!(reader.headers().unwrap(), &Row::COLUMNS[..]);
    reader.deserialize().collect::<Result<_, _>>().unwrap()
}

#[test]
fn a_csv_gives_back_each_period() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    let mut recorder = Recorder::create(&path).unwrap();
    let written = play(&mut recorder, 6000, |_, _| {});
    recorder.finish().unwrap();

    let rows = csv_rows(&path);
    assert_eq!(rows.len(), written.len());
    for (row, (t_s, period, as_written)) in rows.iter().zip(&written) {
        assert_eq!(row, as_written);
        assert!((row.t_s - t_s).abs() < 1e-9, "{} for {t_s}", row.t_s);
        let high_off = matches!(period.bridge, Bridge::Off | Bridge::Charge(_));
        assert_eq!(row.duty_a.is_none(), high_off);
        let sum_a = row.i_a_a + row.i_b_a + row.i_c_a;
        assert!(sum_a.abs() < 1e-4, "{sum_a} A into the star's point");
        let [estimate_deg, error_deg] =
            [row.angle_est_deg, row.angle_error_deg].map(Option::unwrap);
        let apart = estimate_deg - row.angle_deg - error_deg;
        let turns = apart / 360.0;
        assert!(
            (turns - turns.round()).abs() < 1e-6,
            "{apart}° between the angles"
        );
        assert!((0.0..=360.0).contains(&estimate_deg));
    }
    assert!(rows.iter().any(|row| row.duty_a.is_none()));
    assert!(rows.iter().any(|row| row.duty_a.is_some()));
}

#[test]
fn a_recording_without_a_period_has_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.csv");
    Recorder::create(&path).unwrap().finish().unwrap();
    assert_eq!(csv_rows(&path), []);
}

#[cfg(feature = "parquet")]
#[test]
fn a_parquet_gives_back_each_period_with_its_units() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use siskin_control::drive::Phase;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.parquet");
    let mut recorder = Recorder::create(&path).unwrap();
    let written = play(&mut recorder, 6000, |_, _| {});
    recorder.finish().unwrap();

    let rows: Vec<_> = super::parquet::read(&path).ok().unwrap().collect();
    assert_eq!(rows.len(), written.len());
    for (row, (_, _, as_written)) in rows.iter().zip(&written) {
        assert_eq!(row.as_ref(), Ok(as_written));
    }
    let phases: Vec<_> = written.iter().filter_map(|(_, _, row)| row.phase).collect();
    assert!(
        phases.contains(&Phase::Idle) && phases.contains(&Phase::Park),
        "{phases:?}"
    );

    let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
    let metadata = reader.metadata().file_metadata();
    let columns = metadata.schema_descr().columns();
    let names: Vec<_> = columns.iter().map(|column| column.name()).collect();
    assert_eq!(names, Row::COLUMNS);
    for pair in metadata.key_value_metadata().unwrap() {
        // A name ends with its unit, except for the phase's letter of a duty.
        let Some(name) = pair.key.strip_prefix("unit.") else {
            continue;
        };
        let unit = pair.value.as_deref().unwrap();
        let ending = name
            .rsplit('_')
            .find(|part| !matches!(*part, "est" | "ref"));
        let expected = if name.starts_with("duty") {
            "1"
        } else {
            ending.unwrap()
        };
        assert_eq!(unit.to_lowercase(), expected, "{name}");
    }
}

#[cfg(all(feature = "parquet", feature = "plot"))]
#[test]
fn both_tables_give_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let [csv, parquet] = ["run.csv", "run.parquet"].map(|name| {
        let path = folder.path().join(name);
        let mut recorder = Recorder::create(&path).unwrap();
        play(&mut recorder, 3000, |_, _| {});
        recorder.finish().unwrap();
        let picture = folder.path().join("picture.svg");
        crate::plot::plot(&path, &picture).unwrap();
        std::fs::read_to_string(&picture).unwrap()
    });
    assert_eq!(
        csv.replace("run.csv", ""),
        parquet.replace("run.parquet", "")
    );
    let cut = folder.path().join("cut.parquet");
    std::fs::write(&cut, b"PAR1").unwrap();
    let line = crate::plot::plot(&cut, &folder.path().join("picture.svg")).unwrap_err();
    let line = line.to_string();
    assert!(
        line.contains("cut.parquet") && !line.contains('\n'),
        "{line}"
    );
}

/// Returns each wire's changes with their times, ns.
fn wires(path: &Path) -> BTreeMap<String, Vec<(u64, u8)>> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut parser = vcd::Parser::new(file);
    let header = parser.parse_header().unwrap();
    assert_eq!(header.timescale, Some((1, vcd::TimescaleUnit::NS)));
    let mut names = BTreeMap::new();
    let ScopeItem::Scope(all) = &header.items[header.items.len() - 1] else {
        panic!("{header:?}")
    };
    for item in &all.items {
        let ScopeItem::Scope(scope) = item else {
            panic!("{item:?}")
        };
        for item in &scope.items {
            if let ScopeItem::Var(wire) = item {
                names.insert(wire.code, wire.reference.clone());
            }
        }
    }
    let bit = |value| u8::from(value == Value::V1);
    let mut now_ns = None;
    let mut wires: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for command in parser {
        let (code, value) = match command.unwrap() {
            Command::Timestamp(time_ns) => {
                assert!(now_ns < Some(time_ns) || now_ns.is_none(), "{time_ns}");
                now_ns = Some(time_ns);
                continue;
            }
            Command::ChangeScalar(code, value) => (code, bit(value)),
            other => panic!("{other:?}"),
        };
        let changes = wires.entry(names[&code].clone()).or_default();
        changes.push((now_ns.unwrap(), value));
    }
    wires
}

/// Returns a wire's value at a time.
fn at(changes: &[(u64, u8)], time_ns: u64) -> u8 {
    let next = changes.partition_point(|(change_ns, _)| *change_ns <= time_ns);
    changes[next - 1].1
}

/// Returns how long a wire is high from one time to another, ns.
fn high_ns(changes: &[(u64, u8)], from_ns: u64, to_ns: u64) -> u64 {
    let within = changes.iter().map(|change| change.0);
    let within = within.filter(|change_ns| (from_ns..to_ns).contains(change_ns));
    let times: Vec<_> = [from_ns].into_iter().chain(within).chain([to_ns]).collect();
    let stretches = times.windows(2);
    stretches
        .map(|ends| u64::from(at(changes, ends[0])) * (ends[1] - ends[0]))
        .sum()
}

#[test]
fn a_dump_has_the_bridge_and_the_throttle_to_the_nanosecond() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.vcd");
    let mut recorder = Recorder::create(&path).unwrap();
    let mut sent = vec![(0, 0)];
    let written = play(&mut recorder, 6000, |recorder, now_ns| {
        // As the device does: the edges since the previous period.
        for back_ns in [20_011, 7_002] {
            if now_ns > 40_000 {
                let level = 1 - sent[sent.len() - 1].1;
                sent.push((now_ns - back_ns, level));
                recorder.edge(now_ns - back_ns, level == 1).unwrap();
            }
        }
    });
    recorder.finish().unwrap();
    let wires = wires(&path);
    assert_eq!(wires.len(), 6 + 1 + 3 + 9 + 8, "{:?}", wires.keys());
    assert_eq!(wires["signal"], sent);

    let dead_ns = 500;
    for leg in ["a", "b", "c"] {
        let (high, low) = (
            &wires[&format!("{leg}_high")],
            &wires[&format!("{leg}_low")],
        );
        assert!(high.len() > 1000, "{} edges of {leg}", high.len());
        for (one, other) in [(high, low), (low, high)] {
            for on_ns in one
                .iter()
                .filter(|change| change.1 == 1)
                .map(|change| change.0)
            {
                // The other has been off for the dead time; rounding may take a nanosecond.
                assert_eq!(high_ns(other, on_ns.saturating_sub(dead_ns - 1), on_ns), 0);
                assert_eq!(at(other, on_ns), 0, "{leg} shorts at {on_ns} ns");
            }
        }
    }
    let mut checked = 0;
    for pair in written.windows(2) {
        let [(t_s, period, row), (end_s, ..)] = pair else {
            unreachable!()
        };
        let (from_ns, to_ns) = ((t_s * 1e9).round() as u64, (end_s * 1e9).round() as u64);
        let phase = format!("{:?}", row.phase.unwrap()).to_lowercase();
        assert_eq!(at(&wires[&phase], from_ns), 1, "{phase} at {from_ns} ns");
        assert_eq!(
            at(&wires["rotor_position_lost"], from_ns),
            row.faults.unwrap() >> 4 & 1
        );
        assert_eq!(at(&wires["hall_b"], from_ns), period.sample.hall >> 1 & 1);
        let [Bridge::Duty([_, b, _]), second] = period.halves else {
            continue;
        };
        assert_eq!(second, period.halves[0], "a delay of one period");
        // Both edges lie within the period, and one of them is late by the dead time.
        let duty: f64 = b.to_num();
        let wanted_ns = duty * (to_ns - from_ns) as f64 - f64::from(dead_ns as u32);
        let on_ns = high_ns(&wires["b_high"], from_ns, to_ns) as f64;
        assert!(
            (on_ns - wanted_ns.max(0.0)).abs() <= 3.0,
            "{on_ns} for {wanted_ns} ns at {t_s}"
        );
        checked += 1;
    }
    assert!(checked > 3000, "{checked} periods");
}

#[test]
fn a_log_has_each_frame_after_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.tlog");
    let mut recorder = Recorder::create(&path).unwrap();
    recorder.frame(1_234_567_899, b"first").unwrap();
    recorder.frame(2_000_000_000, b"second").unwrap();
    recorder.finish().unwrap();
    let mut expected = Vec::new();
    // Microseconds since 1970 without the two link bits, from 2020 on.
    for (time_us, frame) in [
        (1_577_836_801_234_564_u64, &b"first"[..]),
        (1_577_836_802_000_000, b"second"),
    ] {
        expected.extend(time_us.to_be_bytes());
        expected.extend(frame);
    }
    assert_eq!(std::fs::read(&path).unwrap(), expected);
}

/// Logs are passed on to others.
#[test]
fn a_log_has_no_key_of_signatures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.tlog");
    let mut recorder = Recorder::create(&path).unwrap();
    // SETUP_SIGNING is message 256, PARAM_SET 23.
    let frame = |id: [u8; 3]| [&[0xfd, 42, 0, 0, 1, 255, 190][..], &id, &[7; 44]].concat();
    recorder.frame(1_000_000, &frame([0, 1, 0])).unwrap();
    recorder.frame(2_000_000, &frame([23, 0, 0])).unwrap();
    recorder.finish().unwrap();
    let written = std::fs::read(&path).unwrap();
    assert_eq!(written[8..], frame([23, 0, 0]));
}

#[test]
fn what_cannot_be_recorded_is_one_line_with_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let error = |name: &str| {
        let path = folder.path().join(name);
        let text = Recorder::create(&path).err().unwrap().to_string();
        assert!(text.contains(name) && !text.contains('\n'), "{text}");
        assert!(!path.exists());
        text
    };
    for name in ["run.txt", "run"] {
        assert!(error(name).ends_with("the name must end in .csv, .parquet, .vcd or .tlog"));
    }
    for name in ["nowhere/run.csv", "nowhere/run.vcd", "nowhere/run.tlog"] {
        assert!(error(name).contains("cannot record to"));
    }
    #[cfg(not(feature = "parquet"))]
    assert!(error("run.parquet").contains("--features parquet"));
}

/// A machine whose control is not visible leaves the control's columns empty and its wires unknown, but has the figures
/// of the motor.
#[test]
fn without_the_control_the_motor_is_recorded() {
    let mut around = Surroundings::new(Bench {
        initial_rad_s: 100.0,
        ..Bench::default()
    });
    let low = Gate {
        high: false,
        low: true,
    };
    around.stretch([low, Gate::default(), Gate::default()], 50e-6);
    let passage = around.end_period().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [csv, vcd] = ["a.csv", "a.vcd"].map(|name| folder.path().join(name));
    for path in [&csv, &vcd] {
        let mut watch = Watch::new(
            [("all".to_owned(), 0.0, 1.0)],
            Some(Recorder::create(path).unwrap()),
        );
        watch.gates(10_000, 0, low);
        watch.passage(0.0, &passage);
        assert!(!watch.failed());
        let report = watch.finish(50e-6, 1.0).unwrap();
        assert_eq!((report.steps, &report.faults), (1, &None));
        let figures = &report.windows[0];
        let rpm = 100.0 * 60.0 / std::f64::consts::TAU;
        assert!((figures.rpm_mean.unwrap() - rpm).abs() < 1e-9);
        assert_eq!(figures.bus_v_mean, Some(24.0));
        assert_eq!((figures.starts, figures.lock_lost), (None, None));
        assert_eq!((figures.i_q_mean_a, figures.turned_back_deg), (None, None));
    }
    let rows = csv_rows(&csv);
    let [row] = &rows[..] else {
        panic!("{} rows", rows.len())
    };
    assert_eq!((row.phase, row.faults, row.i_q_a), (None, None, None));
    assert!((row.rpm - 954.93).abs() < 0.01 && row.bus_v == 24.0);
    let text = std::fs::read_to_string(&csv).unwrap();
    let line = text.lines().nth(1).unwrap();
    assert!(line.starts_with("0.0,,,954.9"), "{line}");
    let text = std::fs::read_to_string(&vcd).unwrap();
    // Six gates, the throttle and three Hall sensors begin; then a low side turns on.
    let levels = |level| text.lines().filter(|line| line.starts_with(level)).count();
    assert_eq!(levels('0') + levels('1'), 10 + 1, "{text}");
    assert!(text.contains("#10000"), "{text}");
}
