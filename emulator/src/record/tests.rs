use std::path::Path;

use siskin_control::control::delay::Delay;
use siskin_control::drive::{Bridge, Setpoint};
use siskin_control::params::{Params, build};

use super::{Recorder, Row};
use crate::bench::{Choice, LoadTable, MotorTable};
use crate::plant::{Fidelity, Sensing, Supply};
use crate::rig::{Bench, Rig};
use crate::shaft::Units;

fn rig() -> Rig {
    let sensing = Sensing::default();
    let config = build(&Params::default(), &sensing.board(Delay::One)).unwrap();
    let bench = Bench {
        motor: Choice::<MotorTable>::Named("antigravity-4006-kv380".to_owned())
            .motor()
            .unwrap(),
        load: Choice::<LoadTable>::Named("cfprop-13x4.4".to_owned())
            .load()
            .unwrap(),
        supply: Supply::stiff(24.0),
        plant: Fidelity::Averaged,
        sensing,
        hall_stuck: [None; 3],
        delay: Delay::One,
        dead_time_s: Some(500e-9),
        imposed_rad_s: None,
        initial_rad_s: 0.0,
        initial_angle_turns: 0.3,
        seed: 1,
    };
    Rig::new(bench, config)
}

fn read(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    assert_eq!(reader.headers().unwrap(), &Row::COLUMNS[..]);
    reader.deserialize().collect::<Result<_, _>>().unwrap()
}

#[test]
fn a_recording_gives_back_each_period() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    let mut rig = rig();
    let speed = rig.config().scale.speed_from_rpm(3150.0);
    let mut recorder = Recorder::create(&path).unwrap();
    let mut written = Vec::new();
    for k in 0..6000 {
        let setpoint = match k {
            0..100 => Setpoint::Stop,
            _ => Setpoint::Speed(speed),
        };
        let t_s = f64::from(k) * rig.period_s();
        let period = rig.period(setpoint);
        let (snapshot, units) = (rig.snapshot(), Units::of(rig.config()));
        recorder.write(t_s, &period, &snapshot, units).unwrap();
        written.push((t_s, period, Row::new(t_s, &period, &snapshot, units)));
    }
    recorder.finish().unwrap();

    let rows = read(&path);
    assert_eq!(rows.len(), written.len());
    for (row, (t_s, period, as_written)) in rows.iter().zip(&written) {
        assert_eq!(row, as_written);
        assert!((row.t_s - t_s).abs() < 1e-9, "{} for {t_s}", row.t_s);
        let high_off = matches!(period.bridge, Bridge::Off | Bridge::Charge(_));
        assert_eq!(row.duty_a.is_none(), high_off);
        let sum_a = row.i_a_a + row.i_b_a + row.i_c_a;
        assert!(sum_a.abs() < 1e-4, "{sum_a} A into the star's point");
        let apart = row.angle_est_deg - row.angle_deg - row.angle_error_deg;
        let turns = apart / 360.0;
        assert!(
            (turns - turns.round()).abs() < 1e-6,
            "{apart}° between the angles"
        );
        assert!((0.0..=360.0).contains(&row.angle_est_deg));
    }
    assert!(rows.iter().any(|row| row.duty_a.is_none()));
    assert!(rows.iter().any(|row| row.duty_a.is_some()));
}

#[test]
fn a_recording_without_a_period_has_its_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.csv");
    Recorder::create(&path).unwrap().finish().unwrap();
    assert_eq!(read(&path), []);
}

#[test]
fn what_cannot_be_recorded_is_one_line_with_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let error = |name: &str| {
        let path = folder.path().join(name);
        let text = Recorder::create(&path).unwrap_err().to_string();
        assert!(text.contains(name) && !text.contains('\n'), "{text}");
        assert!(!path.exists());
        text
    };
    assert!(error("run.txt").ends_with("the name must end in .csv"));
    assert!(error("run").ends_with("the name must end in .csv"));
    assert!(error("nowhere/run.csv").contains("cannot record to"));
}
