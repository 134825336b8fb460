//! Whether the parameters make a drive. They are set one by one and in any order, so on the way to another motor they
//! may not: then the motor is off, and the drive keeps the last configuration that could be built.

use core::mem::MaybeUninit;

use super::Esc;
use crate::drive::{Config, Drift, put_default};
use crate::mavlink::digits;
use crate::params::{Board, BuildError, ParamId, Params, build_in, scale};
use crate::units::Scale;

/// How long no parameter must have changed before the user is told that they do not fit, µs: while a file is loaded,
/// that may pass.
const QUIET_US: u64 = 500_000;

/// Values the drive runs with in place of the parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overrides {
    /// The frequency at power-up, which the timer runs at, Hz.
    pwm_freq_hz: f32,
    /// Dead time, ns.
    pwm_deadtime_ns: f32,
    /// A command has turned the direction against `MOT_DIR`.
    pub(super) opposite: bool,
}

impl Overrides {
    /// Puts what the drive actually runs with in place of the parameters.
    fn put(self, params: &mut Params) {
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
            // The first two were in range at power-up, and a direction is 0 or 1.
            let _ = params.set(id, value);
        }
    }

    /// Checks that these parameters make a valid drive, now and after the next restart.
    pub(super) fn check(self, params: &Params, board: &Board) -> Result<(), BuildError> {
        check(params, board)?;
        let mut running = params.clone();
        self.put(&mut running);
        // Only what waits for a restart differs.
        let param = if params.get(ParamId::PwmFreqHz) == self.pwm_freq_hz {
            ParamId::PwmDeadtimeNs
        } else {
            ParamId::PwmFreqHz
        };
        check(&running, board).map_err(|_| BuildError {
            param,
            reason: "waits for a restart",
        })
    }
}

/// Checks that parameters make a valid drive.
///
/// # Errors
/// The parameter that does not fit the board.
pub fn check(params: &Params, board: &Board) -> Result<(), BuildError> {
    check_drifted(params, board, Drift::NONE)
}

/// The same for a motor that has drifted. Never inlined: a configuration takes 0.9 KB of stack.
#[inline(never)]
pub(super) fn check_drifted(
    params: &Params,
    board: &Board,
    drift: Drift,
) -> Result<(), BuildError> {
    let mut place = MaybeUninit::<Config>::uninit();
    build_in(params, board, drift, put_default(&mut place))
}

/// What a drive powers up with: its parameters, or the defaults if those do not fit.
#[derive(Clone, Copy, Debug)]
pub struct PowerUp {
    pub(super) overrides: Overrides,
    pub(super) unfit: Option<BuildError>,
    pub(super) scale: Scale,
}

impl PowerUp {
    /// Tries parameters on a board.
    // Never inlined: the defaults take 0.4 KB of stack.
    #[inline(never)]
    pub fn new(params: &Params, board: &Board) -> Self {
        let unfit = check(params, board).err();
        let defaults;
        let params = if unfit.is_none() {
            params
        } else {
            defaults = Params::factory(board);
            &defaults
        };
        Self {
            overrides: Overrides {
                pwm_freq_hz: params.get(ParamId::PwmFreqHz),
                pwm_deadtime_ns: params.get(ParamId::PwmDeadtimeNs),
                opposite: false,
            },
            unfit,
            scale: scale(params, board),
        }
    }
}

impl Esc {
    /// Returns the parameters as the drive runs with them, including the motor assumed by a running
    /// identification. At power-up with those that do not fit, they are the defaults.
    pub fn running(&self) -> Params {
        let mut running = if self.unfit.is_none() {
            self.params.clone()
        } else {
            Params::factory(&self.board)
        };
        self.overrides.put(&mut running);
        if self.identify.is_under_way() {
            self.identify.assume(&mut running);
        }
        running
    }

    /// Returns the PWM frequency, which changes at a restart only, Hz.
    pub fn pwm_hz(&self) -> f32 {
        self.overrides.pwm_freq_hz
    }

    /// Takes in whether the parameters, which have changed, make a drive.
    pub(super) fn fits(&mut self, now_us: u64) -> bool {
        self.unfit = self.overrides.check(&self.params, &self.board).err();
        self.tells_us = now_us + QUIET_US;
        self.unfit.is_none()
    }

    /// Tells the user what does not fit once that is due.
    pub(super) fn tell_unfit(&mut self, now_us: u64) {
        if now_us < self.tells_us {
            return;
        }
        self.tells_us = u64::MAX;
        if let Some(BuildError { param, reason }) = self.unfit {
            let value = digits(self.params.get(param));
            self.warn_in_pieces("Motor off: ", [param.entry().name, &value, reason]);
        }
    }
}
