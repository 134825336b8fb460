//! The ESC outside the PWM interrupt: what the tasks of the firmware and the loop of the emulator
//! share. It takes edges, frames and snapshots in, and gives set-points, frames and requests out.

use crate::drive::{Config, Fault, Setpoint, Snapshot};
use crate::input::authority::{Authority, Timing};
use crate::input::capture::Decoder;
use crate::input::dshot::Rate;
use crate::mavlink::{Component, Context, Frame, Request};
use crate::params::{Board, BuildError, ParamId, Params, build};
use crate::setpoint::Mapping;
use crate::telemetry::{Charge, Telemetry};

/// Degrees below `LIM_TEMP_C` at which an over-temperature has ended.
const TEMPERATURE_HYSTERESIS_C: f32 = 5.0;

/// One ESC without its interrupt.
pub struct Esc {
    board: Board,
    boot: Boot,
    params: Params,
    config: Config,
    mapping: Mapping,
    protocol: Option<Rate>,
    decoder: Decoder,
    authority: Authority,
    component: Component,
    telemetry: Telemetry,
    charge: Charge,
    too_hot: bool,
    polled_us: Option<u64>,
}

/// Parameters that stay as they were at the start: the timer runs with them.
#[derive(Clone, Copy, Debug)]
struct Boot {
    pwm_freq_hz: f32,
    pwm_deadtime_ns: f32,
}

impl Boot {
    /// The configuration of these parameters on the timer that runs.
    fn build(self, params: &Params, board: &Board) -> Result<Config, BuildError> {
        build(params, board)?;
        let mut running = params.clone();
        let kept = [
            (ParamId::PwmFreqHz, self.pwm_freq_hz),
            (ParamId::PwmDeadtimeNs, self.pwm_deadtime_ns),
        ];
        for (id, value) in kept {
            // It was in range at the start.
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
        let mut esc = Self {
            board,
            boot: Boot {
                pwm_freq_hz: params.get(ParamId::PwmFreqHz),
                pwm_deadtime_ns: params.get(ParamId::PwmDeadtimeNs),
            },
            mapping: Mapping::new(&params, &config),
            config,
            protocol: protocol(&params),
            decoder: Decoder::new(tick_hz),
            authority: Authority::new(timing(&params)),
            component: Component::new(&params, link_bytes_per_s),
            telemetry: Telemetry::new(),
            charge: Charge::default(),
            params,
            too_hot: false,
            polled_us: None,
        };
        esc.decoder.force(esc.protocol);
        let two_directions = esc.params.get(ParamId::Inp3d) != 0.0;
        esc.authority.set_two_directions(two_directions);
        Ok(esc)
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

    /// An edge on the throttle wire: when the capturing timer saw it, and the level after it.
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) {
        if let Some(event) = self.decoder.edge(at_ticks, level) {
            self.authority.wire(now_us, event);
        }
    }

    /// What the drive is asked for.
    pub fn setpoint(&self) -> Setpoint {
        if self.too_hot {
            return Setpoint::Fault(Fault::OverTemperature);
        }
        self.mapping.setpoint(self.authority.command())
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
        let before_us = self.polled_us.replace(now_us).unwrap_or(now_us);
        let time_us = now_us.saturating_sub(before_us);
        self.authority.poll(now_us);
        self.authority.fault(!snapshot.faults.is_empty());
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
        self.telemetry.armed = self.authority.armed();
        self.telemetry.bad_frames = self.authority.bad_frames();
        self.with_component(now_us, |component, context| component.poll(context, send));
    }

    /// What only the caller can do. [`Request::ParamsChanged`] has been done as far as this side
    /// goes: the interrupt shall run with [`Esc::config`] from now on.
    pub fn take_request(&mut self) -> Option<Request> {
        let request = self.component.take_request()?;
        if request == Request::ParamsChanged {
            self.apply();
        }
        Some(request)
    }

    /// Puts other parameters in force, as loaded from storage. The interrupt shall run with
    /// [`Esc::config`] afterwards.
    ///
    /// # Errors
    /// The parameter that does not fit the board; nothing has changed then.
    pub fn replace_params(&mut self, params: Params) -> Result<(), BuildError> {
        self.boot.build(&params, &self.board)?;
        self.params = params;
        self.apply();
        Ok(())
    }

    /// Tells how a request for storage ended, so that it is acknowledged.
    pub fn storage_done(&mut self, result: Result<(), &'static str>) {
        self.component.storage_done(result);
    }

    fn apply(&mut self) {
        // Each change has been validated: the configuration stays where it cannot be built.
        if let Ok(config) = self.boot.build(&self.params, &self.board) {
            self.config = config;
        }
        self.mapping = Mapping::new(&self.params, &self.config);
        self.authority.set_timing(timing(&self.params));
        let two_directions = self.params.get(ParamId::Inp3d) != 0.0;
        self.authority.set_two_directions(two_directions);
        let protocol = protocol(&self.params);
        if protocol != self.protocol {
            // The decoder begins anew with it: not for every change, while frames come in.
            self.protocol = protocol;
            self.decoder.force(protocol);
        }
    }

    fn with_component(&mut self, now_us: u64, run: impl FnOnce(&mut Component, &mut Context)) {
        let (boot, board) = (self.boot, self.board);
        let mut context = Context {
            now_us,
            params: &mut self.params,
            telemetry: &self.telemetry,
            authority: &mut self.authority,
            validate: &|params| boot.build(params, &board).map(|_| ()),
        };
        run(&mut self.component, &mut context);
    }
}

fn timing(params: &Params) -> Timing {
    let us = |id| (params.get(id) * 1000.0) as u64;
    Timing {
        arm_us: us(ParamId::InpArmMs),
        loss_us: us(ParamId::InpLossMs),
    }
}

/// The protocol that `INP_PROTO` forces.
fn protocol(params: &Params) -> Option<Rate> {
    match params.get(ParamId::InpProto) as u32 {
        10 => Some(Rate::Dshot150),
        11 => Some(Rate::Dshot300),
        12 => Some(Rate::Dshot600),
        _ => None,
    }
}
