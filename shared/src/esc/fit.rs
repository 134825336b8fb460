//! Whether parameters make a drive.

use core::mem::MaybeUninit;

use siskin_params::{Board, ParamId, Params};
use siskin_units::Scale;

use crate::build::{BuildError, build_in, scale};
use crate::drive::{Config, Drift, put_default};

/// Values the drive runs with in place of the parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overrides {
    /// The frequency at power-up, which the timer runs at, Hz.
    pub(super) pwm_freq_hz: f32,
    /// Dead time, ns.
    pwm_deadtime_ns: f32,
    /// A command has turned the direction against `MOT_DIR`.
    pub(super) opposite: bool,
}

impl Overrides {
    /// Puts what the drive actually runs with in place of the parameters.
    pub(super) fn put(self, params: &mut Params) {
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
        // Only what waits for a restart differs, and the direction, which fits either way.
        let param = if params.pwm_hz() == self.pwm_freq_hz {
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
                pwm_freq_hz: params.pwm_hz(),
                pwm_deadtime_ns: params.get(ParamId::PwmDeadtimeNs),
                opposite: false,
            },
            unfit,
            scale: scale(params, board),
        }
    }
}
