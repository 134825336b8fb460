//! The motor assumed where the parameters do not describe it.
//!
//! Its full speed at `LIM_BUS_V_MAX` is the fastest that six-step follows at this PWM frequency, so every unit and
//! coefficient fits the supply, the PWM and the limit, whatever the motor.

use core::f32::consts::TAU;

use siskin_units::math::SQRT_3;

use super::choice::{CtlDrive, CtlMode};
use super::table::{Choice, ParamId};
use super::values::Params;

/// Pole pairs of most small motors: 12 slots, 14 magnets.
pub const POLE_PAIRS: f32 = 7.0;

/// PWM periods per electrical turn at full speed: just over the four per sextant that six-step needs.
const TURN_PERIODS: f32 = 25.0;

/// Drop of `LIM_PHASE_A` across R over the supply/√3: 0.05 to 0.15 for motors that the limit suits.
const DROP_SHARE: f32 = 0.1;

/// L/R, s: 0.15 to 0.8 ms for motors of all sizes.
const WINDING_S: f32 = 0.35e-3;

/// Time in which `LIM_PHASE_A` takes motor and load to full speed without drag, s: 0.04 to 0.34 s from the library's
/// 3-inch motor to the first paper's with its propeller.
const RUN_UP_S: f32 = 0.12;

impl Params {
    /// Returns the first of R, L and flux that is not known: field-oriented control needs all three.
    pub fn unknown(&self) -> Option<ParamId> {
        let needed = [ParamId::MotRMohm, ParamId::MotLUh, ParamId::MotFluxMwb];
        needed.into_iter().find(|id| self.get(*id) == 0.0)
    }

    /// Returns the pole pairs, assumed if they are not known.
    pub fn pole_pairs(&self) -> f32 {
        match self.get(ParamId::MotPolePairs) {
            0.0 => POLE_PAIRS,
            stated => stated,
        }
    }

    /// Returns true if the drive in force is the six-step drive.
    pub fn drives_by_six_step(&self) -> bool {
        match self.choice() {
            CtlDrive::FieldOriented => false,
            CtlDrive::SixStep => true,
            CtlDrive::Automatic => self.unknown().is_some(),
        }
    }

    /// Returns the parameters that a drive is built from: `CTL_DRIVE` is decided, and what is unknown of the motor is
    /// assumed; `PWM_FREQ_HZ` follows from it where it is 0.
    ///
    /// If `CTL_DRIVE` is 2 and R, L or flux is unknown, throttle is a share of the supply and `CTL_RPM_MAX` does not
    /// bind.
    pub fn in_force(&self) -> Self {
        let mut made = self.clone();
        let unknown = self.unknown().is_some();
        let supply_v = self.get(ParamId::LimBusVMax);
        let limit_a = self.get(ParamId::LimPhaseA);
        let pole_pairs = self.pole_pairs();
        made.assume(ParamId::MotPolePairs, pole_pairs);
        made.assume(ParamId::PwmFreqHz, self.pwm_hz());
        if unknown {
            let fastest_hz = made.get(ParamId::PwmFreqHz) / TURN_PERIODS;
            let resistance_ohm = DROP_SHARE / SQRT_3 * supply_v / limit_a;
            made.assume(ParamId::MotRMohm, 1e3 * resistance_ohm);
            made.assume(ParamId::MotLUh, 1e6 * WINDING_S * resistance_ohm);
            let flux_wb = supply_v / (SQRT_3 * TAU * fastest_hz);
            made.assume(ParamId::MotFluxMwb, 1e3 * flux_wb);
            made.assume(ParamId::MotJGcm2, 0.0);
            if self.chosen(CtlDrive::Automatic) {
                made.assume(CtlMode::PARAM, f32::from(CtlMode::Voltage.number()));
                made.assume(ParamId::CtlRpmMax, 60.0 * fastest_hz / pole_pairs);
                made.assume(ParamId::CtlRpmMin, 0.0);
            }
        }
        if made.get(ParamId::MotJGcm2) == 0.0 {
            let linkage_wb = 1e-3 * pole_pairs * made.get(ParamId::MotFluxMwb);
            // J = torque times time over the speed at which the back-EMF equals the supply.
            let torque_nm = 1.5 * linkage_wb * limit_a;
            let fastest_rad_s = supply_v / (SQRT_3 * linkage_wb);
            let inertia_kgm2 = RUN_UP_S * torque_nm / fastest_rad_s;
            made.assume(ParamId::MotJGcm2, 1e7 * inertia_kgm2);
        }
        if self.chosen(CtlDrive::Automatic) {
            let drive = if self.drives_by_six_step() {
                CtlDrive::SixStep
            } else {
                CtlDrive::FieldOriented
            };
            made.assume(CtlDrive::PARAM, f32::from(drive.number()));
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BOSSO_MOTOR;

    #[test]
    fn pole_pairs_that_are_missing_are_seven_and_without_a_flux_there_is_no_kv() {
        let made = Params::default().in_force();
        assert_eq!(made.get(ParamId::MotPolePairs), 7.0);
        for missing in [ParamId::MotFluxMwb, ParamId::MotPolePairs] {
            let mut params = Params::of(&BOSSO_MOTOR);
            params.set(missing, 0.0).expect("in range");
            assert_eq!(params.get(ParamId::MotKv), 0.0);
        }
    }
}
