//! One cell: an ESC flies, a fault occurs, and the outcome is noted.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use serde::Serialize;
use siskin_control::drive::{Bridge, Limit, Phase, Snapshot};
use siskin_params::{BOSSO_BENCH, ParamId};

use super::drive::Drive;
use super::moment::{Moment, OPENS_S};
use super::row::{Expected, Reaction, Row};
use crate::device::{Device, Start, StartError};
use crate::fault::Fault;
use crate::link::Ids;
use crate::machine::Onlooker;
use crate::parameter;
use crate::plant::{Extras, Fidelity, Winding};
use crate::rig::{Bench, Period, Rig};
use crate::scenario::dshot_bits;

/// Time for which the throttle stays unchanged after a fault, s.
const WATCHED_S: f64 = 2.0;
/// Then it is closed for this long, s: faults end, and a restarted chip is armed.
const CLOSED_S: f64 = 1.5;
/// And then opened for this long, s.
const AGAIN_S: f64 = 2.2;
/// The throttle of that flight.
const AGAIN: f64 = 0.5;
/// The motor's speed is judged over the last this many seconds of a stretch.
const LOOKED_S: f64 = 0.1;
/// Allowed deviation of a speed from the commanded one, as a share of it.
const NEAR: f64 = 0.05;

/// When the search for the greatest current starts, s after a fault: the control periods until a fault can be detected
/// do not count.
const SETTLED_S: f64 = 200e-6;

/// A DShot600 frame every millisecond.
const FRAME_NS: u64 = 1_000_000;
const DSHOT600: u8 = 12;

/// Throttle texts that follow from what has been named, and texts about what has ended.
const FOLLOWS: [&str; 3] = ["Throttle: DShot", "Throttle is open", "Fault ended: "];

/// What is set while the flash fails, and its value: it acts at once, in flight too.
const CHANGED: (ParamId, f32) = (ParamId::TelRateHz, 20.0);

/// `CTL_OBSERVER` of a motor with Hall sensors.
const HALL_OBSERVER: f32 = 2.0;

/// The bell in the propeller's wash, K/W and J/K; as the bench `bosso-real` has it.
const WINDING: Winding = Winding {
    resistance_k_per_w: 4.0,
    capacity_j_per_k: 20.0,
};

/// The outcome of a fault.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// The fault.
    pub fault: Row,
    /// When it occurred.
    pub moment: Moment,
    /// How the motor was driven.
    pub drive: Drive,
    /// The ESC's reaction.
    pub reaction: Reaction,
    /// What has been named since, in texts and as a latched fault.
    pub named: BTreeSet<String>,
    /// Limits that have bound since, and not before.
    pub limits: BTreeSet<&'static str>,
    /// From the fault to the first reaction or name, ms.
    pub after_ms: Option<f64>,
    /// From a current beyond the comparators' level to gates off, µs, if they have acted since the fault.
    pub trip_us: Option<f64>,
    /// Greatest phase current from 200 µs after the fault on, A, at each edge of the switches.
    pub current_a: f64,
    /// Greatest voltage of the supply since the fault, V.
    pub bus_v: f64,
    /// Warmest winding, °C.
    pub winding_c: f64,
    /// Warmest sensor of the stage, °C.
    pub stage_c: f64,
    /// Whether the motor flew again after the throttle was closed and the fault mended.
    pub again: bool,
    /// Whether a leg ever had less than the dead time between its switches.
    pub crossed: bool,
    /// Speed at the fault, rad/s.
    pub speed_rad_s: f64,
}

impl Cell {
    /// Returns what is expected of its fault.
    pub(super) fn expected(&self) -> Expected {
        let pole_pairs = f64::from(Bench::default().motor.pole_pairs);
        let turns_per_s = self.speed_rad_s * pole_pairs / TAU;
        self.fault.expected(self.moment, self.drive, turns_per_s)
    }
}

/// What is noted from the fault on.
struct Notes {
    /// The start, s.
    from_s: f64,
    /// Whether currents, voltages and names are attributed to the fault.
    watched: bool,
    limits_before: BTreeSet<&'static str>,
    limits: BTreeSet<&'static str>,
    faults_before: u32,
    after_s: Option<f64>,
    off: bool,
    trip_s: Option<f64>,
    crossed: bool,
    current_a: f64,
    bus_v: f64,
    winding_c: f64,
    stage_c: f64,
    speed_rad_s: f64,
    driven: bool,
    /// Range of speeds in the observed stretch, rad/s.
    least_rad_s: f64,
    most_rad_s: f64,
}

impl Onlooker for Notes {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        let speed_rad_s = period.motion.speed_rad_s;
        self.speed_rad_s = speed_rad_s;
        self.least_rad_s = self.least_rad_s.min(speed_rad_s);
        self.most_rad_s = self.most_rad_s.max(speed_rad_s);
        self.crossed |= rig.plant().crossed().is_some();
        if !self.watched {
            return;
        }
        let snapshot = rig.snapshot();
        if t_s < self.from_s {
            self.faults_before = snapshot.fault_count;
            self.driven = period.bridge != Bridge::Off;
            return;
        }
        if t_s >= self.from_s + SETTLED_S {
            self.current_a = self.current_a.max(period.motion.flow.most_a);
        }
        self.trip_s = self.trip_s.or(rig.plant().trip_answer_s());
        self.bus_v = self.bus_v.max(period.motion.bus_v);
        self.winding_c = self
            .winding_c
            .max(rig.plant().winding_c().unwrap_or_default());
        self.stage_c = self.stage_c.max(rig.around().sensor_c());
        let off = self.driven && period.bridge == Bridge::Off;
        self.off |= off;
        if off || snapshot.fault_count > self.faults_before {
            self.note(t_s);
        }
    }
}

impl Notes {
    fn new(from_s: f64) -> Self {
        Self {
            from_s,
            watched: true,
            limits_before: BTreeSet::new(),
            limits: BTreeSet::new(),
            faults_before: 0,
            after_s: None,
            off: false,
            trip_s: None,
            crossed: false,
            current_a: 0.0,
            bus_v: 0.0,
            winding_c: 0.0,
            stage_c: 0.0,
            speed_rad_s: 0.0,
            driven: false,
            least_rad_s: f64::INFINITY,
            most_rad_s: f64::NEG_INFINITY,
        }
    }

    fn note(&mut self, t_s: f64) {
        let after_s = t_s - self.from_s;
        self.after_s = Some(self.after_s.map_or(after_s, |first| first.min(after_s)));
    }

    fn look(&mut self) {
        (self.least_rad_s, self.most_rad_s) = (f64::INFINITY, f64::NEG_INFINITY);
    }

    /// Returns true if all speeds since [`Self::look`] were near this one.
    fn near(&self, rad_s: f64) -> bool {
        let within = NEAR * rad_s;
        (self.least_rad_s - rad_s).abs() < within && (self.most_rad_s - rad_s).abs() < within
    }

    fn limits(&mut self, t_s: f64, device: &Device) {
        let bind = device.esc().telemetry().limits;
        for limit in bind.iter().map(Limit::text) {
            if t_s < self.from_s {
                self.limits_before.insert(limit);
            } else if !self.limits_before.contains(limit) && self.limits.insert(limit) {
                self.note(t_s);
            }
        }
    }
}

/// Returns the first paper's bench with every switch edge, and a winding that heats up.
fn bench(seed: u64) -> Bench {
    Bench {
        plant: Fidelity::Switching,
        extras: Extras {
            winding: Some(WINDING),
            ..Bench::default().extras
        },
        seed,
        ..Bench::default()
    }
}

/// Returns the parameters of a drive.
fn params(drive: Drive, row: Row) -> Vec<(ParamId, f32)> {
    let mut params = BOSSO_BENCH.settings.to_vec();
    params.extend(match drive {
        Drive::FieldOriented => [(ParamId::CtlDrive, 0.0), (ParamId::PwmFreqHz, 24_000.0)],
        Drive::SixStep => [(ParamId::CtlDrive, 1.0), (ParamId::PwmFreqHz, 40_000.0)],
    });
    if row == Row::HallStuck {
        params.push((ParamId::CtlObserver, HALL_OBSERVER));
    }
    params
}

/// A flight with its frames, texts and notes.
struct Flight {
    device: Device,
    notes: Notes,
    texts: Vec<(f64, String)>,
    frames: u64,
}

impl Flight {
    /// Flies at a throttle until a time, s.
    fn fly(&mut self, throttle: f64, until_s: f64) {
        let [low, high] = dshot_bits(throttle, false).to_le_bytes();
        let until_ns = (until_s * 1e9) as u64;
        while self.frames < until_ns {
            // A frame fits into a millisecond.
            let _ = self.device.wire().play(self.frames, &[DSHOT600, low, high]);
            self.frames += FRAME_NS;
            let texts = &mut self.texts;
            let now_s = self.frames as f64 * 1e-9;
            self.device.advance(
                self.frames.min(until_ns),
                |_, _| None,
                &mut self.notes,
                &mut |frame| texts.extend(text(frame).map(|text| (now_s, text))),
            );
            if self.notes.watched {
                self.notes.limits(now_s, &self.device);
            }
        }
    }
}

/// Returns the text of a STATUSTEXT.
fn text(frame: &[u8]) -> Option<String> {
    // Start, length, two flags, sequence, system, component, three bytes of message id; then the severity.
    const STATUSTEXT: [u8; 3] = [253, 0, 0];
    let is_text = frame.get(7..10)? == STATUSTEXT;
    let end = 10 + usize::from(*frame.get(1)?);
    let letters = frame.get(11..end.min(61))?;
    let length = letters.iter().position(|letter| *letter == 0);
    let letters = &letters[..length.unwrap_or(letters.len())];
    is_text.then(|| String::from_utf8_lossy(letters).into_owned())
}

/// Returns the speed that a throttle commands, rad/s, with the factory's `CTL_RPM_MIN` and `CTL_RPM_MAX`.
fn asked_rad_s(device: &Device, throttle: f64) -> f64 {
    let params = device.esc().params();
    let [least, most] =
        [ParamId::CtlRpmMin, ParamId::CtlRpmMax].map(|id| f64::from(params.get(id)));
    (least + throttle * (most - least)) * TAU / 60.0
}

/// Plays a cell.
pub(super) fn play(row: Row, moment: Moment, drive: Drive) -> Result<Cell, StartError> {
    let seed = 1;
    let start = Start {
        bench: bench(seed),
        overrides: params(drive, row),
        ..Start::default()
    };
    let fault_s = moment.fault_s();
    let mut flight = Flight {
        device: Device::start(start)?.0,
        notes: Notes::new(fault_s),
        texts: Vec::new(),
        frames: 0,
    };
    let (first, then) = moment.throttle();
    flight.fly(0.0, OPENS_S);
    let mut throttle = first;
    if let Some((at_s, other)) = then {
        flight.fly(first, at_s);
        throttle = other;
    }
    flight.fly(throttle, fault_s);
    let speed_rad_s = flight.notes.speed_rad_s;
    if let Some((kind, for_s)) = row.kind(speed_rad_s) {
        let for_s = (for_s > 0.0 && !row.outlasts_flight()).then_some(for_s);
        flight.device.inject(Fault {
            at_s: fault_s,
            for_s,
            kind,
        });
    }
    if row == Row::FlashFail {
        let frame = parameter::set_frame(CHANGED.0, CHANGED.1);
        let stream = Ids::default().give();
        let notes = &mut flight.notes;
        flight.device.receive(stream, frame.raw_bytes(), notes);
    }
    let end_s = fault_s + WATCHED_S;
    flight.fly(throttle, end_s - LOOKED_S);
    flight.notes.look();
    flight.fly(throttle, end_s);
    let asked = asked_rad_s(&flight.device, throttle);
    let turns = flight.notes.near(asked);
    let snapshot = flight.device.rig().snapshot();
    let closed_s = end_s + CLOSED_S;
    if row.outlasts_flight() {
        flight.fly(0.0, closed_s);
    }
    // Lasting faults are mended; texts from here on do not count.
    flight.notes.watched = false;
    flight.device.mend();
    let mut named: BTreeSet<String> = snapshot
        .faults
        .iter()
        .map(|fault| fault.text().into())
        .collect();
    named.extend(told(&flight.texts, fault_s));
    let first_text_s = flight
        .texts
        .iter()
        .map(|(t_s, _)| *t_s)
        .find(|t_s| *t_s > fault_s);
    if let Some(t_s) = first_text_s {
        flight.notes.note(t_s);
    }

    flight.fly(0.0, closed_s);
    flight.fly(AGAIN, closed_s + AGAIN_S - LOOKED_S);
    flight.notes.look();
    flight.fly(AGAIN, closed_s + AGAIN_S);
    let again = flight.notes.near(asked_rad_s(&flight.device, AGAIN));
    let notes = flight.notes;
    Ok(Cell {
        fault: row,
        moment,
        drive,
        reaction: reaction(moment, (turns, notes.off), &snapshot, &named),
        named,
        limits: notes.limits,
        after_ms: notes.after_s.map(|after_s| 1e3 * after_s),
        trip_us: notes.trip_s.map(|trip_s| 1e6 * trip_s),
        crossed: notes.crossed,
        current_a: notes.current_a,
        bus_v: notes.bus_v,
        winding_c: notes.winding_c,
        stage_c: notes.stage_c,
        again,
        speed_rad_s,
    })
}

/// Returns what the texts since a time have named, except what follows from a silent wire, or one heard anew.
fn told(texts: &[(f64, String)], from_s: f64) -> impl Iterator<Item = String> {
    let since = texts.iter().filter(move |(t_s, _)| *t_s > from_s);
    since.filter_map(|(_, text)| {
        let fault = text.strip_prefix("Fault: ");
        let follows = FOLLOWS.iter().any(|beginning| text.starts_with(beginning));
        (!follows).then(|| fault.unwrap_or(text).to_owned())
    })
}

fn reaction(
    moment: Moment,
    (turns, broken_off): (bool, bool),
    snapshot: &Snapshot,
    named: &BTreeSet<String>,
) -> Reaction {
    let latched = !snapshot.faults.is_empty();
    // A motor being slowed down is not driven.
    let driven = snapshot.phase.drives() && snapshot.phase != Phase::Stopping;
    match (moment.drives(), turns, broken_off) {
        (false, ..) if driven => Reaction::Fails,
        (false, ..) if latched => Reaction::Stops,
        (false, ..) => Reaction::Rests,
        (true, true, false) => Reaction::GoesOn,
        (true, true, true) => Reaction::Recovers,
        _ if !driven && (latched || !named.is_empty()) => Reaction::Stops,
        _ => Reaction::Fails,
    }
}
