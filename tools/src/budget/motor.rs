//! The motor and settings of a budget, from parameters and the command line.

use std::f64::consts::TAU;

use siskin_control::build::FluxSettings;
use siskin_params::{FromMotor, ParamId};

use super::limits::{HoldOff, Settings};
use crate::cli::BudgetArgs;
use crate::error::Error;
use crate::given;

/// A motor and the settings by which its angle is found.
pub(crate) struct Motor {
    pub(crate) pole_pairs: f64,
    pub(crate) settings: Settings,
}

impl Motor {
    /// Builds it from the parameters, which the arguments override.
    ///
    /// # Errors
    /// [`Error::Usage`] or [`Error::File`].
    pub(crate) fn of(args: &BudgetArgs, component: Option<u8>) -> Result<Self, Error> {
        let mut params = given::params(&args.given, component)?;
        let pole_pairs = args.pole_pairs.or(args.poles.map(|poles| poles / 2));
        for (id, value) in [
            (ParamId::MotPolePairs, pole_pairs.map(f64::from)),
            (ParamId::CtlSlewRpmS, args.acceleration.filter(|x| *x > 0.0)),
            (ParamId::PwmFreqHz, args.pwm),
        ] {
            if let Some(value) = value {
                given::set(&mut params, id, value as f32).map_err(Error::Usage)?;
            }
        }
        let params = params.in_force();
        let get = |id| f64::from(params.get(id));
        let pole_pairs = get(ParamId::MotPolePairs);
        let rad_s_per_rpm = pole_pairs * TAU / 60.0;
        let acceleration = args
            .acceleration
            .unwrap_or_else(|| f64::from(FromMotor::new(&params).slew_rpm_s));
        let drive = FluxSettings::new(&params);
        // Values given as in the paper apply at every speed.
        let from = |given: Option<f64>, above_hz: f32| match given {
            Some(_) => 0.0,
            None => f64::from(above_hz) * TAU,
        };
        let drive_hpfs_s = match args.tau_int {
            Some(_) => None,
            None => drive.tau_hpfs_s.map(f64::from),
        };
        Ok(Self {
            pole_pairs,
            settings: Settings {
                tau_int_s: args.tau_int.unwrap_or(f64::from(drive.tau_int_s)),
                tau_hpfs_s: args.tau_hpfs.or(drive_hpfs_s),
                hold_off: match args.hold_off {
                    Some(time_us) => HoldOff::Time(time_us * 1e-6),
                    None => HoldOff::Angle(f64::from(drive.hold_off_turns) * 360.0),
                },
                turns: args.turns.unwrap_or(f64::from(drive.turns)),
                every_edge: args.turns.is_none(),
                whole_turns_above: from(args.turns, drive.whole_turns_above_hz),
                a_e: args.a_e.unwrap_or(f64::from(drive.a_e)),
                filter_above: from(args.a_e, drive.filter_above_hz),
                period_s: 1.0 / get(ParamId::PwmFreqHz),
                acceleration: acceleration * rad_s_per_rpm,
                braking: args.braking.unwrap_or(acceleration) * rad_s_per_rpm,
            },
        })
    }

    /// Converts an electrical speed in rad/s to a mechanical one in rpm; accelerations likewise.
    pub(crate) fn rpm(&self, omega: f64) -> f64 {
        omega * 60.0 / (TAU * self.pole_pairs)
    }
}
