//! The self-test of a board before its motor turns.
//!
//! Each [`Item`] has a value, a unit and bounds; items that a board cannot measure are left out. At
//! power-up only those are measured that need neither time nor the bridge. MAV_CMD_RUN_PREARM_CHECKS
//! asks for all of them. It is obeyed under the rule of what may turn a motor: at rest, without a
//! fault, the wire silent or at valid zero. It is acknowledged by IN_PROGRESS with a percentage, and at
//! the end by ACCEPTED, or by FAILED if an item is out of its bounds, with a STATUSTEXT that names such
//! items. MAVLink FTP has all lines in `@SYS/check.txt`, as `siskin check` shows them. Any throttle or
//! fault ends the test as failed.
//!
//! The motor does not turn, and no switch closes before its neighbours have been checked:
//!
//! | step | the bridge | what is seen |
//! |---|---|---|
//! | listen, 72 ms | off | `supply`, `temperature`, `option_bytes`, `comparator_*`, which are all that is measured at power-up; `zero_*`, `noise_*`, `rest_*`: a terminal that is not at ground has a shorted high side, and nothing is pulled |
//! | pull a, b, c up | one leg from duty 0 to the whole, the others off ([`Pull`]) | `high_*`: its terminal comes to the supply, so its high side and the supply of its driver work. `motor_*`: the others follow it through the windings. `off_*`: no current, so no low side is shorted |
//! | a to b, b to c, c to a | one leg up to a quarter, the low side of the next on, until a test's current flows | `low_*`: it comes back through that low side and its shunt, with the right sign |
//!
//! With all switches off a terminal is at ground by its divider, so the low sides show by their current
//! alone.

mod items;

pub use items::{Item, Kind, Line, Report};

use crate::drive::{Phase, Pull, Sample, Snapshot};
use crate::math::{Real, square_root};
use crate::params::{Board, Params};
use crate::units::{AdcCounts, Scale};

/// The measurements that a board makes for the self-test.
pub trait Probe {
    /// The latest sample that the control has, or could have, had.
    fn sample(&mut self) -> Sample;

    /// An item that only the board knows: [`Kind::OptionBytes`] and [`Kind::Comparator`]. It may take a
    /// millisecond.
    fn own(&mut self, item: Item) -> Own;
}

/// A board's measurement of an item of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Own {
    /// It has no means for it.
    Absent,
    /// The bridge conducts, and must not do so meanwhile: it is to be asked again.
    Busy,
    /// The value, in the item's unit.
    Value(f32),
}

/// Looks in which nothing is read: the set-point and its effect are still on their way.
const LATENCY: u8 = 8;

/// Looks at power-up until the supply's filter has settled.
const POWER_UP_LOOKS: u8 = 3;

/// Looks whose readings make a zero and its noise.
const LISTENED: u8 = 64;

/// Looks that the drive may take to see that the shaft stands.
const SHAFT_LOOKS: u8 = 200;

/// Looks for which a leg is pulled up, at most: at 8 kHz it takes 32 ms.
const UP_LOOKS: u8 = 60;

/// Looks for which a current through two legs is waited for.
const THROUGH_LOOKS: u8 = 20;

/// Percent of the supply from which a leg has come up.
const UP_PERCENT: f32 = 90.0;

/// The greatest reading of a terminal, counts.
const FULL_SCALE: f32 = 4095.0;

/// The step of a self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// No test is under way.
    Over,
    /// Measurements that need neither time nor the bridge, and then the end.
    PowerUp,
    /// Those measurements, and the sensors without current.
    Listen,
    /// The shaft must stand.
    Shaft,
    /// A leg is pulled.
    Pull(Pull),
}

/// The outcome of a look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It goes on, so many percent being done.
    Progress(u8),
    /// It has ended.
    Done {
        /// True if everything has been measured, and is within its bounds.
        passed: bool,
    },
}

/// What follows from a look.
enum Next {
    /// The step goes on.
    Wait,
    /// The next step.
    Go(Step),
    /// The end, with all measured.
    Measured,
    /// The end, with something left that could not be measured.
    Abandoned,
}

impl Next {
    /// The next step, if what it needs is so.
    fn go_if(may: bool, step: Step) -> Self {
        if may { Self::Go(step) } else { Self::Abandoned }
    }
}

/// The drive's state at a look.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// Of the drive.
    pub snapshot: &'a Snapshot,
    /// Its units.
    pub scale: &'a Scale,
    /// Temperature of the board, °C.
    pub temperature_c: f32,
    /// True if nothing else asks the motor to turn.
    pub rests: bool,
}

impl Sight<'_> {
    /// Returns true if the drive has a fault.
    fn faulted(&self) -> bool {
        !self.snapshot.faults.is_empty()
    }
}

/// A self-test and its results.
#[derive(Clone, Debug)]
pub struct Check {
    step: Step,
    /// Looks in this step.
    looks: u8,
    /// Sums of the readings of the currents, and of their squares, A.
    sums: [f32; 3],
    squares: [f32; 3],
    /// The results so far.
    pub report: Report,
}

impl Check {
    /// The test at power-up.
    pub fn new(board: &Board) -> Self {
        Self {
            step: Step::PowerUp,
            looks: 0,
            sums: [0.0; 3],
            squares: [0.0; 3],
            report: Report::new(board.current_range_a, board.current_a_per_count),
        }
    }

    /// Begins a whole one.
    pub fn begin(&mut self) {
        self.report.clear();
        self.go(Step::Listen);
    }

    /// Returns true until the measurements of power-up are made: no tune begins before, and nothing turns the
    /// motor.
    pub fn powers_up(&self) -> bool {
        self.step == Step::PowerUp
    }

    /// The pull that is asked of the drive, while nothing turns the motor.
    pub fn pull(&self) -> Option<Pull> {
        match self.step {
            Step::Over | Step::PowerUp => None,
            Step::Listen | Step::Shaft => Some(Pull::Open),
            Step::Pull(pull) => Some(pull),
        }
    }

    /// Goes on, about each millisecond. Returns the news to report.
    // Out of line: its stack is free for what the caller does next.
    #[inline(never)]
    pub fn look(
        &mut self,
        sight: &Sight,
        (board, params): (&Board, &Params),
        probe: &mut impl Probe,
    ) -> Option<Outcome> {
        self.looks = self.looks.saturating_add(1);
        let next = match self.step {
            Step::Over => return None,
            Step::PowerUp => self.power_up(sight, probe),
            _ if !sight.rests => Next::Abandoned,
            Step::Listen => self.sensors(sight, (board, params), probe),
            Step::Shaft => self.shaft(sight),
            Step::Pull(pull) => {
                let share = terminals(board, &probe.sample());
                self.pulled(pull, sight, &share, params)
            }
        };
        match next {
            Next::Wait => None,
            Next::Go(step) => Some(self.go(step)),
            Next::Measured => Some(self.end(params, true)),
            Next::Abandoned => Some(self.end(params, false)),
        }
    }

    /// A look at power-up, after some readings of the supply.
    fn power_up(&mut self, sight: &Sight, probe: &mut impl Probe) -> Next {
        if self.looks < POWER_UP_LOOKS || !self.own(sight, probe) {
            return Next::Wait;
        }
        Next::Measured
    }

    /// A look at the sensors without current. Before any leg is pulled no terminal may be at the supply.
    fn sensors(
        &mut self,
        sight: &Sight,
        (board, params): (&Board, &Params),
        probe: &mut impl Probe,
    ) -> Next {
        let sample = probe.sample();
        if self.looks > LATENCY {
            for (phase, counts) in sample.currents.into_iter().enumerate() {
                self.listen(phase, counts.to_f32() * board.current_a_per_count);
            }
        }
        if self.looks < LATENCY + LISTENED || !self.own(sight, probe) {
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

    /// A look whether the drive has seen that the shaft stands.
    fn shaft(&self, sight: &Sight) -> Next {
        let stands = sight.snapshot.phase == Phase::Tone;
        if !stands && !sight.faulted() && self.looks <= SHAFT_LOOKS {
            return Next::Wait;
        }
        Next::go_if(stands, Step::Pull(Pull::UpA))
    }

    /// A look at the legs while one is pulled, the terminals being at this share of the supply.
    fn pulled(&mut self, pull: Pull, sight: &Sight, share: &[f32; 3], params: &Params) -> Next {
        let faulted = sight.faulted();
        let (leg, i) = (pull.leg(), sight.snapshot.i);
        let [next_a, last_a] = [i.d, i.q].map(|i| sight.scale.amperes(i));
        let up = self.looks > LATENCY && share[usize::from(leg)] >= UP_PERCENT;
        let most = if pull.is_through() {
            THROUGH_LOOKS
        } else {
            UP_LOOKS
        };
        if !up && !faulted && self.looks <= most {
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
        self.looks = 0;
        self.sums = [0.0; 3];
        self.squares = [0.0; 3];
        Outcome::Progress(match step {
            Step::Over | Step::PowerUp | Step::Listen => 0,
            Step::Shaft => 30,
            Step::Pull(pull) => 30 + 10 * pull as u8,
        })
    }

    fn end(&mut self, params: &Params, whole: bool) -> Outcome {
        self.go(Step::Over);
        Outcome::Done {
            passed: whole && self.report.fits(params),
        }
    }

    /// Makes the measurements that need neither time nor the bridge. False if some are to be made later.
    fn own(&mut self, sight: &Sight, probe: &mut impl Probe) -> bool {
        let bus_v = sight.scale.volts(sight.snapshot.bus);
        self.report.set(Kind::Supply, 0, bus_v);
        self.report.set(Kind::Temperature, 0, sight.temperature_c);
        for item in Item::OWN {
            match probe.own(item) {
                Own::Absent => {}
                Own::Busy => return false,
                Own::Value(value) => self.report.set(item.kind, item.phase, value),
            }
        }
        true
    }

    /// Takes a reading of a current. Out of line, as what follows for each phase: a loop would be unrolled,
    /// and all of it be there three times.
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

    /// Records a phase that is off while another one is pulled up.
    #[inline(never)] // as above
    fn followed(&mut self, phase: u8, share: &[f32; 3], current_a: f32) {
        // An open wire follows none of the others; a shorted switch shows at any.
        let before = self.report.get(Kind::Motor, phase);
        let follows = before.max(share[usize::from(phase % 3)]);
        self.report.set(Kind::Motor, phase, follows);
        let before_a = self.report.get(Kind::Off, phase);
        if before_a.is_nan() || before_a.abs() < current_a.abs() {
            self.report.set(Kind::Off, phase, current_a);
        }
    }
}

/// The terminals' voltages, percent of the supply or of the most that they show.
fn terminals(board: &Board, sample: &Sample) -> [f32; 3] {
    let bus_v = sample.bus.to_f32() * board.bus_v_per_count;
    let whole = (bus_v / board.terminal_v_per_count).clamp(1.0, FULL_SCALE);
    sample
        .terminals
        .map(|counts: AdcCounts| 100.0 * counts.to_f32() / whole)
}
