//! Self-test of a board before its motor turns.
//!
//! Each [`Item`] has a value, a unit and bounds; items a board cannot measure are omitted. Power-up measures
//! only those that need neither time nor the bridge; MAV_CMD_RUN_PREARM_CHECKS runs all of them. The command is
//! accepted under the rule for anything that may turn a motor: at rest, without a fault, the wire silent or at
//! valid zero. It is acknowledged by IN_PROGRESS with a percentage, and at the end by ACCEPTED, or by FAILED if
//! an item is out of bounds, with a STATUSTEXT naming such items. MAVLink FTP serves all lines as
//! `@SYS/check.txt`, which `siskin check` prints. Any throttle or fault fails the test.
//!
//! The motor does not turn, and no switch closes before its neighbours have been checked:
//!
//! | step | bridge | what it shows |
//! |---|---|---|
//! | listen, 72 ms | off | `supply`, `temperature`, `option_bytes`, `comparator_*`: all that power-up measures; `zero_*`, `noise_*`, `rest_*`: a terminal above ground has a shorted high side, and nothing is pulled |
//! | pull a, b, c up | one leg from duty 0 to full, the others off ([`Pull`]) | `high_*`: its terminal reaches the supply, so its high side and that driver's supply work. `motor_*`: the others follow through the windings. `off_*`: no current, so no low side is shorted |
//! | a to b, b to c, c to a | one leg up to a quarter, the next one's low side on, until a test's current flows | `low_*`: the current returns through that low side and its shunt, with the right sign |
//!
//! With all switches off the divider pulls a terminal to ground, so only current can show that a low side
//! works.

mod items;

pub use items::{Item, Kind, Line, Report};

use siskin_params::{Board, Params};
use siskin_units::math::{Real, square_root};
use siskin_units::{AdcCounts, Scale};

use crate::drive::{Phase, Pull, Sample, Snapshot};

/// The measurements a board makes for the self-test.
pub trait Probe {
    /// Returns the latest sample that the control has had, or could have.
    fn sample(&mut self) -> Sample;

    /// Measures an item only the board knows: [`Kind::OptionBytes`] or [`Kind::Comparator`]. May take a
    /// millisecond.
    fn own(&mut self, item: Item) -> Own;
}

/// A board's own measurement of an item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Own {
    /// The board cannot measure it.
    Absent,
    /// The bridge conducts, which it must not during the measurement: ask again.
    Busy,
    /// The value, in the item's unit.
    Value(f32),
}

/// Polls to discard while the set-point and its effect are still in the pipeline.
const LATENCY: u8 = 8;

/// Polls at power-up until the supply filter has settled.
const POWER_UP_POLLS: u8 = 3;

/// Polls averaged for the zero and its noise.
const LISTENED: u8 = 64;

/// Polls that the drive may take to see that the shaft is at rest.
const SHAFT_POLLS: u8 = 200;

/// The maximum polls to pull a leg up: at 8 kHz it takes 32 ms.
const UP_POLLS: u8 = 60;

/// The maximum polls to wait for a current through two legs.
const THROUGH_POLLS: u8 = 20;

/// The level at which a leg counts as up, percent of the supply.
const UP_PERCENT: f32 = 90.0;

/// Full-scale reading of a terminal, counts.
const FULL_SCALE: f32 = 4095.0;

/// A step of the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// No test is running.
    Over,
    /// The measurements that need neither time nor the bridge; the test then ends.
    PowerUp,
    /// The same measurements, and the sensors without current.
    Listen,
    /// Waits until the shaft is at rest.
    Shaft,
    /// Pulls a leg.
    Pull(Pull),
}

/// The outcome of a poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The test continues; percent done.
    Progress(u8),
    /// The test has ended.
    Done {
        /// Everything has been measured and is within its bounds.
        passed: bool,
    },
}

/// What follows a poll.
enum Next {
    /// Stay in this step.
    Wait,
    /// Go to the next step.
    Go(Step),
    /// End, with everything measured.
    Measured,
    /// End, with something left unmeasured.
    Abandoned,
}

impl Next {
    /// Goes to `step` if its precondition holds, else abandons the test.
    fn go_if(may: bool, step: Step) -> Self {
        if may { Self::Go(step) } else { Self::Abandoned }
    }
}

/// The drive's state at a poll.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Snapshot of the drive.
    pub snapshot: &'a Snapshot,
    /// Scale of its units.
    pub scale: &'a Scale,
    /// Board temperature, °C.
    pub temperature_c: f32,
    /// Nothing else asks the motor to turn.
    pub rests: bool,
}

impl Inputs<'_> {
    /// Returns true if the drive has a fault.
    fn faulted(&self) -> bool {
        !self.snapshot.faults.is_empty()
    }
}

/// A self-test and its results.
#[derive(Clone, Debug)]
pub struct Check {
    step: Step,
    /// Polls in this step.
    polls: u8,
    /// Sums of the current readings, and of their squares, A and A².
    sums: [f32; 3],
    squares: [f32; 3],
    /// What the board itself measures has been measured since power-up.
    has_looked: bool,
    /// Results so far.
    pub report: Report,
}

impl Check {
    /// Creates the power-up test.
    pub fn new(board: &Board) -> Self {
        Self {
            step: Step::PowerUp,
            polls: 0,
            sums: [0.0; 3],
            squares: [0.0; 3],
            has_looked: false,
            report: Report::new(board.current_range_a, board.current_a_per_count),
        }
    }

    /// Starts a full test.
    pub fn begin(&mut self) {
        self.report.clear();
        self.go(Step::Listen);
    }

    /// Returns true until what the board itself measures has been measured once, at power-up or by a test that came
    /// first; before that nothing energises the motor.
    pub fn powers_up(&self) -> bool {
        !self.has_looked
    }

    /// Returns the pull to ask of the drive while nothing turns the motor.
    pub fn pull(&self) -> Option<Pull> {
        match self.step {
            Step::Over | Step::PowerUp => None,
            Step::Listen | Step::Shaft => Some(Pull::Open),
            Step::Pull(pull) => Some(pull),
        }
    }

    /// Advances the test, about every millisecond, and returns news to report.
    // Out of line, so that its stack is free again for what the caller does next.
    #[inline(never)]
    pub fn poll(
        &mut self,
        inputs: &Inputs,
        (board, params): (&Board, &Params),
        probe: &mut impl Probe,
    ) -> Option<Outcome> {
        self.polls = self.polls.saturating_add(1);
        let next = match self.step {
            Step::Over => return None,
            Step::PowerUp => self.power_up(inputs, probe),
            _ if !inputs.rests => Next::Abandoned,
            Step::Listen => self.sensors(inputs, (board, params), probe),
            Step::Shaft => self.shaft(inputs),
            Step::Pull(pull) => {
                let share = terminals(board, &probe.sample());
                self.pulled(pull, inputs, &share, params)
            }
        };
        match next {
            Next::Wait => None,
            Next::Go(step) => Some(self.go(step)),
            Next::Measured => Some(self.end(params, true)),
            Next::Abandoned => Some(self.end(params, false)),
        }
    }

    /// Handles power-up, once the supply has had some readings.
    fn power_up(&mut self, inputs: &Inputs, probe: &mut impl Probe) -> Next {
        if self.polls < POWER_UP_POLLS || !self.own(inputs, probe) {
            return Next::Wait;
        }
        Next::Measured
    }

    /// Reads the sensors without current. No leg may be pulled while a terminal is at the supply.
    fn sensors(
        &mut self,
        inputs: &Inputs,
        (board, params): (&Board, &Params),
        probe: &mut impl Probe,
    ) -> Next {
        let sample = probe.sample();
        if self.polls > LATENCY {
            for (phase, counts) in sample.currents.into_iter().enumerate() {
                self.listen(phase, counts.to_f32() * board.current_a_per_count);
            }
        }
        if self.polls < LATENCY + LISTENED || !self.own(inputs, probe) {
            return Next::Wait;
        }
        for phase in 0..board.shunts.count() {
            self.judge(phase);
        }
        let share = terminals(board, &sample);
        for phase in 0..3 {
            self.report
                .set(Kind::Rest, phase, share[usize::from(phase)]);
        }
        Next::go_if(self.report.holds(Kind::Rest, params), Step::Shaft)
    }

    /// Waits for the drive to see that the shaft is at rest.
    fn shaft(&self, inputs: &Inputs) -> Next {
        let stands = inputs.snapshot.phase == Phase::Tone;
        if !stands && !inputs.faulted() && self.polls <= SHAFT_POLLS {
            return Next::Wait;
        }
        Next::go_if(stands, Step::Pull(Pull::UpA))
    }

    /// Checks the legs while one is pulled; `share` holds the terminals, in percent of the supply.
    fn pulled(&mut self, pull: Pull, inputs: &Inputs, share: &[f32; 3], params: &Params) -> Next {
        let faulted = inputs.faulted();
        let (leg, i) = (pull.leg(), inputs.snapshot.i);
        let [next_a, last_a] = [i.d, i.q].map(|i| inputs.scale.amperes(i));
        let up = self.polls > LATENCY && share[usize::from(leg)] >= UP_PERCENT;
        let most = if pull.is_through() {
            THROUGH_POLLS
        } else {
            UP_POLLS
        };
        if !up && !faulted && self.polls <= most {
            return Next::Wait;
        }
        let [next, last] = [(leg + 1) % 3, (leg + 2) % 3];
        if pull.is_through() {
            self.report.set(Kind::Low, next, next_a);
        } else {
            self.report.set(Kind::High, leg, share[usize::from(leg)]);
            self.followed(next, share, next_a);
            self.followed(last, share, last_a);
        }
        if pull == Pull::ThroughC && !faulted {
            return Next::Measured;
        }
        // A leg whose low side is shorted must not switch.
        let may = !faulted && self.report.holds(Kind::Off, params);
        Next::go_if(may, Step::Pull(Pull::from_number(pull as u8 + 1)))
    }

    fn go(&mut self, step: Step) -> Outcome {
        self.step = step;
        self.polls = 0;
        self.sums = [0.0; 3];
        self.squares = [0.0; 3];
        Outcome::Progress(match step {
            Step::Over | Step::PowerUp | Step::Listen => 0,
            Step::Shaft => 30,
            Step::Pull(pull) => 30 + 10 * pull as u8,
        })
    }

    fn end(&mut self, params: &Params, whole: bool) -> Outcome {
        // One that came before power-up's own measurements, and was broken off, leaves them to be made.
        self.go(if self.has_looked {
            Step::Over
        } else {
            Step::PowerUp
        });
        Outcome::Done {
            passed: whole && self.report.fits(params),
        }
    }

    /// Makes the measurements that need neither time nor the bridge; returns false if some must wait.
    fn own(&mut self, inputs: &Inputs, probe: &mut impl Probe) -> bool {
        let bus_v = inputs.scale.volts(inputs.snapshot.bus);
        self.report.set(Kind::Supply, 0, bus_v);
        self.report.set(Kind::Temperature, 0, inputs.temperature_c);
        for item in Item::OWN {
            match probe.own(item) {
                Own::Absent => {}
                Own::Busy => return false,
                Own::Value(value) => self.report.set(item.kind, item.phase, value),
            }
        }
        self.has_looked = true;
        true
    }

    /// Adds a current reading. Out of line, like the per-phase functions below: the loop would be unrolled,
    /// with a copy for each phase.
    #[inline(never)]
    fn listen(&mut self, phase: usize, current_a: f32) {
        self.sums[phase] += current_a;
        self.squares[phase] += current_a * current_a;
    }

    #[inline(never)] // as above
    fn judge(&mut self, phase: usize) {
        let [mean_a, square] =
            [self.sums, self.squares].map(|sums| sums[phase] / f32::from(LISTENED));
        self.report.set(Kind::Zero, phase as u8, mean_a);
        let variance = (square - mean_a * mean_a).max(0.0);
        self.report
            .set(Kind::Noise, phase as u8, square_root(variance));
    }

    /// Records a phase that is off while another is pulled up.
    #[inline(never)] // as above
    fn followed(&mut self, phase: u8, share: &[f32; 3], current_a: f32) {
        // An open wire follows neither of the others; a shorted switch shows with either.
        let before = self.report.get(Kind::Motor, phase);
        let follows = before.max(share[usize::from(phase % 3)]);
        self.report.set(Kind::Motor, phase, follows);
        let before_a = self.report.get(Kind::Off, phase);
        if before_a.is_nan() || before_a.abs() < current_a.abs() {
            self.report.set(Kind::Off, phase, current_a);
        }
    }
}

/// Returns the terminal voltages, percent of the supply or of their full scale.
fn terminals(board: &Board, sample: &Sample) -> [f32; 3] {
    let bus_v = sample.bus.to_f32() * board.bus_v_per_count;
    let whole = (bus_v / board.terminal_v_per_count).clamp(1.0, FULL_SCALE);
    sample
        .terminals
        .map(|counts: AdcCounts| 100.0 * counts.to_f32() / whole)
}
