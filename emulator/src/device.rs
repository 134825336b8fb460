//! One emulated ESC: its tasks, its drive on a bench, its throttle wire and its flash.

mod answer;
mod capture;
mod fit;
mod machine;
mod overrides;
mod reply;
mod run;

use std::collections::BTreeMap;
use std::ops::Range;

use siskin_control::build::BuildError;
use siskin_control::check::{Item, Own, Probe};
use siskin_control::drive::Sample;
use siskin_control::esc::{Esc, check, obey};
use siskin_control::mavlink::{Frame, Receiver, Request};
use siskin_control::record::Record;
use siskin_control::store::{self, Integrity};
use siskin_control::throttle::Throttle;
use siskin_params::{BOSSO_MOTOR, Board, ParamId, Params};
use siskin_units::AdcCounts;
use thiserror::Error;

use crate::fault::{CHIP_V, Fault, Timeline};
use crate::flash::{FLASH_BYTES, FileFlash, FlashError};
use crate::link::LinkId;
use crate::rig::{Bench, Rig};
use crate::summary::Rejected;
use crate::surroundings::Surroundings;
use crate::wire::Wire;
use capture::CAPTURE_HZ;
use overrides::Overrides;
use reply::Driven;

pub use crate::machine::Onlooker;

/// The parameters' place in the flash: all of it.
const STORE: Range<u32> = 0..FLASH_BYTES as u32;

/// Time between two calls of the tasks.
const TASK_NS: u64 = 1_000_000;

/// Why an ESC cannot start; one line.
#[derive(Debug, Error)]
pub enum StartError {
    /// The storage holds something else.
    #[error("--storage: the stored parameters are corrupt; remove the file to start with defaults")]
    CorruptStorage,
    /// The parameters contradict each other or the bench.
    #[error("parameter {name}: {reason}")]
    Params {
        /// The parameter to change.
        name: &'static str,
        /// What is wrong with it.
        reason: &'static str,
    },
}

impl From<BuildError> for StartError {
    fn from(error: BuildError) -> Self {
        Self::Params {
            name: error.param.entry().name,
            reason: error.reason,
        }
    }
}

/// What an ESC starts with.
pub struct Start {
    /// The bench.
    pub bench: Bench,
    /// The throttle wire.
    pub wire: Wire,
    /// Storage of the parameters.
    pub flash: FileFlash,
    /// Parameters that override the stored ones and are not stored themselves.
    pub overrides: Vec<(ParamId, f32)>,
    /// Parameters that replace the factory values and are not stored; stored values take precedence.
    pub defaults: Vec<(ParamId, f32)>,
    /// The faults.
    pub faults: Vec<Fault>,
    /// Rate of the slowest MAVLink link.
    pub link_bytes_per_s: u32,
}

/// The default bench, whose motor is known: an undriven wire, nothing stored, set or broken, and a serial link of 115
/// 200 baud.
impl Default for Start {
    fn default() -> Self {
        Self {
            bench: Bench::default(),
            wire: Wire::detached(),
            flash: FileFlash::in_memory(),
            overrides: Vec::new(),
            defaults: BOSSO_MOTOR.settings.to_vec(),
            faults: Vec::new(),
            link_bytes_per_s: 11_520,
        }
    }
}

/// One emulated ESC.
pub struct Device {
    esc: Esc,
    throttle: Throttle,
    rig: Rig,
    wire: Wire,
    driven: Driven,
    /// The converters' latest readings; `None` before the first period.
    latest: Option<Sample>,
    flash: FileFlash,
    overrides: Overrides,
    board: Board,
    link_bytes_per_s: u32,
    receivers: BTreeMap<LinkId, Receiver>,
    /// Frames refused by receivers of streams that have ended.
    rejected_frames: u64,
    clock: Clock,
    task_due_ns: u64,
    faults: Timeline,
    /// The supply is too low for the chip.
    starved: bool,
    record: &'static Record,
}

/// What takes in a client's frames.
struct Ear<'a> {
    esc: &'a mut Esc,
    throttle: &'a mut Throttle,
    overrides: &'a mut Overrides,
}

impl Ear<'_> {
    fn hear(&mut self, now_us: u64, frame: &Frame) {
        self.esc.receive(self.throttle, now_us, frame);
        self.overrides.heard(frame, self.esc.params());
    }
}

/// The simulated chip for the self-test: its converters' latest sample; it has neither comparators nor clocks.
pub struct Latest(pub Sample);

impl Latest {
    /// Returns a sample without a supply, for an ESC on its own.
    pub const fn at_rest() -> Self {
        Self(Sample {
            currents: [AdcCounts::ZERO; 3],
            bus: AdcCounts::ZERO,
            terminals: [AdcCounts::ZERO; 3],
            hall: 7,
        })
    }
}

impl Probe for Latest {
    fn sample(&mut self) -> Sample {
        self.0
    }

    fn own(&mut self, _item: Item) -> Own {
        Own::Absent
    }
}

/// Simulated time: whole control periods since the start or the last restart.
struct Clock {
    origin_ns: f64,
    period_ns: f64,
    periods: u64,
}

impl Clock {
    fn now_ns(&self) -> u64 {
        self.now() as u64
    }

    /// Returns the same with its fraction.
    fn now(&self) -> f64 {
        self.origin_ns + self.periods as f64 * self.period_ns
    }
}

impl Device {
    /// Powers the ESC up.
    ///
    /// Returns it with a warning if the stored data is not intact.
    pub fn start(start: Start) -> Result<(Self, Option<&'static str>), StartError> {
        let Start {
            bench,
            mut wire,
            mut flash,
            overrides,
            defaults,
            faults,
            link_bytes_per_s,
        } = start;
        let mut loaded = store::load(&mut flash, STORE);
        if matches!(loaded.integrity, Integrity::Corrupt | Integrity::Unreadable) {
            return Err(StartError::CorruptStorage);
        }
        let params = &mut loaded.kept.params;
        let stored = params.clone();
        let board = bench.sensing.board(bench.delay);
        let mut overrides = Overrides::new(defaults.clone(), overrides);
        overrides.apply(params);
        if let Err(error) = check(params, &board) {
            // The ESC takes what is stored, fitting or not, but not what is given to the program.
            let mut without = stored.clone();
            Overrides::new(defaults, []).apply(&mut without);
            if stored == Params::default() || check(&without, &board).is_ok() {
                return Err(error.into());
            }
        }
        let (mut esc, throttle) =
            Esc::power_up(params.clone(), board, CAPTURE_HZ, link_bytes_per_s);
        esc.recall(&loaded);
        // The chip's memory, which outlives the program: 1.2 KB, never freed.
        let record = &*Box::leak(Box::<Record>::default());
        record.open();
        esc.serve(record);
        wire.sow(bench.seed);
        let rig = Rig::new(bench, esc.config()?);
        let clock = Clock {
            origin_ns: 0.0,
            period_ns: rig.period_s() * 1e9,
            periods: 0,
        };
        let device = Self {
            esc,
            throttle,
            rig,
            wire,
            driven: Driven::default(),
            latest: None,
            flash,
            overrides,
            board,
            link_bytes_per_s,
            receivers: BTreeMap::new(),
            rejected_frames: 0,
            clock,
            task_due_ns: 0,
            faults: Timeline::new(faults),
            starved: false,
            record,
        };
        Ok((device, loaded.trouble()))
    }

    /// Returns the simulated time since the start, ns.
    pub fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    /// Returns the start of the next period, s.
    pub fn begins_s(&self) -> f64 {
        self.clock.now() * 1e-9
    }

    /// Returns true if a period remains until this time, to the nearest one: a period is not a whole number of
    /// nanoseconds.
    pub fn is_before(&self, until_ns: u64) -> bool {
        self.now_ns()
            .saturating_add(self.clock.period_ns as u64 / 2)
            < until_ns
    }

    /// Returns the tasks' side.
    pub fn esc(&self) -> &Esc {
        &self.esc
    }

    /// Returns the drive on its bench.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Returns the throttle wire, to be polled or played.
    pub fn wire(&mut self) -> &mut Wire {
        &mut self.wire
    }

    /// Returns its surroundings, for changes.
    pub fn around_mut(&mut self) -> &mut Surroundings {
        self.rig.around_mut()
    }

    /// Returns the tasks' side, to tell it of other ESCs.
    pub fn esc_mut(&mut self) -> &mut Esc {
        &mut self.esc
    }

    /// Returns true if the tasks run in the next period.
    pub fn task_is_due(&self) -> bool {
        self.now_ns() >= self.task_due_ns
    }

    /// Takes bytes received on a MAVLink stream; a chip in reset ignores them.
    pub fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker) {
        if self.rig.is_held() {
            return;
        }
        let now_ns = self.now_ns();
        let now_us = now_ns / 1000;
        let receiver = self.receivers.entry(stream).or_default();
        let mut ear = Ear {
            esc: &mut self.esc,
            throttle: &mut self.throttle,
            overrides: &mut self.overrides,
        };
        receiver.push(now_us, bytes, |frame| {
            onlooker.frame(now_ns, frame.raw);
            ear.hear(now_us, frame);
        });
    }

    /// Forgets a MAVLink stream that has ended.
    pub fn forget(&mut self, stream: LinkId) {
        if let Some(receiver) = self.receivers.remove(&stream) {
            self.rejected_frames += receiver.counters().rejected();
        }
    }

    /// Injects a fault that acts from its time on, replacing one of its kind.
    pub fn inject(&mut self, fault: Fault) {
        self.faults.inject(self.t_s(), fault);
    }

    /// Returns the faults that act, have acted or are pending, except mended ones.
    pub fn faults(&self) -> &[Fault] {
        self.faults.faults()
    }

    /// Repairs everything that faults have broken so far.
    pub fn mend(&mut self) {
        self.faults.mend(self.t_s());
    }

    fn t_s(&self) -> f64 {
        self.now_ns() as f64 * 1e-9
    }

    /// Returns what was received since the start and refused.
    pub fn rejected(&self) -> Rejected {
        let wire = self.wire.counts();
        let receivers = self.receivers.values();
        let open: u64 = receivers.map(|open| open.counters().rejected()).sum();
        Rejected {
            wire_datagrams: wire.rejected + wire.dropped,
            wire_frames: self.esc.telemetry().bad_frames,
            mavlink_frames: self.rejected_frames + open,
            lockstep_requests: None,
        }
    }

    /// Applies the faults of this time.
    #[cold]
    fn disturb(&mut self, t_s: f64) {
        let before = self.faults.look(t_s);
        let now = self.faults.now;
        self.rig.disturb(&before, &now);
        self.wire.disturb(now.wire);
        self.flash.fail(now.flash_fails);
        // A bus drained by a fault is watched until it is up again.
        let starved = now.bus_weakened && self.rig.bus_v() < CHIP_V;
        let held = now.held || starved;
        if held != self.rig.is_held() || now.resets > before.resets {
            // Entering and leaving reset: all state is lost.
            self.reboot(starved || self.starved);
        }
        self.starved = starved;
        self.rig.hold(held);
    }

    fn tasks(&mut self, now_ns: u64, onlooker: &mut impl Onlooker, send: &mut dyn FnMut(&[u8])) {
        // Receivers learn the time only from bytes: this searches what a false start held back.
        let now_us = now_ns / 1000;
        let mut ear = Ear {
            esc: &mut self.esc,
            throttle: &mut self.throttle,
            overrides: &mut self.overrides,
        };
        for receiver in self.receivers.values_mut() {
            receiver.push(now_us, &[], |frame| {
                onlooker.frame(now_ns, frame.raw);
                ear.hear(now_us, frame);
            });
        }
        let snapshot = self.rig.snapshot();
        let temperature_c = self.rig.temperature_c();
        let throttle = &mut self.throttle;
        let mut send = |frame: &[u8]| {
            onlooker.frame(now_ns, frame);
            send(frame);
        };
        self.esc
            .poll(throttle, now_us, &snapshot, temperature_c, &mut send);
        onlooker.tasks(self.esc.telemetry());
        if let Some(mut latest) = self.latest.map(Latest) {
            self.esc.test_itself(&snapshot, &mut latest);
        }
        while let Some(request) = self.esc.take_request(&mut self.throttle) {
            match request {
                Request::ParamsChanged => self.configure(),
                Request::Save | Request::Keep | Request::Load | Request::FactoryReset => {
                    let result = self.store(request);
                    self.esc.storage_done(&mut self.throttle, result);
                }
                Request::Reboot => self.reboot(false),
            }
        }
    }

    /// Carries out a storage request; values from the command line remain unstored, unless somebody has set them.
    fn store(&mut self, request: Request) -> Result<(), &'static str> {
        self.flash.check().map_err(|error| reason(&error))?;
        let mut kept = self.esc.kept();
        self.overrides.hide(&mut kept.params);
        if obey(request, &mut self.flash, STORE, &mut kept)? {
            if request == Request::FactoryReset {
                self.overrides.erased();
            }
            self.overrides.apply(&mut kept.params);
            self.esc.replace(&mut kept);
        } else {
            self.overrides.saved(&kept.params);
        }
        match request {
            Request::Load => Ok(()),
            // Nobody has asked whether it would survive a restart.
            Request::Keep if !self.flash.is_persistent() => Ok(()),
            _ => self.persist(),
        }
    }

    fn persist(&self) -> Result<(), &'static str> {
        if !self.flash.is_persistent() {
            return Err("storage: none, nothing would survive a restart");
        }
        self.flash.sync().map_err(|error| reason(&error))
    }

    fn configure(&mut self) {
        // Always succeeds, since what is in force has been built before.
        if let Ok(config) = self.esc.config() {
            self.rig.configure(config);
        }
    }

    /// Restarts the ESC, after a loss of power or without one; shaft, supply and wire go on as they are.
    fn reboot(&mut self, power_up: bool) {
        let mut loaded = store::load(&mut self.flash, STORE);
        let params = &mut loaded.kept.params;
        self.overrides.apply(params);
        let (mut esc, mut throttle) = Esc::power_up(
            params.clone(),
            self.board,
            CAPTURE_HZ,
            self.link_bytes_per_s,
        );
        esc.recall(&loaded);
        esc.regroup(&self.esc);
        if !power_up {
            throttle.resume();
        }
        self.record.open();
        esc.serve(self.record);
        let Ok(config) = esc.config() else { return };
        self.esc = esc;
        self.throttle = throttle;
        self.driven = Driven::default();
        self.receivers.clear();
        self.rig.restart(config);
        self.clock = Clock {
            origin_ns: self.clock.now(),
            period_ns: self.rig.period_s() * 1e9,
            periods: 0,
        };
    }
}

/// Returns why nothing is stored, for a user behind MAVLink.
fn reason(error: &FlashError) -> &'static str {
    match error {
        FlashError::Gone => "storage: the file was removed or cut",
        _ => "storage: the file cannot be written",
    }
}

#[cfg(test)]
mod tests;
