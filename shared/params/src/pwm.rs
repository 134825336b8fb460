//! The PWM frequency that follows from the motor where `PWM_FREQ_HZ` is 0.

use core::f32::consts::{FRAC_PI_2, TAU};

use siskin_units::math::SQRT_3;

use super::choice::CtlMode;
use super::table::ParamId;
use super::values::Params;

/// PWM periods per electrical turn at `CTL_RPM_MAX`.
const TURN_PERIODS: f32 = 20.0;

/// Least frequency that follows, Hz: above what people hear. A slow motor gets a lower one, whose voltages are then large
/// enough for the control's numbers.
const QUIET_HZ: f32 = 24_000.0;

/// Highest frequency that follows, Hz: the highest of field-oriented control on the first board.
const HIGHEST_HZ: f32 = 54_000.0;

/// Frequency while the motor is not known, Hz. With a higher one the dead times would leave too little of an idling
/// throttle for some motors to start.
const UNKNOWN_HZ: f32 = QUIET_HZ;

/// Lowest supply in units of voltage, where the range of the modulator's reciprocal ends.
pub const BUS_UNITS_MIN: f32 = 0.125;

/// What is kept of that for a flux that was measured too low.
const UNITS_SHARE: f32 = 0.8;

/// PWM periods per electrical turn at the speed whose back-EMF is `LIM_BUS_V_MAX`, where no parameter bounds the speed: a
/// pack and a propeller leave two thirds of it, where there are 15.
const UNLOADED_PERIODS: f32 = 10.0;

impl Params {
    /// Returns the PWM frequency in force, Hz.
    pub fn pwm_hz(&self) -> f32 {
        let stated = self.get(ParamId::PwmFreqHz);
        if stated != 0.0 {
            return stated;
        }
        let hz = if self.unknown().is_some() {
            UNKNOWN_HZ
        } else {
            Pwm::new(self).hz()
        };
        ParamId::PwmFreqHz.held(hz)
    }

    /// Returns what it follows from where `PWM_FREQ_HZ` is 0.
    pub(super) fn pwm_from(&self) -> &'static str {
        if self.unknown().is_some() {
            "the motor is not known"
        } else {
            Pwm::new(self).from()
        }
    }
}

/// Frequencies that follow from a motor, Hz.
struct Pwm {
    /// Enough periods a turn at full speed.
    fast: f32,
    /// The highest that the control's numbers allow.
    most: f32,
}

impl Pwm {
    /// Takes the parameters of a motor of which R, L and flux are known.
    fn new(params: &Params) -> Self {
        let get = |id| params.get(id);
        let supply_v = get(ParamId::LimBusVMax);
        let flux_wb = 1e-3 * get(ParamId::MotFluxMwb);
        let fast = match params.choice() {
            CtlMode::Speed => {
                let turns_hz = params.pole_pairs() * get(ParamId::CtlRpmMax) / 60.0;
                TURN_PERIODS * turns_hz
            }
            CtlMode::Torque | CtlMode::Voltage => {
                UNLOADED_PERIODS * supply_v / (SQRT_3 * TAU * flux_wb)
            }
        };
        Self {
            fast,
            most: UNITS_SHARE * supply_v / (BUS_UNITS_MIN * FRAC_PI_2 * flux_wb),
        }
    }

    /// Returns the frequency, without the bounds of the parameter's range.
    #[expect(
        clippy::manual_clamp,
        reason = "clamp would keep NaN, which these turn into a frequency"
    )]
    fn hz(&self) -> f32 {
        self.fast.max(QUIET_HZ).min(HIGHEST_HZ).min(self.most)
    }

    /// Returns what it follows from.
    fn from(&self) -> &'static str {
        if self.hz() == self.most {
            "as high as flux and LIM_BUS_V_MAX allow"
        } else if self.hz() == QUIET_HZ {
            "nobody hears it"
        } else {
            "enough periods a turn at full speed, as far as there are"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RACING;
    use crate::from_motor::tests::params;

    fn in_force(values: &[(ParamId, f32)]) -> f32 {
        let follows = [(ParamId::PwmFreqHz, 0.0)];
        params(&[&RACING[..], &follows, values].concat())
            .in_force()
            .get(ParamId::PwmFreqHz)
    }

    /// 7 pole pairs.
    #[test]
    fn a_fast_motor_gets_twenty_periods_a_turn_as_far_as_there_are() {
        for (max_rpm, hz) in [
            (10_000.0, 24_000.0),
            (18_000.0, 42_000.0),
            (60_000.0, 54_000.0),
        ] {
            assert_eq!(in_force(&[(ParamId::CtlRpmMax, max_rpm)]), hz);
        }
        // In voltage mode by the supply: 20 V/(√3·2π·0.3215 mWb) is 5716 Hz.
        let voltage = [CtlMode::Voltage.setting(), (ParamId::CtlRpmMax, 10_000.0)];
        assert_eq!(in_force(&voltage), 54_000.0);
        let slower = [voltage[0], (ParamId::MotFluxMwb, 0.643)];
        assert!((in_force(&slower) - 28_581.0).abs() < 10.0);
        assert_eq!(
            in_force(&[(ParamId::PwmFreqHz, 30_000.0), voltage[0]]),
            30_000.0
        );
    }

    #[test]
    fn a_motor_that_is_not_known_gets_the_same_whatever_it_is() {
        for flux_mwb in [0.1, 30.0] {
            let values = [(ParamId::MotRMohm, 0.0), (ParamId::MotFluxMwb, flux_mwb)];
            assert_eq!(in_force(&values), UNKNOWN_HZ);
        }
    }
}
