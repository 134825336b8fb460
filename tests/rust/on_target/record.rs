//! A run on the emulator's bench, and what the chip must answer to it.

use std::mem::{Discriminant, discriminant};

use fixed::types::I1F31;
use siskin_control::build::build;
use siskin_control::drive::{Config, Phase, Sample, Setpoint, State, step};
use siskin_emulator::fault::InForce;
use siskin_emulator::rig::{Bench, Rig};
use siskin_on_target::{answer, request};
use siskin_params::{BOSSO_BENCH, ParamId, Params};
use siskin_units::{Current, Speed};

/// The interrupt publishes its first snapshot in the first period, and each further one before the last is older than
/// this, in periods: a millisecond.
const OLDEST: usize = 24;

/// What the drive is asked for, or suffers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Act {
    Stop,
    Zero,
    /// Hz.
    Tone(f64),
    Rpm(f32),
    Amperes(f32),
    /// Share of the supply voltage.
    Share(f64),
    /// Phase a's current sensor sticks at 35 A while a speed is requested.
    SensorStuck,
}

impl Act {
    fn setpoint(self, config: &Config) -> Setpoint {
        let scale = &config.scale;
        match self {
            Self::Stop => Setpoint::Stop,
            Self::Zero => Setpoint::Zero,
            Self::Tone(hz) => Setpoint::Tone(Speed::from_num(hz * f64::from(scale.period_s))),
            Self::Rpm(rpm) => Setpoint::Speed(scale.speed_from_rpm(rpm)),
            Self::Amperes(current_a) => Setpoint::Torque(scale.current_from_a(current_a)),
            Self::Share(share) => Setpoint::Voltage(I1F31::from_num(share)),
            Self::SensorStuck => Self::Rpm(3000.0).setpoint(config),
        }
    }

    fn wrong(self) -> InForce {
        InForce {
            stuck_a: match self {
                Self::SensorStuck => [Some(35.0), None, None],
                _ => [None; 3],
            },
            ..InForce::default()
        }
    }
}

/// What a period is counted as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Label {
    /// What the drive did.
    pub(crate) phase: Phase,
    /// Whether a fault held the bridge off.
    pub(crate) latched: bool,
    /// The kind of set-point.
    kind: Discriminant<Setpoint>,
}

/// A recorded run.
pub(crate) struct Run {
    /// The chip's input.
    pub(crate) request: Vec<u32>,
    /// One per period.
    pub(crate) labels: Vec<Label>,
    results: Vec<[u32; answer::RESULT_WORDS]>,
    snapshots: Vec<u32>,
}

impl Run {
    /// Records the acts, each for its number of seconds, on the default bench with its realistic sensing. Each is
    /// `longer` by a few periods.
    pub(crate) fn record(changes: &[(ParamId, f32)], acts: &[(f64, Act)], longer: u32) -> Self {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in changes {
            params.set(*id, *value).expect("in range");
        }
        let bench = Bench::default();
        let board = bench.sensing.board(bench.delay);
        let config = build(&params, &board).expect("the parameters fit the bench");
        let mut rig = Rig::new(bench, config.clone());
        // The rig's own state is private; this one does the same.
        let mut state = State::new(&config);
        let mut run = Self {
            request: request::set_up(&params, &board).to_vec(),
            labels: Vec::new(),
            results: Vec::new(),
            snapshots: Vec::new(),
        };
        let mut before = InForce::default();
        for (time_s, act) in acts {
            let now = act.wrong();
            rig.disturb(&before, &now);
            before = now;
            for _ in 0..(time_s / rig.period_s()) as u32 + longer {
                let period = rig.period(exchanged(act.setpoint(&config)));
                run.take(&config, &mut state, &period.sample, period.setpoint);
            }
        }
        run
    }

    fn take(&mut self, config: &Config, state: &mut State, sample: &Sample, setpoint: Setpoint) {
        let bridge = step(config, state, *sample, setpoint);
        let snapshot = state.snapshot();
        self.request.extend(request::period(sample, setpoint));
        self.labels.push(Label {
            phase: snapshot.phase,
            latched: !snapshot.faults.is_empty(),
            kind: discriminant(&setpoint),
        });
        self.results.push(answer::result(config, state, bridge));
        self.snapshots.push(answer::snapshot(&snapshot));
    }

    /// Checks the chip's answer word for word, and returns each period's instruction count.
    pub(crate) fn compare(&self, words: &[u32]) -> Vec<u32> {
        let (periods, rest) = words.as_chunks::<{ answer::PERIOD_WORDS }>();
        assert!(rest.is_empty() && periods.len() == self.results.len());
        let mut instructions = Vec::with_capacity(periods.len());
        for (n, (period, expected)) in periods.iter().zip(&self.results).enumerate() {
            let [result @ .., count] = period;
            assert_eq!(result, expected, "period {n}, {:?}", self.labels[n]);
            instructions.push(*count);
        }
        instructions
    }

    /// Like [`compare`](Self::compare), for the whole interrupt.
    pub(crate) fn compare_interrupt(&self, words: &[u32]) -> Vec<u32> {
        let (periods, rest) = words.as_chunks::<{ answer::INTERRUPT_WORDS }>();
        assert!(rest.is_empty() && periods.len() == self.snapshots.len());
        let mut instructions = Vec::with_capacity(periods.len());
        let mut published = 0;
        for (n, [snapshot, count]) in periods.iter().enumerate() {
            if *snapshot == self.snapshots[n] {
                published = n;
            }
            let expected = self.snapshots[published];
            assert_eq!(*snapshot, expected, "period {n}, {:?}", self.labels[n]);
            assert!(n - published < OLDEST, "period {n} of {published}");
            instructions.push(*count);
        }
        instructions
    }
}

/// Returns a set-point after the firmware's exchange, which carries a value's upper 24 bits.
fn exchanged(setpoint: Setpoint) -> Setpoint {
    let upper = |bits: i32| bits & !0xff;
    match setpoint {
        Setpoint::Speed(speed) => Setpoint::Speed(Speed::from_bits(upper(speed.to_bits()))),
        Setpoint::Torque(i_q) => Setpoint::Torque(Current::from_bits(upper(i_q.to_bits()))),
        Setpoint::Voltage(share) => Setpoint::Voltage(I1F31::from_bits(upper(share.to_bits()))),
        Setpoint::Tone(pitch) => Setpoint::Tone(Speed::from_bits(upper(pitch.to_bits()))),
        Setpoint::Test(i_q) => Setpoint::Test(Current::from_bits(upper(i_q.to_bits()))),
        Setpoint::Stop
        | Setpoint::Zero
        | Setpoint::Fault(_)
        | Setpoint::Pull(_)
        | Setpoint::Excite(_) => setpoint,
    }
}
