//! The ESC outside the PWM interrupt: what the tasks of the firmware and the loop of the emulator
//! share. It takes edges, frames and snapshots in, and gives set-points, frames and requests out.

use crate::answer::{Answer, Answers, Ask};
use crate::drive::{Config, Fault, Phase, Setpoint, Snapshot};
use crate::input::authority::DriveStatus;
use crate::input::command::Order;
use crate::input::{Heard, Input};
use crate::mavlink::{Component, Context, Frame, Request};
use crate::params::{self, Board, BuildError, ParamId, Params, build};
use crate::setpoint::Mapping;
use crate::telemetry::{Charge, Telemetry};
use crate::tune::Tune;
use heapless::Deque;
use sound::Sound;
use storage::{Asker, Storage};

mod sound;
mod storage;
mod wire;

/// Degrees below `LIM_TEMP_C` at which an over-temperature has ended.
const TEMPERATURE_HYSTERESIS_C: f32 = 5.0;

/// One ESC without its interrupt.
pub struct Esc {
    board: Board,
    given: Given,
    params: Params,
    config: Config,
    mapping: Mapping,
    input: Input,
    answers: Answers,
    component: Component,
    telemetry: Telemetry,
    charge: Charge,
    too_hot: bool,
    polled_us: Option<u64>,
    sound: Sound,
    light: bool,
    /// What DShot commands have ordered since the last poll.
    orders: Deque<Order, 4>,
    storage: Storage,
}

/// What the drive runs with in place of the parameters.
#[derive(Clone, Copy, Debug)]
struct Given {
    /// As it was at the start: the timer runs with it.
    pwm_freq_hz: f32,
    /// Likewise.
    pwm_deadtime_ns: f32,
    /// Whether a command has turned the direction against `MOT_DIR`.
    opposite: bool,
}

impl Given {
    /// The configuration that these parameters make here.
    fn build(self, params: &Params, board: &Board) -> Result<Config, BuildError> {
        build(params, board)?;
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
        build(&running, board)
    }
}

impl Esc {
    /// An ESC at power-up, and what its interrupt shall run with.
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
    ) -> Result<Self, BuildError> {
        let config = build(&params, &board)?;
        Ok(Self {
            board,
            given: Given {
                pwm_freq_hz: params.get(ParamId::PwmFreqHz),
                pwm_deadtime_ns: params.get(ParamId::PwmDeadtimeNs),
                opposite: false,
            },
            mapping: Mapping::new(&params, &config),
            config,
            input: Input::new(tick_hz, params::input(&params)),
            answers: Answers::new(tick_hz),
            component: Component::new(&params, link_bytes_per_s),
            telemetry: Telemetry::new(),
            charge: Charge::default(),
            params,
            too_hot: false,
            polled_us: None,
            sound: Sound::default(),
            light: false,
            orders: Deque::new(),
            storage: Storage::default(),
        })
    }

    /// What the interrupt shall run with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The parameters in force.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The state as telemetry reports it.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// An edge on the throttle wire: when the capturing timer saw it, and the level after it. Returns
    /// what the sender asks for, to be given to [`Esc::answer`].
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) -> Option<Ask> {
        let heard = self.input.edge(now_us, at_ticks, level)?;
        self.heard(heard)
    }

    /// Tells the time of the timer that captures the wire's edges, once a control period or more
    /// often. Returns what [`Esc::edge`] does.
    pub fn settle(&mut self, now_us: u64, now_ticks: u32) -> Option<Ask> {
        let heard = self.input.settle(now_us, now_ticks)?;
        self.heard(heard)
    }

    fn heard(&mut self, heard: Heard) -> Option<Ask> {
        if let Some(order) = heard.order {
            self.order(order);
        }
        Ask::of(&heard.event)
    }

    /// What is sent back to the flight controller, with the drive as it is now.
    pub fn answer(&mut self, ask: Ask, snapshot: &Snapshot) -> Answer {
        self.answers
            .answer(ask, snapshot, &self.config, &self.telemetry)
    }

    /// What the drive is asked for.
    pub fn setpoint(&self) -> Setpoint {
        if self.too_hot {
            return Setpoint::Fault(Fault::OverTemperature);
        }
        let command = self.input.authority().command();
        match self.sound.note() {
            Some(note) if command.rests() => self.mapping.tone(note),
            _ => self.mapping.setpoint(command),
        }
    }

    /// A frame that came in on any MAVLink link.
    pub fn receive(&mut self, now_us: u64, frame: &Frame) {
        self.with_component(now_us, |component, context| {
            component.handle(frame, context);
        });
    }

    /// What is due, about each millisecond: time-outs, telemetry, and frames to every link.
    pub fn poll(
        &mut self,
        now_us: u64,
        snapshot: &Snapshot,
        temperature_c: f32,
        send: &mut dyn FnMut(&[u8]),
    ) {
        if self.polled_us.is_none() {
            self.sound.play(now_us, Tune::Start);
        }
        let before_us = self.polled_us.replace(now_us).unwrap_or(now_us);
        let time_us = now_us.saturating_sub(before_us);
        let limit_c = self.params.get(ParamId::LimTempC);
        let limit_c = if self.too_hot {
            limit_c - TEMPERATURE_HYSTERESIS_C
        } else {
            limit_c
        };
        // A reading that is no number is too hot as well.
        self.too_hot = temperature_c.is_nan() || temperature_c > limit_c;
        let scale = &self.config.scale;
        self.telemetry.observe(snapshot, scale, time_us);
        self.charge
            .add(scale.amperes(snapshot.bus_current), time_us);
        self.telemetry.consumed_mah = self.charge.mah();
        self.telemetry.temperature_c = temperature_c;
        self.input.poll(now_us, self.drive());
        self.telemetry.armed = self.input.authority().armed();
        self.telemetry.signal = self.input.signal(now_us);
        self.telemetry.bad_frames = self.input.bad_frames();
        self.telemetry.bad_share = self.input.bad_share();
        self.follow_wire(now_us);
        self.with_component(now_us, |component, context| component.poll(context, send));
        let rests = self.input.authority().command().rests();
        self.sound.look(now_us, snapshot, rests);
    }

    /// What only the caller can do. [`Request::ParamsChanged`] has been done as far as this side
    /// goes: the interrupt shall run with [`Esc::config`] from now on. A request for storage waits
    /// until the bridge rests and the one before has ended.
    pub fn take_request(&mut self) -> Option<Request> {
        let request = self.component.take_request();
        match request {
            Some(Request::ParamsChanged) => self.apply(),
            Some(Request::Reboot) => {}
            Some(Request::Save | Request::Load | Request::FactoryReset) | None => {
                self.storage.ask(request);
                return self.storage.take_if(self.may_store());
            }
        }
        request
    }

    /// Flash stalls the chip for up to half a second, and the bridge stays as it is meanwhile: it
    /// must not switch, nor be about to.
    fn may_store(&self) -> bool {
        let holds = matches!(self.telemetry.phase, Phase::Idle | Phase::Brake);
        holds && self.drive().stopped && self.sound.note().is_none()
    }

    fn drive(&self) -> DriveStatus {
        self.telemetry.drive(self.input.authority().command())
    }

    /// Puts other parameters in force, as loaded from storage. The interrupt shall run with
    /// [`Esc::config`] afterwards.
    ///
    /// # Errors
    /// The parameter that does not fit the board; nothing has changed then.
    pub fn replace_params(&mut self, params: Params) -> Result<(), BuildError> {
        self.given.build(&params, &self.board)?;
        self.params = params;
        self.apply();
        Ok(())
    }

    /// Tells how a request for storage ended, so that it is acknowledged.
    pub fn storage_done(&mut self, result: Result<(), &'static str>) {
        match self.storage.done() {
            Some(Asker::Wire) => self.component.tell_stored(result),
            Some(Asker::Mavlink) => self.component.storage_done(result),
            None => {}
        }
    }

    fn apply(&mut self) {
        // Each change has been validated: the configuration stays where it cannot be built.
        if let Ok(config) = self.given.build(&self.params, &self.board) {
            self.config = config;
        }
        self.mapping = Mapping::new(&self.params, &self.config);
        self.input.set(params::input(&self.params));
    }

    fn with_component(&mut self, now_us: u64, run: impl FnOnce(&mut Component, &mut Context)) {
        let (given, board) = (self.given, self.board);
        let mut context = Context {
            now_us,
            params: &mut self.params,
            telemetry: &self.telemetry,
            authority: self.input.authority_mut(),
            validate: &|params| given.build(params, &board).map(|_| ()),
        };
        run(&mut self.component, &mut context);
    }
}

#[cfg(test)]
mod tests;
