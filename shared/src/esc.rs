//! The ESC outside the PWM interrupt, shared by the firmware's tasks and the emulator's loop. Edges, frames and
//! snapshots go in; set-points, frames and requests come out.

use heapless::Vec;
use siskin_params::{Board, ParamId, Params, TRIP_SHARE};
use siskin_throttle::authority::{Command, DriveStatus};
use siskin_units::Scale;
use siskin_units::math::Real;

use crate::answer::info::info;
use crate::build::{BuildError, build_in, scale};
use crate::check::Check;
#[cfg(feature = "drift")]
use crate::drive::Tracker;
use crate::drive::{Config, CurrentMonitor, Drift, Phase, Setpoint, Snapshot};
use crate::identify::Identify;
#[cfg(feature = "group")]
use crate::mavlink::Four;
use crate::mavlink::{Component, Context, Frame, NO_REBOOT_ARMED, Request, Warning};
use crate::record::Record;
use crate::setpoint::Use;
use crate::statistics::Recorder;
use crate::telemetry::{Charge, Telemetry};
use crate::throttle::{LockThrottle, LockedAuthority, TaskDemands, Throttle};
use crate::tune::Tune;
use fit::Overrides;
use storage::{Asker, Storage, Unstored};
use tunes::Tunes;

mod check;
#[cfg(feature = "drift")]
mod drift;
mod fit;
#[cfg(feature = "group")]
mod group;
mod identify;
mod kept;
mod observe;
mod storage;
mod tunes;
mod unfit;
mod wire;

pub use fit::{PowerUp, check};
pub use storage::obey;

/// How long a wire with a signal must have demanded rest before the flash is written, µs: writing stalls the
/// processor, so a flight controller's frames are missed.
const REST_US: u64 = 1_000_000;

/// One ESC, without its interrupt and its throttle.
// Ordered by use: the most used fields are within reach of the chip's short instructions.
#[repr(C)]
pub struct Esc {
    light: bool,
    too_hot: bool,
    /// Keep what the identification finds.
    keeps_result: bool,
    /// The wire carried a signal at the last poll.
    traffic: bool,
    /// The assumed motor has changed.
    motor_reassumed: bool,
    /// The command to the motor at the last poll.
    command: Command,
    polled_us: Option<u64>,
    rests_since_us: Option<u64>,
    storage: Storage,
    record: Option<&'static Record>,
    overrides: Overrides,
    /// Why the parameters make no drive: the motor is off, and the drive keeps its configuration.
    unfit: Option<BuildError>,
    /// When the user is to be told of that.
    tells_us: u64,
    tunes: Tunes,
    telemetry: Telemetry,
    params: Params,
    scale: Scale,
    charge: Charge,
    current_monitor: CurrentMonitor,
    /// Follows the motor's resistance and flux.
    #[cfg(feature = "drift")]
    tracker: Tracker,
    recorder: Recorder,
    /// One entry for each of the two commands that set a value.
    unstored: Vec<Unstored, 2>,
    /// The other ESCs that this one reports.
    #[cfg(feature = "group")]
    four: Option<Four>,
    check: Check,
    identify: Identify,
    board: Board,
    component: Component,
}

impl Esc {
    /// Creates an ESC at power-up, and its throttle.
    ///
    /// `tick_hz` is the rate of the timer that captures the wire's edges, and `link_bytes_per_s` the capacity
    /// of the slowest MAVLink link.
    ///
    /// # Errors
    /// The parameter that does not fit the board.
    pub fn new(
        params: Params,
        board: Board,
        tick_hz: u32,
        link_bytes_per_s: u32,
    ) -> Result<(Self, Throttle), BuildError> {
        check(&params, &board)?;
        Ok(Self::power_up(params, board, tick_hz, link_bytes_per_s))
    }

    /// The same with parameters that may not fit: the motor is off until they do.
    pub fn power_up(
        params: Params,
        board: Board,
        tick_hz: u32,
        link_bytes_per_s: u32,
    ) -> (Self, Throttle) {
        let drive = PowerUp::new(&params, &board);
        let esc = Self::alone(params, board, drive, link_bytes_per_s);
        let throttle = Throttle::new(tick_hz, &esc.running(), &board);
        (esc, throttle)
    }

    /// Creates an ESC at power-up without its throttle.
    ///
    /// Never inlined: on the chip this and [`Throttle::new`] construct in place, since moving the two through
    /// [`Esc::new`] takes 10 KB of stack.
    #[inline(never)]
    pub fn alone(params: Params, board: Board, drive: PowerUp, link_bytes_per_s: u32) -> Self {
        Self {
            board,
            overrides: drive.overrides,
            unfit: drive.unfit,
            // The end of the self-test tells it.
            tells_us: u64::MAX,
            scale: drive.scale,
            component: Component::new(&params, &board.image, link_bytes_per_s),
            telemetry: Telemetry::new(),
            charge: Charge::default(),
            current_monitor: CurrentMonitor::default(),
            #[cfg(feature = "drift")]
            tracker: Tracker::default(),
            recorder: Recorder::default(),
            params,
            too_hot: false,
            polled_us: None,
            tunes: Tunes::default(),
            check: Check::new(&board),
            identify: Identify::default(),
            keeps_result: false,
            record: None,
            light: false,
            command: Command::Stop,
            rests_since_us: None,
            traffic: false,
            storage: Storage::default(),
            motor_reassumed: false,
            unstored: Vec::new(),
            #[cfg(feature = "group")]
            four: None,
        }
    }

    /// Returns the interrupt's configuration, computed anew at each call: it is larger than everything else.
    ///
    /// # Errors
    /// Never when it is due: at power-up, and after [`Request::ParamsChanged`].
    pub fn config(&self) -> Result<Config, BuildError> {
        let mut config = Config::default();
        self.config_in(&mut config)?;
        Ok(config)
    }

    /// Writes the result of [`Esc::config`] to `place`.
    ///
    /// # Errors
    /// Those of [`Esc::config`].
    pub fn config_in(&self, place: &mut Config) -> Result<(), BuildError> {
        let running = self.running();
        #[cfg(feature = "drift")]
        if build_in(&running, &self.board, self.tracker.in_force(), place).is_ok() {
            return Ok(());
        }
        // Where the parameters have just changed it may not fit any more; the motor as stated has been tried.
        build_in(&running, &self.board, Drift::NONE, place)
    }

    /// Returns the parameters as they are set.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Returns the phase current that a board's hardware trip must stay above, peak A: `LIM_PHASE_A`, or the
    /// previous limit until the control's trip has come down.
    pub fn phase_limit_a(&self, snapshot: &Snapshot) -> f32 {
        let trip_a = snapshot.trip.to_f32() * self.board.current_a_per_count;
        self.params.get(ParamId::LimPhaseA).max(trip_a / TRIP_SHARE)
    }

    /// Returns the state as telemetry reports it.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Queues a warning to the user for the next poll.
    pub fn warn(&mut self, warning: Warning) {
        self.component.warn(warning);
    }

    /// Likewise of one that is in pieces; what does not fit is cut.
    pub fn warn_in_pieces(&mut self, what: &str, why: [&str; 3]) {
        let mut text = Warning::new();
        let _ = text.push_str(what);
        for piece in why {
            // Cut what does not fit: `push_str` would drop it as a whole.
            let room = text.capacity() - text.len();
            let _ = text.push_str(piece.get(..room).unwrap_or(piece));
        }
        self.warn(text);
    }

    /// Likewise of a text.
    pub fn warn_of(&mut self, trouble: &str) {
        let mut warning = Warning::new();
        // None is longer.
        let _ = warning.push_str(trouble);
        self.warn(warning);
    }

    /// Handles a frame from any MAVLink link.
    pub fn receive(&mut self, throttle: &mut impl LockThrottle, now_us: u64, frame: &Frame) {
        self.with_component(throttle, now_us, |component, context| {
            component.handle(frame, context);
        });
    }

    /// Does the work that is due: timeouts, telemetry, and frames to every link. Call it about every
    /// millisecond.
    pub fn poll(
        &mut self,
        throttle: &mut impl LockThrottle,
        now_us: u64,
        snapshot: &Snapshot,
        temperature_c: f32,
        send: &mut dyn FnMut(&[u8]),
    ) {
        if self.polled_us.is_none() {
            self.tunes.play(now_us, Tune::Start);
        }
        let before_us = self.polled_us.replace(now_us).unwrap_or(now_us);
        let elapsed_us = now_us - before_us.min(now_us);
        self.observe(now_us, snapshot, temperature_c, elapsed_us);
        self.poll_wire(throttle, now_us);
        self.follow_wire(throttle, now_us);
        if self.storage.reminds(now_us) {
            self.warn_of(storage::LOST);
        }
        self.tell_unfit(now_us);
        self.with_component(throttle, now_us, |component, context| {
            component.poll(context, send);
        });
        if let Some(act) = self.component.take_act() {
            self.act(throttle, now_us, act);
        }
        self.clear_identify_request();
        self.command = throttle.lock(|throttle| throttle.command());
        let rests = self.command.rests();
        self.rests_since_us = rests.then(|| self.rests_since_us.unwrap_or(now_us));
        self.tunes.poll(now_us, snapshot, rests);
        self.poll_identification(now_us, snapshot);
        let demands = self.demands();
        throttle.lock(|throttle| throttle.set_demands(demands));
    }

    /// Polls the throttle wire and takes in its status.
    fn poll_wire(&mut self, throttle: &mut impl LockThrottle, now_us: u64) {
        let wire = throttle.lock(|throttle| throttle.poll(now_us, &self.telemetry));
        self.telemetry.armed = wire.armed;
        self.telemetry.signal = wire.signal;
        self.telemetry.bad_frames = wire.bad_frames;
        self.telemetry.bad_share = wire.bad_share;
        self.traffic = wire.traffic;
        self.command = wire.command;
    }

    /// Returns what the tasks demand of the drive.
    fn demands(&self) -> TaskDemands {
        TaskDemands {
            wanted: (self.check.pull().map(Setpoint::Pull))
                .or_else(|| self.identification())
                .map(Use::Measure)
                .or_else(|| self.tunes.note().map(Use::Note)),
            too_hot: self.too_hot,
            barred: self.check.powers_up()
                || self.storage.is_lost()
                || self.unfit.is_some()
                || !self.check.report.may_turn(&self.params),
        }
    }

    /// Returns the next request that only the caller can carry out.
    ///
    /// After [`Request::ParamsChanged`] the interrupt must run with [`Esc::config`]; this side is done. A
    /// storage request waits until the bridge is at rest and the previous request has finished; from then until
    /// [`Esc::storage_done`] nothing turns the motor. A restart waits for storage, and is abandoned if the wire
    /// is armed meanwhile.
    pub fn take_request(&mut self, throttle: &mut impl LockThrottle) -> Option<Request> {
        let now_us = self.polled_us.unwrap_or(0);
        if core::mem::take(&mut self.motor_reassumed) && self.unfit.is_none() {
            self.apply(throttle);
            return Some(Request::ParamsChanged);
        }
        let request = self.component.take_request();
        if self.component.take_changed() {
            self.storage.changed(now_us);
        }
        match request {
            Some(Request::ParamsChanged) => {
                if self.fits(now_us) {
                    self.apply(throttle);
                    return request;
                }
            }
            Some(Request::Reboot) => {
                self.storage.reboot();
                if self.storage.reboots_later(now_us) {
                    self.warn_of("Reboot waits up to 3 min for the next save");
                }
            }
            // MAVLink would store a direction, and with it all the settings that nobody has restored.
            Some(Request::Save) if self.storage.is_lost() && !self.component.stores_all() => {
                self.component.storage_done(Err(storage::LOST));
            }
            _ => self.storage.ask(request),
        }
        let prevents = if self.telemetry.armed {
            Some(NO_REBOOT_ARMED)
        } else {
            (!self.drive().stopped).then_some("No reboot: the motor turns")
        };
        if let Some(reason) = prevents
            && self.storage.cancel_reboot()
        {
            self.warn_of(reason);
        }
        // From here on nothing turns the motor.
        if self.storage.reboots() && throttle.lock(Throttle::store) {
            self.storage.cancel_reboot();
            return Some(Request::Reboot);
        }
        let stores = self.storage.waits(now_us) && self.may_store();
        if stores && throttle.lock(Throttle::store) {
            return self.storage.take(now_us);
        }
        None
    }

    /// Returns true if the flash may be written. It stalls the chip for up to half a second with the bridge off
    /// and nothing controlled: the bridge must not switch, nor be about to.
    fn may_store(&self) -> bool {
        let holds = matches!(self.telemetry.phase, Phase::Idle | Phase::Brake);
        let rested = match (self.rests_since_us, self.polled_us) {
            (Some(since_us), Some(now_us)) => {
                !self.traffic || now_us.saturating_sub(since_us) >= REST_US
            }
            _ => false,
        };
        let busy = self.tunes.note().is_some() || self.identify.is_under_way();
        holds && rested && self.drive().stopped && !busy
    }

    fn drive(&self) -> DriveStatus {
        self.telemetry.drive(self.command)
    }

    /// Reports how a storage request ended, so that it is acknowledged, and releases the motor.
    pub fn storage_done(
        &mut self,
        throttle: &mut impl LockThrottle,
        result: Result<(), &'static str>,
    ) {
        throttle.lock(Throttle::stored);
        if self.storage.takes_all() && result.is_ok() {
            self.unstored.clear();
        }
        match (self.storage.done(result.is_ok()), result) {
            (Some(Asker::Wire), _) => self.component.report_stored(result),
            (Some(Asker::Mavlink), _) => self.component.storage_done(result),
            (Some(Asker::Nobody), Err(reason)) => self.warn_of(reason),
            _ => {}
        }
    }

    fn apply(&mut self, throttle: &mut impl LockThrottle) {
        self.scale = scale(&self.running(), &self.board);
        throttle.lock(|throttle| throttle.adopt(&self.params, self.scale));
        self.update_info(throttle);
    }

    fn update_info(&self, throttle: &mut impl LockThrottle) {
        let info = info(&self.params, self.light, &self.board.image);
        throttle.lock(|throttle| throttle.set_info(info));
    }

    fn with_component(
        &mut self,
        throttle: &mut impl LockThrottle,
        now_us: u64,
        run: impl FnOnce(&mut Component, &mut Context),
    ) {
        let (overrides, board) = (self.overrides, self.board);
        let mut context = Context {
            now_us,
            params: &mut self.params,
            board: &board,
            telemetry: &self.telemetry,
            #[cfg(feature = "group")]
            four: self.four.as_ref(),
            check: &self.check.report,
            identification: &self.identify.report,
            record: self.record,
            authority: &mut LockedAuthority(throttle),
            validate: &|params| overrides.check(params, &board),
        };
        run(&mut self.component, &mut context);
    }
}

#[cfg(test)]
mod tests;
