//! The ESC outside the PWM interrupt: what the tasks of the firmware and the loop of the emulator
//! share. It takes edges, frames and snapshots in, and gives set-points, frames and requests out.

use core::mem::MaybeUninit;

use heapless::Vec;

use crate::answer::info::info;
use crate::check::Check;
use crate::drive::{Config, Phase, Setpoint, Snapshot, Witness, put_default};
use crate::identify::Identify;
use crate::input::authority::{Command, DriveStatus};
use crate::math::{Real, magnitude};
#[cfg(feature = "group")]
use crate::mavlink::Four;
use crate::mavlink::{Component, Context, Frame, NO_REBOOT_ARMED, Request, Warning};
use crate::params::{
    Board, BuildError, ParamId, Params, TRIP_SHARE, build, build_in, scale, thresholds,
    unbalance_max,
};
use crate::record::Record;
use crate::statistics::{Recorder, Sight};
use crate::telemetry::{Charge, Telemetry};
use crate::throttle::{Polled, Reach, Reached, Throttle};
use crate::tune::Tune;
use crate::units::Scale;
use storage::{Asker, Storage, Unstored};
use tunes::Tunes;

mod check;
#[cfg(feature = "group")]
mod group;
mod identify;
mod kept;
mod storage;
mod tunes;
mod wire;

pub use storage::obey;

/// Degrees below `LIM_TEMP_C` at which an over-temperature has ended.
const TEMPERATURE_HYSTERESIS_C: f32 = 5.0;

/// Time for which a wire with signals must have asked for rest before the flash is written, µs: what
/// is written stalls the processor, and so a flight controller's frames are missed.
const REST_US: u64 = 1_000_000;

/// One ESC without its interrupt and its throttle.
// In this order: what is used most stands where the chip's short instructions reach it.
#[repr(C)]
pub struct Esc {
    light: bool,
    too_hot: bool,
    /// True if what it finds is to be kept.
    keeps: bool,
    /// True if the wire carried signals then.
    traffic: bool,
    /// The motor that is assumed has changed.
    reassumes: bool,
    /// The motor's command at the last poll.
    command: Command,
    polled_us: Option<u64>,
    rests_since_us: Option<u64>,
    storage: Storage,
    record: Option<&'static Record>,
    given: Given,
    tunes: Tunes,
    telemetry: Telemetry,
    params: Params,
    scale: Scale,
    charge: Charge,
    witness: Witness,
    recorder: Recorder,
    /// There are two such commands.
    unstored: Vec<Unstored, 2>,
    /// The ESCs that it tells of besides.
    #[cfg(feature = "group")]
    four: Option<Four>,
    check: Check,
    identify: Identify,
    board: Board,
    component: Component,
}

/// The values that the drive runs with in place of the parameters.
#[derive(Clone, Copy, Debug)]
struct Given {
    /// As it was at the start: the timer runs with it.
    pwm_freq_hz: f32,
    /// Dead time, ns.
    pwm_deadtime_ns: f32,
    /// True if a command has turned the direction against `MOT_DIR`.
    opposite: bool,
}

impl Given {
    /// These parameters as the drive runs with them here.
    fn running(self, params: &Params) -> Params {
        let mut running = params.clone();
        let direction = params.get(ParamId::MotDir);
        let kept = [
            (ParamId::PwmFreqHz, self.pwm_freq_hz),
            (ParamId::PwmDeadtimeNs, self.pwm_deadtime_ns),
            (
                ParamId::MotDir,
                if self.opposite {
                    1.0 - direction
                } else {
                    direction
                },
            ),
        ];
        for (id, value) in kept {
            // The first two were in range at the start, and a direction is 0 or 1.
            let _ = running.set(id, value);
        }
        running
    }

    /// Checks that these parameters make a drive, here and after the next start.
    fn check(self, params: &Params, board: &Board) -> Result<(), BuildError> {
        check(params, board)?;
        check(&self.running(params), board)
    }
}

/// Checks that parameters make a drive. Never inlined: a configuration takes 0.9 KB of stack.
///
/// # Errors
/// The parameter that does not fit the board.
#[inline(never)]
pub fn check(params: &Params, board: &Board) -> Result<(), BuildError> {
    let mut place = MaybeUninit::<Config>::uninit();
    build_in(params, board, put_default(&mut place))
}

impl Esc {
    /// An ESC at power-up, and its throttle.
    ///
    /// `tick_hz` is the rate of the timer that captures the wire's edges, and `link_bytes_per_s`
    /// what the slowest MAVLink link carries.
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
        let throttle = Throttle::new(tick_hz, &params, &board);
        Ok((Self::unchecked(params, board, link_bytes_per_s), throttle))
    }

    /// An ESC at power-up, without its throttle, whose parameters fit the board ([`check()`]).
    ///
    /// Never inlined: on the chip it is made where it stays, by this and by [`Throttle::new`], since
    /// the two on their way through [`Esc::new`] take 10 KB of stack.
    #[inline(never)]
    pub fn unchecked(params: Params, board: Board, link_bytes_per_s: u32) -> Self {
        Self {
            board,
            given: Given {
                pwm_freq_hz: params.get(ParamId::PwmFreqHz),
                pwm_deadtime_ns: params.get(ParamId::PwmDeadtimeNs),
                opposite: false,
            },
            scale: scale(&params, &board),
            component: Component::new(&params, &board.image, link_bytes_per_s),
            telemetry: Telemetry::new(),
            charge: Charge::default(),
            witness: Witness::default(),
            recorder: Recorder::default(),
            params,
            too_hot: false,
            polled_us: None,
            tunes: Tunes::default(),
            check: Check::new(&board),
            identify: Identify::default(),
            keeps: false,
            record: None,
            light: false,
            command: Command::Stop,
            rests_since_us: None,
            traffic: false,
            storage: Storage::default(),
            reassumes: false,
            unstored: Vec::new(),
            #[cfg(feature = "group")]
            four: None,
        }
    }

    /// The configuration for the interrupt, computed again at each call: it is larger than all else.
    ///
    /// # Errors
    /// Never with the parameters in force, which have been tried before.
    pub fn config(&self) -> Result<Config, BuildError> {
        build(&self.running(), &self.board)
    }

    /// As [`Esc::config`], in a place that the caller has for it.
    ///
    /// # Errors
    /// As [`Esc::config`].
    pub fn config_in(&self, place: &mut Config) -> Result<(), BuildError> {
        build_in(&self.running(), &self.board, place)
    }

    /// The parameters as the drive runs with them: for the motor of an identification, while one is under way.
    fn running(&self) -> Params {
        let mut running = self.given.running(&self.params);
        if self.identify.is_under_way() {
            self.identify.assume(&mut running);
        }
        running
    }

    /// The parameters in force.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The bound of the phase currents that a board's own trip is to stand above, peak A:
    /// `LIM_PHASE_A`, and while the control's trip has not come down to it, the one before.
    pub fn phase_limit_a(&self, snapshot: &Snapshot) -> f32 {
        let trip_a = snapshot.trip.to_f32() * self.board.current_a_per_count;
        self.params.get(ParamId::LimPhaseA).max(trip_a / TRIP_SHARE)
    }

    /// The state as telemetry reports it.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Warns a person, at the next poll.
    pub fn warn(&mut self, warning: Warning) {
        self.component.warn(warning);
    }

    fn warn_of(&mut self, trouble: &str) {
        let mut warning = Warning::new();
        // Whatever is longer than a text on MAVLink would be cut there as well.
        let _ = warning.push_str(trouble);
        self.warn(warning);
    }

    /// A frame that came in on any MAVLink link.
    pub fn receive(&mut self, throttle: &mut impl Reach, now_us: u64, frame: &Frame) {
        self.with_component(throttle, now_us, |component, context| {
            component.handle(frame, context);
        });
    }

    /// Does the work that is due, about each millisecond: time-outs, telemetry, and frames to every
    /// link.
    pub fn poll(
        &mut self,
        throttle: &mut impl Reach,
        now_us: u64,
        snapshot: &Snapshot,
        temperature_c: f32,
        send: &mut dyn FnMut(&[u8]),
    ) {
        if self.polled_us.is_none() {
            self.tunes.play(now_us, Tune::Start);
        }
        let before_us = self.polled_us.replace(now_us).unwrap_or(now_us);
        self.observe(
            now_us,
            snapshot,
            temperature_c,
            now_us - before_us.min(now_us),
        );
        let standing = throttle.reach(|throttle| throttle.poll(now_us, &self.telemetry));
        self.telemetry.armed = standing.armed;
        self.telemetry.signal = standing.signal;
        self.telemetry.bad_frames = standing.bad_frames;
        self.telemetry.bad_share = standing.bad_share;
        self.traffic = standing.traffic;
        self.command = standing.command;
        self.follow_wire(throttle, now_us);
        if self.storage.reminds(now_us) {
            self.warn_of(storage::LOST);
        }
        self.with_component(throttle, now_us, |component, context| {
            component.poll(context, send);
        });
        if let Some(act) = self.component.take_act() {
            self.act(throttle, now_us, act);
        }
        self.end_order();
        self.command = throttle.reach(|throttle| throttle.command());
        let rests = self.command.rests();
        self.rests_since_us = rests.then(|| self.rests_since_us.unwrap_or(now_us));
        self.tunes.look(now_us, snapshot, rests);
        self.look_at_motor(now_us, snapshot);
        let polled = Polled {
            note: self.tunes.note().filter(|_| !self.check.powers_up()),
            test: self
                .check
                .pull()
                .map(Setpoint::Pull)
                .or_else(|| self.identification()),
            too_hot: self.too_hot,
            barred: self.check.powers_up()
                || self.storage.is_lost()
                || !self.check.report.may_turn(&self.params),
        };
        throttle.reach(|throttle| throttle.take_polled(polled));
    }

    /// Takes in the state of the drive and the board.
    fn observe(&mut self, now_us: u64, snapshot: &Snapshot, temperature_c: f32, time_us: u64) {
        let limit_c = self.params.get(ParamId::LimTempC);
        let limit_c = if self.too_hot {
            limit_c - TEMPERATURE_HYSTERESIS_C
        } else {
            limit_c
        };
        // A reading that is no number is too hot as well.
        self.too_hot = temperature_c.is_nan() || temperature_c > limit_c;
        self.telemetry.observe(snapshot, &self.scale, time_us);
        let found = self.witness.look(snapshot, unbalance_max(&self.board));
        for limit in found.without(self.telemetry.limits).iter() {
            self.warn_of(limit.text());
        }
        let binding = thresholds(&self.params, &self.scale).limits(snapshot);
        self.telemetry.limits = binding.with(found);
        self.charge
            .add(self.scale.amperes(snapshot.bus_current), time_us);
        self.telemetry.consumed_mah = self.charge.mah();
        self.telemetry.temperature_c = temperature_c;
        let sight = Sight {
            phase: snapshot.phase,
            faults: snapshot.faults,
            temperature_c,
            phase_a: self.scale.amperes(magnitude(snapshot.i.d, snapshot.i.q)),
            time_us: u32::try_from(time_us).unwrap_or(u32::MAX),
        };
        let rests = self.recorder.look(&mut self.telemetry.statistics, &sight);
        if rests {
            self.storage.changed(now_us);
        }
    }

    /// The next request that only the caller can carry out.
    ///
    /// After [`Request::ParamsChanged`] the interrupt shall run with [`Esc::config`]; this side has done its
    /// part. A request for storage waits until the bridge rests and the one before has ended; nothing turns
    /// the motor from then on until [`Esc::storage_done`]. A restart waits for storage, and is given up if the
    /// wire is armed meanwhile.
    pub fn take_request(&mut self, throttle: &mut impl Reach) -> Option<Request> {
        let now_us = self.polled_us.unwrap_or(0);
        if core::mem::take(&mut self.reassumes) {
            self.apply(throttle);
            return Some(Request::ParamsChanged);
        }
        let request = self.component.take_request();
        if self.component.take_changed() {
            self.storage.changed(now_us);
        }
        match request {
            Some(Request::ParamsChanged) => {
                self.apply(throttle);
                return request;
            }
            Some(Request::Reboot) => {
                self.storage.reboot();
                if self.storage.reboots_later(now_us) {
                    self.warn_of("Reboot waits up to 3 min: saves are spaced");
                }
            }
            Some(Request::FactoryReset) => {
                let mut defaults = Params::default();
                defaults.fit(&self.board);
                match self.given.check(&defaults, &self.board) {
                    Ok(()) => self.storage.ask(request),
                    Err(error) => self.component.storage_done(Err(error.reason)),
                }
            }
            // A direction is to be stored: all others with it, which nobody has set.
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
        // Nothing turns the motor from then on.
        if self.storage.reboots() && throttle.reach(Throttle::store) {
            self.storage.cancel_reboot();
            return Some(Request::Reboot);
        }
        let stores = self.storage.waits(now_us) && self.may_store();
        if stores && throttle.reach(Throttle::store) {
            return self.storage.take(now_us);
        }
        None
    }

    /// Flash stalls the chip for up to half a second, in which the bridge is off and nothing is
    /// controlled: it must not switch, nor be about to.
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

    /// Tells how a request for storage ended, so that it is acknowledged, and lets the motor turn
    /// again.
    pub fn storage_done(&mut self, throttle: &mut impl Reach, result: Result<(), &'static str>) {
        throttle.reach(Throttle::stored);
        if self.storage.takes_all() && result.is_ok() {
            self.unstored.clear();
        }
        match (self.storage.done(result.is_ok()), result) {
            (Some(Asker::Wire), _) => self.component.tell_stored(result),
            (Some(Asker::Mavlink), _) => self.component.storage_done(result),
            (Some(Asker::Nobody), Err(reason)) => self.warn_of(reason),
            _ => {}
        }
    }

    fn apply(&mut self, throttle: &mut impl Reach) {
        // Each change has been validated: a drive can be made of it.
        self.scale = scale(&self.running(), &self.board);
        throttle.reach(|throttle| throttle.adopt(&self.params, self.scale));
        self.tell_info(throttle);
    }

    fn tell_info(&self, throttle: &mut impl Reach) {
        let info = info(&self.params, self.light, &self.board.image);
        throttle.reach(|throttle| throttle.tell_info(info));
    }

    fn with_component(
        &mut self,
        throttle: &mut impl Reach,
        now_us: u64,
        run: impl FnOnce(&mut Component, &mut Context),
    ) {
        let (given, board) = (self.given, self.board);
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
            authority: &mut Reached(throttle),
            validate: &|params| given.check(params, &board),
        };
        run(&mut self.component, &mut context);
    }
}

#[cfg(test)]
mod tests;
