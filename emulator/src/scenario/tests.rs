use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::*;

mod reference;

/// A fifth of a second of the start, in which half of the combinations demand too much.
const FILE: &str = r#"
    [bench]
    duration_s = 0.2
    [[signal]]
    at_s = 0.0
    rpm = 1000.0
    [[window]]
    name = "all"
    t0_s = 0.0
    t1_s = 0.2
    [[expect]]
    window = "all"
    key = "current_max_a"
    below = 5.0
    [[expect]]
    window = "run"
    key = "faults"
    equals = 0
    [sweep]
    "params.STA_RAMP_A" = [3.0, 8.0]
    "bench.scale.R" = [0.7, 1.3]
    [random]
    "bench.initial_angle_deg" = [-180.0, 180.0]
"#;

/// Never interrupted.
static ON: AtomicBool = AtomicBool::new(false);

fn plan(text: &str, options: &Options) -> Result<Plan, ScenarioError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenario.toml");
    std::fs::write(&path, text).unwrap();
    Plan::read(&path, options)
}

fn seeds(first: u64, last: u64) -> Options {
    Options {
        seeds: Some(first..=last),
        ..Options::default()
    }
}

#[test]
fn a_survey_counts_and_names_the_worst_run() {
    let plan = plan(FILE, &seeds(1, 3)).unwrap();
    let played = AtomicUsize::new(0);
    let survey = plan
        .survey(
            &AtomicBool::new(false),
            || {
                played.fetch_add(1, Ordering::Relaxed);
            },
            |_| (),
        )
        .unwrap();
    assert_eq!(played.into_inner(), 12);
    assert_eq!((survey.runs, survey.failed), (12, 6));
    assert!(survey.faults.is_empty());
    assert!(!survey.held());
    assert!((survey.sim_s - 12.0 * 0.2).abs() < 0.01);
    let [current, faults] = &survey.expectations[..] else {
        panic!("{:?}", survey.expectations);
    };
    assert_eq!((current.failed, faults.failed), (6, 0));
    assert_eq!((faults.worst, faults.wanted.as_str()), (Some(0.0), "0 ± 0"));
    assert_eq!(survey.failures.len(), 6);
    let currents = survey.failures.iter().map(|f| f.expectations[0].value);
    assert_eq!(
        current.worst,
        currents.max_by(|a, b| a.partial_cmp(b).unwrap()).unwrap()
    );

    // The worst run alone: the same figure.
    let alone = Options {
        set: current.place.set.clone(),
        ..seeds(current.place.seed, current.place.seed)
    };
    let outcome = self::plan(FILE, &alone).unwrap().play(&ON).unwrap();
    assert_eq!(outcome.expectations[0].value, current.worst);
    assert_eq!(outcome.drawn, current.place.drawn);
}

#[test]
fn an_interrupt_keeps_what_has_been_played() {
    let plan = plan(FILE, &seeds(1, 3)).unwrap();
    let stop = AtomicBool::new(false);
    let played = AtomicUsize::new(0);
    let survey = plan.survey(
        &stop,
        || {
            played.fetch_add(1, Ordering::Relaxed);
            stop.store(true, Ordering::Relaxed);
        },
        |_| (),
    );
    let survey = survey.unwrap();
    // Runs in parallel with the first are cut short, unless they have ended too.
    assert_eq!(survey.runs, played.into_inner());
    assert_eq!(survey.runs + survey.left_out, 12);
    assert!((1..12).contains(&survey.runs), "{} runs", survey.runs);
    assert_eq!(survey.expectations.len(), 2);
}

/// It has what was played until then, and no verdict on what was not.
#[test]
fn an_interrupted_run_keeps_what_has_been_played() {
    let text = FILE.split("[sweep]").next().unwrap();
    let plan = plan(text, &Options::default()).unwrap();
    let outcome = plan.play(&AtomicBool::new(true)).unwrap();
    assert!(outcome.interrupted);
    let sim_s = outcome.report.sim_s;
    assert!((0.0009..0.0011).contains(&sim_s), "{sim_s}");
    assert!(outcome.report.steps > 20);
    assert_eq!(outcome.report.windows[0].rpm_mean, Some(0.0));
    let held: Vec<_> = outcome.expectations.iter().map(|v| v.held).collect();
    assert_eq!(held, [None, None]);
    assert!(!plan.play(&ON).unwrap().interrupted);
}

#[test]
fn threads_and_order_change_nothing() {
    let plan = plan(FILE, &seeds(1, 2)).unwrap();
    let survey = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let survey = pool
            .build()
            .unwrap()
            .install(|| plan.survey(&AtomicBool::new(false), || (), |_| ()));
        let mut survey = serde_json::to_value(survey.unwrap()).unwrap();
        for key in ["wall_s", "sim_per_wall"] {
            survey[key].take();
        }
        survey
    };
    assert_eq!(survey(1), survey(3));
}

#[test]
fn seeds_make_other_runs() {
    let hash = |first, last| {
        plan(FILE, &seeds(first, last))
            .unwrap()
            .survey(&AtomicBool::new(false), || (), |_| ())
    };
    let hash = |first, last| hash(first, last).unwrap().trace_hash;
    assert_eq!(hash(1, 1), hash(1, 1));
    assert_ne!(hash(1, 1), hash(2, 2));
    assert_ne!(hash(1, 1), hash(1, 2));
}

#[test]
fn a_run_without_the_figure_is_the_worst() {
    let text = r#"
        [bench]
        duration_s = 0.01
        [[window]]
        name = "w"
        t0_s = 0.0
        t1_s = 0.01
        [[expect]]
        window = "w"
        key = "rpm_mean"
        below = 1.0
        # The last 10 us, in which no period begins.
        [sweep]
        "window.0.t0_s" = [0.0, 0.00999]
    "#;
    let survey =
        plan(text, &Options::default())
            .unwrap()
            .survey(&AtomicBool::new(false), || (), |_| ());
    let survey = survey.unwrap();
    assert_eq!((survey.failed, survey.expectations[0].worst), (1, None));
    assert_eq!(
        survey.expectations[0].options,
        "--seed 1 --set window.0.t0_s=0.00999"
    );
}

#[test]
fn a_run_that_the_esc_refuses_ends_no_other() {
    let text = r#"
        [bench]
        duration_s = 0.01
        [[expect]]
        window = "run"
        key = "faults"
        equals = 0.0
        [sweep]
        "params.CTL_RPM_MIN" = [7000.0, 300.0]
        "params.CTL_RPM_MAX" = [6000.0, 9000.0]
    "#;
    let plan = plan(text, &Options::default()).unwrap();
    let mut rows = Vec::new();
    let survey = plan.survey(&AtomicBool::new(false), || (), |run| rows.push(run.row()));
    let survey = survey.unwrap();
    assert_eq!((survey.runs, survey.failed, survey.refused), (3, 0, 1));
    assert_eq!(survey.exit_status(), 1);
    let refusal = &survey.refusals[0];
    assert!(refusal.error.contains("CTL_RPM_MIN"), "{refusal:?}");
    let again = "--seed 1 --set params.CTL_RPM_MAX=6000.0 --set params.CTL_RPM_MIN=7000.0";
    assert_eq!(refusal.options, again);
    let held: Vec<_> = rows.iter().map(|row| row.cell("held").clone()).collect();
    let wanted = plan.rows(0..4, &AtomicBool::new(false)).unwrap();
    assert_eq!(rows, wanted);
    let refused = rows
        .iter()
        .position(|row| matches!(row.cell("error"), Cell::Text(why) if *why == refusal.error));
    assert_eq!(
        held.iter().position(|held| *held == Cell::Flag(false)),
        refused
    );
    // Where nothing can be played, something is wrong with the file.
    let all = text.replace(", 300.0", "").replace(", 9000.0", "");
    let refused = self::plan(&all, &Options::default()).unwrap();
    let error = refused.survey(&AtomicBool::new(false), || (), |_| ());
    assert!(error.unwrap_err().to_string().contains("CTL_RPM_MIN"));
}

#[test]
fn what_is_wrong_with_one_run_is_said_with_its_options() {
    let wrong = |text: &str, options: &Options| match plan(text, options) {
        Ok(_) => panic!("{text} makes sense"),
        Err(error) => error.to_string(),
    };
    let swept = "[sweep]\n\"params.LIM_PHASE_A\" = [20.0, -1.0]";
    let line = wrong(swept, &Options::default());
    assert!(
        line.contains("LIM_PHASE_A = -1") && line.contains("--set"),
        "{line}"
    );
    let delay = "[sweep]\n\"bench.delay_periods\" = [0.0, 0.3]";
    let line = wrong(delay, &Options::default());
    assert!(line.contains("bench.delay_periods = 0.3"), "{line}");
    let record = Options {
        record: Some(PathBuf::from("/nowhere.csv")),
        ..seeds(1, 2)
    };
    let line = wrong("", &record);
    assert!(line.contains("--record"), "{line}");
}

#[test]
fn a_negative_speed_is_asked_for_as_such() {
    let text = r#"
        [bench]
        duration_s = 0.02
        [[signal]]
        at_s = 0.0
        rpm = -1000.0
        [[window]]
        name = "all"
        t0_s = 0.0
        t1_s = 0.02
        [[expect]]
        window = "all"
        key = "reached_s"
        below = 0.001
    "#;
    // The shaft is held at the speed: it counts as reached only if it is the commanded one.
    for (imposed, held) in [("-1000.0", true), ("1000.0", false)] {
        let text = text.replace(
            "duration_s",
            &format!("imposed_rpm = {imposed}\nduration_s"),
        );
        let outcome = plan(&text, &Options::default()).unwrap().play(&ON).unwrap();
        assert_eq!(outcome.held(), held, "{:?}", outcome.expectations);
    }
}

/// The emulator's own ESC, treated as a machine reachable only over its wire, does the same; what bypasses the wire is
/// refused.
#[test]
fn another_machine_plays_what_goes_over_the_wire() {
    let text = r#"
        [bench]
        duration_s = 0.5
        [[signal]]
        at_s = 0.0
        throttle = 0.0
        [[signal]]
        at_s = 0.35
        throttle = 0.3
        [[expect]]
        window = "run"
        key = "starts"
        equals = 1
    "#;
    let start = |start| Ok(crate::device::Device::start(start)?);
    let [there, here] = [
        plan(text, &Options::default())
            .unwrap()
            .play_on(&ON, start, |_| {}),
        plan(text, &Options::default()).unwrap().play(&ON),
    ]
    .map(Result::unwrap);
    assert!(there.held() && here.held());
    assert_eq!(there.report.trace_hash, here.report.trace_hash);

    let past = text.replace("throttle = 0.3", "rpm = 1000.0");
    let plan = plan(&past, &Options::default()).unwrap();
    let error = plan.play_on(&ON, start, |_| {}).err().unwrap().to_string();
    assert!(error.starts_with("signal.1: goes past the wire"), "{error}");
}
