//! The control on a Cortex-M4F, emulated by QEMU: the same bits as on a PC after every control period, and
//! how many instructions a period takes.
//!
//! ```text
//! cargo test -p siskin-tests --features on-target --test on_target -- --nocapture --test-threads=1
//! ```
//!
//! A run is recorded on the emulator's bench ([`record`]), replayed by the program in `tests/on-target`
//! ([`target`]) and compared word for word. The tables ([`counts`]) are by what the drive did in a period.

mod counts;
mod record;
mod target;

use std::num::NonZero;
use std::path::Path;
use std::{slice, thread};

use counts::Counts;
use record::{Act, Run};
use siskin_control::drive::Phase;
use siskin_params::{ParamId, Params};

/// Instructions per control period of the default drive, including start-up and faults. At 24 kHz a 170 MHz chip has
/// 7083 clocks per period, an 84 MHz one 3500.
const STEP_MAX: Bounds = Bounds {
    median: 330,
    most: 625,
};

/// Instructions of the whole interrupt around it, in the first board's flight image: from the converters' registers to
/// the timer's, including taking the set-point, writing the fault record and publishing the snapshot.
const INTERRUPT_MAX: Bounds = Bounds {
    median: 460,
    most: 840,
};

/// The most of them in a period of steady flight: neither the mode changes nor the kind of set-point.
const STEADY_MOST: u32 = 700;

/// By how many periods each act of the flight is made longer, from none on: what is asked for, a snapshot every 16 periods
/// or so and a new set-point then meet all slots of the schedule.
const ALIGNMENTS: u32 = 16;

/// The most that counts may be.
struct Bounds {
    median: u32,
    most: u32,
}

impl Bounds {
    fn judge(&self, counts: &Counts) {
        let (all, Self { median, most }) = (&counts.all, self);
        assert!(
            all.median <= *median && all.most <= *most,
            "median {} of {median}, most {} of {most}",
            all.median,
            all.most
        );
    }
}

/// From power-up: a tone, started, through its speeds; a sensor fails and the fault is cleared; caught,
/// driven by torque and by voltage, stopped.
const FLIGHT: [(f64, Act); 14] = [
    (0.2, Act::Zero),
    (0.2, Act::Tone(1000.0)),
    (2.4, Act::Rpm(3000.0)),
    (0.7, Act::Rpm(4500.0)),
    (1.5, Act::Rpm(6000.0)),
    (1.0, Act::Rpm(1500.0)),
    (0.1, Act::SensorStuck),
    (0.5, Act::Zero),
    (1.2, Act::Rpm(3000.0)),
    (0.4, Act::Amperes(3.0)),
    (0.3, Act::Amperes(-2.0)),
    (0.5, Act::Share(0.5)),
    (0.8, Act::Zero),
    (0.6, Act::Stop),
];

/// A shorter version.
const HOP: [(f64, Act); 7] = [
    (0.05, Act::Zero),
    (1.35, Act::Rpm(3000.0)),
    (0.4, Act::Rpm(4000.0)),
    (0.02, Act::SensorStuck),
    (0.4, Act::Zero),
    (0.3, Act::Rpm(3000.0)),
    (0.3, Act::Zero),
];

/// Records a run, replays it on the chip, prints the counts, and returns them if all words agree.
fn replay(program: &Path, name: &str, changes: &[(ParamId, f32)], acts: &[(f64, Act)]) -> Counts {
    let run = Run::record(changes, acts, 0);
    let answer = target::replay(program, name, &run.request);
    let instructions = run.compare(&answer);
    let counts = Counts::new(&[(run.labels, instructions)]);
    println!(
        "{name}: the same bits in {} periods\n{counts}",
        counts.all.periods
    );
    counts
}

#[test]
fn the_default_drive_has_the_same_bits_and_a_short_period() {
    let counts = replay(&target::STEP, "default", &[], &FLIGHT);
    for phase in Phase::ALL {
        assert!(counts.has(phase), "the run is without {phase:?}");
    }
    assert!(counts.has_faults(), "the run is without a fault");
    let time_s = counts.all.periods as f32 / Params::default().get(ParamId::PwmFreqHz);
    assert!(time_s >= 10.0, "{time_s} s");
    STEP_MAX.judge(&counts);
}

/// Returns the results of `work` with 0 to `count`, in that order.
fn on_all_processors<T: Send>(count: u32, work: impl Fn(u32) -> T + Sync) -> Vec<T> {
    let processors = thread::available_parallelism().map_or(1, NonZero::get) as u32;
    let work = &work;
    let mut done: Vec<_> = thread::scope(|scope| {
        let share = |first| (first..count).step_by(processors as usize);
        let threads: Vec<_> = (0..processors)
            .map(|first| {
                scope.spawn(move || share(first).map(|n| (n, work(n))).collect::<Vec<_>>())
            })
            .collect();
        threads
            .into_iter()
            .flat_map(|thread| thread.join().expect("it panics with its own words"))
            .collect()
    });
    done.sort_by_key(|(n, _)| *n);
    done.into_iter().map(|(_, result)| result).collect()
}

#[test]
fn the_whole_interrupt_publishes_the_same_and_is_short() {
    let runs = on_all_processors(ALIGNMENTS, |longer| {
        let run = Run::record(&[], &FLIGHT, longer);
        let name = format!("interrupt-{longer}");
        let answer = target::replay(&target::INTERRUPT, &name, &run.request);
        let instructions = run.compare_interrupt(&answer);
        (run.labels, instructions)
    });
    for (longer, run) in runs.iter().enumerate() {
        let Counts { all, .. } = Counts::new(slice::from_ref(run));
        println!(
            "each act {longer} periods longer: at most {} instructions",
            all.most
        );
    }
    let counts = Counts::new(&runs);
    println!("the whole interrupt:\n{counts}");
    INTERRUPT_MAX.judge(&counts);
    let steady = counts.steady.as_ref().expect("the flight has some");
    assert!(steady.most <= STEADY_MOST, "steady flight: {}", steady.most);
}

#[test]
fn every_observer_has_the_same_bits() {
    for observer in [0.0, 1.0, 2.0] {
        let name = format!("observer-{observer}");
        replay(
            &target::PAPERS,
            &name,
            &[(ParamId::CtlObserver, observer)],
            &HOP,
        );
    }
}

#[test]
fn every_regulator_has_the_same_bits() {
    for regulator in [0.0, 2.0] {
        let name = format!("regulator-{regulator}");
        replay(
            &target::PAPERS,
            &name,
            &[(ParamId::CtlRegulator, regulator)],
            &HOP,
        );
    }
}

#[test]
fn the_six_step_drive_has_the_same_bits() {
    let changes = [(ParamId::CtlDrive, 1.0), (ParamId::PwmFreqHz, 40_000.0)];
    replay(&target::STEP, "six-step", &changes, &HOP);
}
