//! The settings that follow from the motor: those of [`Kind::FromMotor`], wherever they are 0.
//!
//! Each share below, except the alignment's and the slew's, is common to two hand-tuned benches: a 5-inch racing motor,
//! and the first paper's motor with its propeller.

use core::f32::consts::{PI, TAU};

#[cfg(doc)]
use super::table::Kind;
use super::table::ParamId;
use super::values::Params;

/// Ramp current of an open-loop start over `LIM_PHASE_A`.
const RAMP_SHARE: f32 = 0.2;

/// Time for which the full ramp current aligns the rotor, s. With a quarter of it one motor in fourteen still swings
/// when the ramp begins, from some initial angles. The start lengthens it for a rotor that swings slowly.
const PARK_S: f32 = 0.4;

/// Back-EMF at the least speed over the ramp current's drop across R. To take over from the ramp, the observer needs
/// the dead time's voltage on top; a part of that keeps it in lock, since the i_d bias makes the sign of each current
/// known.
const EMF_SHARE: f32 = 1.5;
const LEAST_DEAD_SHARE: f32 = 0.25;

/// Least speed over `CTL_RPM_MAX`.
pub const LEAST_SHARE: f32 = 0.05;

/// Least electrical frequency, Hz: the speed loop's bandwidth is a share of it.
const LEAST_HZ: f32 = 30.0;

/// Electrical turns of the ramp: the observer needs several to settle.
const RAMP_TURNS: f32 = 12.0;

/// Acceleration of the ramp over what its current achieves without load.
const RAMP_TORQUE_SHARE: f32 = 0.2;

/// PWM periods per period of the current loop's bandwidth. Fewer than 20 are refused.
const CURRENT_PERIODS: f32 = 48.0;

/// Speed error over `CTL_RPM_MAX` at which the loop demands `LIM_PHASE_A`.
const SPEED_ERROR_SHARE: f32 = 0.05;

/// Greatest speed bandwidth over the current loop's, and over the electrical frequency at which the observer takes
/// over: it knows the speed no sooner.
const SPEED_SHARE: f32 = 0.05;
const SPEED_RUN_SHARE: f32 = 0.12;

/// k_p of the speed loop over inertia and bandwidth, from its two equal poles (`control::speed`).
const SPEED_GAIN: f32 = 1.6;

/// Slew over what `LIM_PHASE_A` achieves without load. At half of it thrust takes twice the least time; at one and a
/// half times it the whoop's angle is off by 21° while braking.
const SLEW_SHARE: f32 = 1.0;

/// The settings in force: those chosen, and for each that is 0, what follows from the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FromMotor {
    /// `CTL_RPM_MIN`.
    pub least_rpm: f32,
    /// `CTL_SLEW_RPM_S`.
    pub slew_rpm_s: f32,
    /// `CTL_BW_CUR_HZ`.
    pub current_hz: f32,
    /// `CTL_BW_SPD_HZ`.
    pub speed_hz: f32,
    /// `STA_PARK_AS`.
    pub park_as: f32,
    /// `STA_RAMP_A`.
    pub ramp_a: f32,
    /// `STA_RAMP_RPM_S`.
    pub ramp_rpm_s: f32,
    /// `STA_RUN_RPM`.
    pub run_rpm: f32,
    /// What the dead time takes of a phase's voltage at the highest supply: the fundamental of a square wave, V.
    pub dead_v: f32,
}

impl FromMotor {
    /// Derives the settings from parameters that are [in force](Params::in_force).
    #[inline(never)] // the throttle mapping and the coefficients call it
    pub fn new(params: &Params) -> Self {
        let motor = Motor::new(params);
        let in_force = |id, value| in_force(params, id, value);
        let ramp_a = in_force(ParamId::StaRampA, RAMP_SHARE * motor.limit_a);
        let dead_s = params.get(ParamId::PwmDeadtimeNs) * 1e-9;
        let dead_v = 4.0 / PI * dead_s * motor.pwm_hz * params.get(ParamId::LimBusVMax);
        let run_rpm = motor.rpm(ramp_a, dead_v);
        let run_rpm = in_force(ParamId::StaRunRpm, most(run_rpm));
        let least_rpm = most(motor.rpm(ramp_a, LEAST_DEAD_SHARE * dead_v));
        let current_hz = in_force(ParamId::CtlBwCurHz, motor.pwm_hz / CURRENT_PERIODS);
        let speed_hz = motor.speed_hz(current_hz, run_rpm);
        let slew_rpm_s = SLEW_SHARE * motor.rpm_s_per_a * motor.limit_a;
        Self {
            least_rpm: in_force(ParamId::CtlRpmMin, least_rpm),
            slew_rpm_s: in_force(ParamId::CtlSlewRpmS, slew_rpm_s),
            current_hz,
            speed_hz: in_force(ParamId::CtlBwSpdHz, least(speed_hz)),
            park_as: in_force(ParamId::StaParkAs, PARK_S * ramp_a),
            ramp_a,
            ramp_rpm_s: in_force(
                ParamId::StaRampRpmS,
                least(motor.ramp_rpm_s(ramp_a, run_rpm)),
            ),
            run_rpm,
            dead_v,
        }
    }

    /// Returns each setting of these parameters in the table's order, with what it follows from, or that it was chosen.
    pub fn reasons(&self, stated: &Params) -> [(ParamId, f32, &'static str); 9] {
        let params = &stated.in_force();
        let motor = Motor::new(params);
        let run = motor.rpm(self.ramp_a, self.dead_v);
        let slowest = motor.rpm(self.ramp_a, LEAST_DEAD_SHARE * self.dead_v);
        let speed = motor.speed_hz(self.current_hz, self.run_rpm);
        let ramp = motor.ramp_rpm_s(self.ramp_a, self.run_rpm);
        let of_run = [
            "back-EMF over R, STA_RAMP_A and the dead time",
            "a twentieth of CTL_RPM_MAX",
            "30 electrical turns a second",
        ];
        let of_slowest = [
            "back-EMF over R, STA_RAMP_A and a part of the dead time",
            of_run[1],
            of_run[2],
        ];
        let of_speed = [
            "LIM_PHASE_A for an error of a twentieth of CTL_RPM_MAX",
            "a twentieth of CTL_BW_CUR_HZ",
            "an eighth of the electrical frequency at STA_RUN_RPM",
        ];
        let of_ramp = [
            "a fifth of STA_RAMP_A's torque over J",
            "12 electrical turns to STA_RUN_RPM",
        ];
        let settings = [
            (
                ParamId::CtlRpmMin,
                self.least_rpm,
                text(slowest, most(slowest), of_slowest),
            ),
            (
                ParamId::CtlSlewRpmS,
                self.slew_rpm_s,
                "LIM_PHASE_A's torque over J",
            ),
            (
                ParamId::CtlBwCurHz,
                self.current_hz,
                "a 48th of PWM_FREQ_HZ",
            ),
            (
                ParamId::CtlBwSpdHz,
                self.speed_hz,
                text(speed, least(speed), of_speed),
            ),
            (ParamId::PwmFreqHz, motor.pwm_hz, stated.pwm_from()),
            (ParamId::StaParkAs, self.park_as, "0.4 s of STA_RAMP_A"),
            (ParamId::StaRampA, self.ramp_a, "a fifth of LIM_PHASE_A"),
            (
                ParamId::StaRampRpmS,
                self.ramp_rpm_s,
                text(ramp, least(ramp), of_ramp),
            ),
            (
                ParamId::StaRunRpm,
                self.run_rpm,
                text(run, most(run), of_run),
            ),
        ];
        settings.map(|(id, value, from)| {
            // PWM_FREQ_HZ is never 0 in force, and CTL_RPM_MIN may be 0 only there.
            let follows = [stated, params].iter().any(|of| of.get(id) == 0.0);
            (id, value, if follows { from } else { "chosen" })
        })
    }
}

/// What the settings follow from, in SI and rpm.
struct Motor {
    resistance_ohm: f32,
    flux_wb: f32,
    pole_pairs: f32,
    /// Acceleration per ampere without load.
    rpm_s_per_a: f32,
    limit_a: f32,
    max_rpm: f32,
    pwm_hz: f32,
}

impl Motor {
    fn new(params: &Params) -> Self {
        let get = |id| params.get(id);
        let flux_wb = get(ParamId::MotFluxMwb) * 1e-3;
        let pole_pairs = get(ParamId::MotPolePairs);
        let per_inertia = 1e7 / get(ParamId::MotJGcm2);
        Self {
            resistance_ohm: get(ParamId::MotRMohm) * 1e-3,
            flux_wb,
            pole_pairs,
            rpm_s_per_a: 1.5 * pole_pairs * flux_wb * per_inertia * (60.0 / TAU),
            limit_a: get(ParamId::LimPhaseA),
            max_rpm: get(ParamId::CtlRpmMax),
            pwm_hz: get(ParamId::PwmFreqHz),
        }
    }

    /// Returns the bounds of a speed that the observer can know: the greatest holds, capped at full throttle.
    fn rpm(&self, ramp_a: f32, dead_v: f32) -> [f32; 3] {
        let emf_v = EMF_SHARE * self.resistance_ohm * ramp_a + dead_v;
        let by_emf = emf_v / (self.flux_wb * self.pole_pairs) * (60.0 / TAU);
        let by_turns = LEAST_HZ * 60.0 / self.pole_pairs;
        [
            by_emf.min(self.max_rpm),
            LEAST_SHARE * self.max_rpm,
            by_turns.min(self.max_rpm),
        ]
    }

    /// Returns the bounds of the ramp's acceleration: the least holds.
    fn ramp_rpm_s(&self, ramp_a: f32, run_rpm: f32) -> [f32; 2] {
        [
            RAMP_TORQUE_SHARE * self.rpm_s_per_a * ramp_a,
            self.pole_pairs * run_rpm * run_rpm / (120.0 * RAMP_TURNS),
        ]
    }

    /// Returns the bounds of the speed loop's bandwidth: the least holds.
    fn speed_hz(&self, current_hz: f32, run_rpm: f32) -> [f32; 3] {
        let error_rpm = SPEED_ERROR_SHARE * self.max_rpm;
        [
            self.limit_a * self.rpm_s_per_a / (SPEED_GAIN * TAU * error_rpm),
            SPEED_SHARE * current_hz,
            SPEED_RUN_SHARE / 60.0 * run_rpm * self.pole_pairs,
        ]
    }
}

/// Returns the chosen value, or what follows, within the parameter's range.
#[inline(never)] // eight callers
fn in_force(params: &Params, id: ParamId, follows: f32) -> f32 {
    let chosen = params.get(id);
    if chosen == 0.0 {
        id.held(follows)
    } else {
        chosen
    }
}

fn least<const N: usize>(bounds: [f32; N]) -> f32 {
    bounds.into_iter().fold(f32::INFINITY, f32::min)
}

fn most<const N: usize>(bounds: [f32; N]) -> f32 {
    bounds.into_iter().fold(0.0, f32::max)
}

/// Returns the text of the bound in force.
fn text<const N: usize>(bounds: [f32; N], in_force: f32, texts: [&'static str; N]) -> &'static str {
    let at = bounds.iter().position(|bound| *bound == in_force);
    texts[at.unwrap_or_default()]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{BOSSO_MOTOR, Kind, RACING};

    /// The first paper's motor with these values.
    pub(crate) fn params(values: &[(ParamId, f32)]) -> Params {
        let mut params = Params::of(&BOSSO_MOTOR);
        for (id, value) in values {
            params.set(*id, *value).expect("in range");
        }
        params
    }

    fn made(values: &[(ParamId, f32)]) -> FromMotor {
        FromMotor::new(&params(values))
    }

    /// By hand: 1.5·33 mΩ·8 A is 0.396 V, 4/π·200 ns·48 kHz·20 V is 0.2445 V; with 7 pole pairs of 0.3215 mWb, 0.6405 V
    /// is 284.6 rad/s, 2718 rpm.
    #[test]
    fn a_racing_motor_s_settings_are_those_of_the_formulas() {
        let made = made(&RACING);
        for (value, wanted) in [
            (made.ramp_a, 8.0),
            (made.park_as, 3.2),
            (made.run_rpm, 2718.0),
            // 0.396 V plus a quarter of 0.2445 V.
            (made.least_rpm, 1939.7),
            (made.current_hz, 1000.0),
            // 0.2·3.376 mNm/A·8 A/6.3 µkgm² is 857.4 rad/s².
            (made.ramp_rpm_s, 8188.0),
            // 40 A·3.376 mNm/A over 1.6·6.3 µkgm²·104.7 rad/s is 127.9 1/s.
            (made.speed_hz, 20.36),
            // 40 A·3.376 mNm/A/6.3 µkgm² is 21 434 rad/s².
            (made.slew_rpm_s, 204_680.0),
        ] {
            assert!((value / wanted - 1.0).abs() < 1e-3, "{made:?}: {wanted}");
        }
    }

    #[test]
    fn what_was_chosen_stays_and_the_others_follow_from_it() {
        let mut values = RACING.to_vec();
        values.push((ParamId::StaRampA, 4.0));
        values.push((ParamId::CtlBwCurHz, 240.0));
        let params = params(&values);
        let made = FromMotor::new(&params);
        assert_eq!((made.ramp_a, made.park_as), (4.0, 1.6));
        assert_eq!(made.current_hz, 240.0);
        assert!((made.speed_hz - 12.0).abs() < 1e-3, "{made:?}");
        let reasons = made.reasons(&params);
        let [_, _, current, speed, _, _, ramp, ..] = reasons;
        assert_eq!(current, (ParamId::CtlBwCurHz, 240.0, "chosen"));
        assert_eq!(ramp, (ParamId::StaRampA, 4.0, "chosen"));
        assert_eq!(
            (speed.1, speed.2),
            (made.speed_hz, "a twentieth of CTL_BW_CUR_HZ")
        );
        for (id, value, _) in reasons {
            assert!(id.entry().kind == Kind::FromMotor && id.entry().allows(value));
        }
    }

    #[test]
    fn a_setting_beyond_its_range_is_at_the_end_of_it() {
        let made = made(&[(ParamId::MotJGcm2, 0.1), (ParamId::LimPhaseA, 200.0)]);
        assert_eq!(made.slew_rpm_s, ParamId::CtlSlewRpmS.entry().max);
    }

    #[test]
    fn the_observer_never_takes_over_above_full_throttle() {
        let made = made(&[(ParamId::MotFluxMwb, 0.1), (ParamId::CtlRpmMax, 1000.0)]);
        assert_eq!(made.run_rpm, 1000.0);
    }
}
