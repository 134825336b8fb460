//! Parameters that make no drive. They are set one by one and in any order, so on the way to another motor they may
//! not: then the motor is off, and the drive keeps the last configuration that could be built.

use siskin_params::Params;

use super::Esc;
use crate::build::BuildError;
use crate::mavlink::digits;

/// How long no parameter must have changed before the user is told that they do not fit, µs: while a file is loaded,
/// that may pass.
const QUIET_US: u64 = 500_000;

impl Esc {
    /// Returns the parameters as the drive runs with them, including the motor assumed by a running
    /// identification. While the parameters do not fit, they are the defaults, with which the drive powers up then.
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
