//! The same throttle on the emulator and on the virtual board, as motor and supply show it.
//!
//! The two runs are not identical. Readings, noise and instants differ, so the table is held to what these may
//! cause; each bound below was set before the runs were compared.
//!
//! | what differs | by how much | effect |
//! |---|---|---|
//! | PWM period: twice 3542 clocks, not 41.667 µs | 0.0094 % | speed lower by as much |
//! | instants of the readings after the middle of the low sides' on-time | 0.15 and 0.74 µs | ripple in the readings, which the regulators balance: the load demands the same torque |
//! | duty in timer clocks | 1/3542, rounded down | 7 mV at a terminal |
//! | a current's measured zero | half a count of 29 mA | copper loss below 1 mW |
//! | supply reading | 8 mV per count, not 17 mV | voltage within 0.05 % |
//! | the drivers charge for 1 ms in pulses of 7.8 µs, not for 63 µs | 120 periods | a start 5 ms later |
//! | when a frame is heard | a period | 0.04 ms |

use siskin_emulator::device::Device;
use siskin_emulator::machine::Onlooker;
use siskin_emulator::plant::{Gate, Gates};
use siskin_emulator::rig::{Period, Rig};
use siskin_emulator::surroundings::{Motion, Passage};

use super::scenario::{STEPS, board, play, start};
use crate::common::image;

/// The end of each step, over which means are taken, s.
const WINDOW_S: f64 = 0.25;

/// Share of a speed change up to which its time is taken.
const RISEN: f64 = 0.9;

/// The start's phases take as many periods in both, except that the board charges its drivers for 5 ms more;
/// the hand-over to the observer may come an electrical turn later, 10 ms at 500 rpm.
const START_WITHIN_S: f64 = 0.015;

/// A frame's millisecond, plus 0.1 % of the speed at the slowest ramp.
const CHANGE_WITHIN_S: f64 = 0.003;

/// The bench's supply, whose source has no resistance.
const SUPPLY_V: f64 = 24.0;

const RAD_S_PER_RPM: f64 = std::f64::consts::TAU / 60.0;

/// What a period shows.
#[derive(Clone, Copy, Default)]
struct Row {
    began_s: f64,
    length_s: f64,
    rpm: f64,
    copper_w: f64,
    torque_nm: f64,
    bus_a: f64,
    /// Largest minus smallest duty of the legs' high sides.
    spread: f64,
}

/// A run.
#[derive(Default)]
struct Run {
    rows: Vec<Row>,
    high_sides: HighSides,
    /// The emulator's gates.
    gates: Gates,
}

/// How long the high sides have been on in this period.
#[derive(Clone, Copy, Default)]
struct HighSides {
    on: [bool; 3],
    since_s: [f64; 3],
    sum_s: [f64; 3],
}

impl HighSides {
    fn change(&mut self, at_s: f64, leg: usize, gate: Gate) {
        if self.on[leg] {
            self.sum_s[leg] += at_s - self.since_s[leg];
        }
        self.on[leg] = gate.high;
        self.since_s[leg] = at_s;
    }

    /// Returns the largest minus the smallest duty of a period that ends.
    fn spread(&mut self, end_s: f64, length_s: f64) -> f64 {
        for leg in 0..3 {
            let high = self.on[leg];
            self.change(end_s, leg, Gate { high, low: !high });
        }
        let sums = std::mem::take(&mut self.sum_s);
        let longest = sums.into_iter().fold(0.0, f64::max);
        let shortest = sums.into_iter().fold(f64::MAX, f64::min);
        (longest - shortest) / length_s
    }
}

impl Run {
    fn note(&mut self, began_s: f64, length_s: f64, motion: &Motion) {
        let spread = self.high_sides.spread(began_s + length_s, length_s);
        self.rows.push(Row {
            began_s,
            length_s,
            rpm: motion.rpm(),
            copper_w: motion.flow.copper_w,
            torque_nm: motion.flow.torque_nm,
            bus_a: motion.bus_a,
            spread,
        });
    }

    /// Returns a mean over the window before a time.
    fn mean(&self, end_s: f64, of: impl Fn(&Row) -> f64) -> f64 {
        let rows = || self.window(end_s);
        let sum: f64 = rows().map(|row| of(row) * row.length_s).sum();
        sum / rows().map(|row| row.length_s).sum::<f64>()
    }

    fn window(&self, end_s: f64) -> impl Iterator<Item = &Row> {
        let window = end_s - WINDOW_S..end_s;
        let is_in = move |row: &&Row| window.contains(&row.began_s);
        self.rows.iter().filter(is_in)
    }

    /// Returns the time from a throttle change to a speed on the way from one to another, s.
    fn takes(&self, from_s: f64, rpm: f64, up: bool) -> Option<f64> {
        let mut rows = self.rows.iter().filter(|row| row.began_s >= from_s);
        let there = rows.find(|row| (row.rpm >= rpm) == up)?;
        Some(there.began_s - from_s)
    }
}

impl Onlooker for Run {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        let length_s = rig.period_s();
        let dead_time_s = rig.config().dead_time.share.to_num::<f64>() * length_s;
        let high_sides = &mut self.high_sides;
        self.gates
            .period(period.halves, length_s, dead_time_s, |at_s, leg, gate| {
                high_sides.change(t_s + at_s, leg, gate);
            });
        self.note(t_s, length_s, &period.motion);
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.note(t_s, passage.length_s, &passage.motion);
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        self.high_sides.change(time_ns as f64 * 1e-9, leg, gate);
    }
}

/// A figure from both runs, and how much they may differ.
struct Figure {
    what: String,
    emulator: f64,
    board: f64,
    within: f64,
}

impl Figure {
    fn agrees(&self) -> bool {
        (self.board - self.emulator).abs() <= self.within
    }
}

/// A quantity of a window: its name with the unit, its value, and its relative and absolute bound.
type Quantity = (&'static str, fn(&Run, f64) -> f64, [f64; 2]);

/// The load's torque goes with the square of the speed; the motor current with the torque; the supply current
/// with torque and speed, and the copper loss.
const QUANTITIES: [Quantity; 5] = [
    (
        "speed, rpm",
        |run, end_s| run.mean(end_s, |row| row.rpm),
        [0.0005, 1.0],
    ),
    (
        "load's torque, mNm",
        |run, end_s| 1e3 * load_nm(run, end_s),
        [0.005, 0.05],
    ),
    (
        "phase current, A rms",
        |run, end_s| rms_a(run, end_s),
        [0.02, 0.03],
    ),
    (
        "supply current, A",
        |run, end_s| load_bus_a(run, end_s),
        [0.01, 0.005],
    ),
    (
        "duties' spread, %",
        |run, end_s| 100.0 * run.mean(end_s, |row| row.spread),
        [0.0, 0.2],
    ),
];

/// Returns the motor's torque minus what has changed the speed.
fn load_nm(run: &Run, end_s: f64) -> f64 {
    run.mean(end_s, |row| row.torque_nm) - accelerating_nm(run, end_s)
}

/// Returns the supply current minus what has changed the speed: the power of that torque.
fn load_bus_a(run: &Run, end_s: f64) -> f64 {
    let rad_s = run.mean(end_s, |row| row.rpm) * RAD_S_PER_RPM;
    run.mean(end_s, |row| row.bus_a) - accelerating_nm(run, end_s) * rad_s / SUPPLY_V
}

/// Returns the torque that has changed the speed from one end of the window to the other: the regulator's
/// ripple of 2 rpm there is 0.2 mNm, and 1.5 mA from the supply at 25 %.
fn accelerating_nm(run: &Run, end_s: f64) -> f64 {
    let bench = start().bench;
    let inertia_kgm2 = bench.motor.inertia_kgm2 + bench.load.inertia_kgm2;
    let mut rows = run.window(end_s);
    let first = rows.next().expect("a window has periods");
    let last = rows.last().unwrap_or(first);
    let faster_rad_s = (last.rpm - first.rpm) * RAD_S_PER_RPM;
    inertia_kgm2 * faster_rad_s / (last.began_s - first.began_s)
}

/// Returns the current of one phase, from the loss in all.
fn rms_a(run: &Run, end_s: f64) -> f64 {
    let resistance_ohm = start().bench.motor.resistance_ohm;
    (run.mean(end_s, |row| row.copper_w) / (3.0 * resistance_ohm)).sqrt()
}

fn figures(emulator: &Run, board: &Run) -> Vec<Figure> {
    let mut figures = Vec::new();
    let (mut from_s, mut before_rpm) = (0.0, 0.0);
    for step in &STEPS {
        let end_s = step.until_ms as f64 * 1e-3;
        let Some(share) = step.share() else {
            (from_s, before_rpm) = (end_s, 0.0);
            continue;
        };
        let percent = 100.0 * share;
        for (name, value, [of_it, beyond]) in QUANTITIES {
            let (emulator, board) = (value(emulator, end_s), value(board, end_s));
            figures.push(Figure {
                what: format!("{percent:.0} %: {name}"),
                emulator,
                board,
                within: of_it * emulator.abs() + beyond,
            });
        }
        let rpm = emulator.mean(end_s, |row| row.rpm);
        let risen_rpm = before_rpm + RISEN * (rpm - before_rpm);
        let takes_s = |run: &Run| run.takes(from_s, risen_rpm, rpm > before_rpm);
        let within_s = if before_rpm == 0.0 {
            START_WITHIN_S
        } else {
            CHANGE_WITHIN_S
        };
        figures.push(Figure {
            what: format!("{percent:.0} %: time to {risen_rpm:.0} rpm, ms"),
            emulator: 1e3 * takes_s(emulator).unwrap_or(f64::NAN),
            board: 1e3 * takes_s(board).unwrap_or(f64::NAN),
            within: 1e3 * within_s,
        });
        (from_s, before_rpm) = (end_s, rpm);
    }
    figures
}

#[test]
fn speed_current_and_duty_are_the_emulator_s() {
    let image = image();
    let (mut emulated, _) = Device::start(start()).expect("it starts");
    let mut emulator = Run::default();
    play(&mut emulated, &STEPS, &mut emulator);
    let mut board = board(&image, start());
    let mut image_run = Run::default();
    play(&mut board, &STEPS, &mut image_run);

    let figures = figures(&emulator, &image_run);
    println!("| | emulator | virtual board | difference | may be |");
    println!("|---|---|---|---|---|");
    for Figure {
        what,
        emulator,
        board,
        within,
    } in &figures
    {
        let difference = board - emulator;
        println!("| {what} | {emulator:.3} | {board:.3} | {difference:+.3} | ±{within:.3} |");
    }
    let apart: Vec<_> = figures.iter().filter(|figure| !figure.agrees()).collect();
    let apart: Vec<_> = apart.iter().map(|figure| &figure.what).collect();
    assert!(
        apart.is_empty(),
        "apart by more than physics says: {apart:?}"
    );
}
