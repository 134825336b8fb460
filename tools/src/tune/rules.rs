//! The settings that follow from a motor, and from what.
//!
//! Each share below, but the alignment's, is one that two benches set by hand have in common: a 5-inch racing
//! motor's, and that of the first paper's motor with its propeller.

use std::f64::consts::{PI, TAU};

use siskin_control::params::{ParamId, Params};

/// Ramp current of an open-loop start over `LIM_PHASE_A`.
const RAMP_SHARE: f64 = 0.2;

/// Time for which the whole ramp current aligns the rotor, s. With a quarter of it one motor in fourteen swings
/// still when the ramp begins, at some angles that it may start from. The drive makes it longer for one that
/// swings slowly.
const PARK_S: f64 = 0.4;

/// Back-EMF over the ramp current's drop across R, where the observer takes over.
const EMF_SHARE: f64 = 1.5;

/// Speed at which the observer takes over, over `CTL_RPM_MAX`.
const RUN_SHARE: f64 = 0.05;

/// Electrical frequency at which the observer takes over, at least, Hz: the speed loop is a part of it.
const RUN_HZ: f64 = 30.0;

/// Electrical turns of the ramp: the observer needs some of them to settle.
const RAMP_TURNS: f64 = 12.0;

/// Acceleration of the ramp over what its current can do without a load.
const RAMP_TORQUE_SHARE: f64 = 0.2;

/// Periods of the PWM in one of the current loop's bandwidth. The drive refuses less than 20.
const CURRENT_PERIODS: f64 = 48.0;

/// Error of the speed, over `CTL_RPM_MAX`, for which the loop asks for `LIM_PHASE_A`.
const SPEED_ERROR_SHARE: f64 = 0.05;

/// Speed loop's bandwidth over the current loop's, at most, and over the electrical frequency at which the
/// observer takes over: it knows the speed no sooner.
const SPEED_SHARE: f64 = 0.05;
const SPEED_RUN_SHARE: f64 = 0.12;

/// k_p of the speed loop over inertia and bandwidth, by its two equal poles (`control::speed`).
const SPEED_GAIN: f64 = 1.6;

/// Slew over what `LIM_PHASE_A` can do without a load.
const SLEW_SHARE: f64 = 0.5;

/// Periods of the PWM in an electrical turn at `CTL_RPM_MAX`, at least.
const TURN_PERIODS: f64 = 20.0;

/// A setting.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    pub(crate) id: ParamId,
    pub(crate) value: f32,
    /// What it follows from.
    pub(crate) from: &'static str,
}

/// A bound with what it follows from.
type Bound = (f64, &'static str);

fn most<const N: usize>(bounds: [Bound; N]) -> Bound {
    let most = bounds.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    most.expect("a list of bounds has some")
}

fn least<const N: usize>(bounds: [Bound; N]) -> Bound {
    let least = bounds.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    least.expect("a list of bounds has some")
}

/// The settings for the motor, the limits and the speed of these parameters, in the order of their numbers.
/// Each has three digits and is within its range.
pub(crate) fn settings(params: &Params) -> Vec<Setting> {
    let get = |id| f64::from(params.get(id));
    let resistance_ohm = get(ParamId::MotRMohm) * 1e-3;
    let flux_wb = get(ParamId::MotFluxMwb) * 1e-3;
    let pole_pairs = get(ParamId::MotPolePairs);
    let inertia_kgm2 = get(ParamId::MotJGcm2) * 1e-7;
    let limit_a = get(ParamId::LimPhaseA);
    let max_rpm = get(ParamId::CtlRpmMax);
    let nm_per_a = 1.5 * pole_pairs * flux_wb;
    let rpm = |rad_s: f64| rad_s * 60.0 / TAU;

    let max_hz = max_rpm * pole_pairs / 60.0;
    let pwm = most([
        (get(ParamId::PwmFreqHz), "as it was"),
        (
            (TURN_PERIODS * max_hz).min(f64::from(ParamId::PwmFreqHz.entry().max)),
            "20 periods a turn at CTL_RPM_MAX",
        ),
    ]);
    let dead_v = 4.0 / PI * get(ParamId::PwmDeadtimeNs) * 1e-9 * pwm.0 * get(ParamId::LimBusVMax);

    let ramp_a = RAMP_SHARE * limit_a;
    let emf_v = EMF_SHARE * resistance_ohm * ramp_a + dead_v;
    let run = most([
        (
            rpm(emf_v / (flux_wb * pole_pairs)),
            "back-EMF over R, STA_RAMP_A and the dead time",
        ),
        (RUN_SHARE * max_rpm, "a twentieth of CTL_RPM_MAX"),
        (RUN_HZ * 60.0 / pole_pairs, "30 electrical turns a second"),
    ]);
    let ramp_rpm_s = least([
        (
            rpm(RAMP_TORQUE_SHARE * nm_per_a * ramp_a / inertia_kgm2),
            "a fifth of STA_RAMP_A's torque over J",
        ),
        (
            pole_pairs * run.0 * run.0 / (120.0 * RAMP_TURNS),
            "12 electrical turns to STA_RUN_RPM",
        ),
    ]);
    let current_hz = pwm.0 / CURRENT_PERIODS;
    let error_rad_s = SPEED_ERROR_SHARE * max_rpm * TAU / 60.0;
    let speed_hz = least([
        (
            limit_a * nm_per_a / (SPEED_GAIN * inertia_kgm2 * error_rad_s) / TAU,
            "LIM_PHASE_A for an error of a twentieth of CTL_RPM_MAX",
        ),
        (SPEED_SHARE * current_hz, "a twentieth of CTL_BW_CUR_HZ"),
        (
            SPEED_RUN_SHARE * run.0 * pole_pairs / 60.0,
            "an eighth of the electrical frequency at STA_RUN_RPM",
        ),
    ]);
    let slew_rpm_s = rpm(SLEW_SHARE * nm_per_a * limit_a / inertia_kgm2);

    let bounds = [
        (ParamId::CtlRpmMin, (run.0, "STA_RUN_RPM")),
        (
            ParamId::CtlSlewRpmS,
            (slew_rpm_s, "half of LIM_PHASE_A's torque over J"),
        ),
        (ParamId::CtlBwCurHz, (current_hz, "a 48th of PWM_FREQ_HZ")),
        (ParamId::CtlBwSpdHz, speed_hz),
        (ParamId::PwmFreqHz, pwm),
        (ParamId::StaParkAs, (PARK_S * ramp_a, "0.4 s of STA_RAMP_A")),
        (ParamId::StaRampA, (ramp_a, "a fifth of LIM_PHASE_A")),
        (ParamId::StaRampRpmS, ramp_rpm_s),
        (ParamId::StaRunRpm, run),
    ];
    let setting = |(id, (value, from))| Setting {
        id,
        value: within(id, value),
        from,
    };
    bounds.map(setting).into()
}

/// Three digits of a value, within the range of its parameter.
fn within(id: ParamId, value: f64) -> f32 {
    let entry = id.entry();
    let digits: f32 = format!("{value:.2e}").parse().unwrap_or(entry.default);
    digits.clamp(entry.min, entry.max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(values: &[(ParamId, f32)]) -> Params {
        let mut params = Params::default();
        for (id, value) in values {
            params.set(*id, *value).expect("in range");
        }
        params
    }

    fn get(settings: &[Setting], id: ParamId) -> (f32, &'static str) {
        let setting = settings.iter().find(|setting| setting.id == id);
        setting
            .map(|setting| (setting.value, setting.from))
            .expect("it is one")
    }

    /// By hand: 1.5·33 mΩ·8 A is 0.396 V, 4/π·200 ns·48 kHz·20 V is 0.2445 V; 0.6405 V are 284.6 rad/s, 2718 rpm,
    /// of 7 pole pairs of 0.3215 mWb.
    #[test]
    fn a_racing_motor_s_settings_are_those_of_the_formulas() {
        let params = params(&[
            (ParamId::MotPolePairs, 7.0),
            (ParamId::MotRMohm, 33.0),
            (ParamId::MotLUh, 12.0),
            (ParamId::MotFluxMwb, 0.3215),
            (ParamId::MotJGcm2, 63.0),
            (ParamId::CtlRpmMax, 20_000.0),
            (ParamId::PwmFreqHz, 48_000.0),
            (ParamId::PwmDeadtimeNs, 200.0),
            (ParamId::LimPhaseA, 40.0),
            (ParamId::LimBusVMax, 20.0),
        ]);
        let settings = settings(&params);
        for (id, wanted) in [
            (ParamId::StaRampA, 8.0),
            (ParamId::StaParkAs, 3.2),
            (ParamId::StaRunRpm, 2720.0),
            (ParamId::CtlRpmMin, 2720.0),
            (ParamId::CtlBwCurHz, 1000.0),
            (ParamId::PwmFreqHz, 48_000.0),
            // 0.2·3.376 mNm/A·8 A/6.3 µkgm² are 857.4 rad/s².
            (ParamId::StaRampRpmS, 8190.0),
            // 40 A·3.376 mNm/A over 1.6·6.3 µkgm²·104.7 rad/s are 127.9 1/s.
            (ParamId::CtlBwSpdHz, 20.4),
        ] {
            assert_eq!(get(&settings, id).0, wanted, "{settings:?}");
        }
    }

    #[test]
    fn a_fast_motor_gets_twenty_periods_a_turn_as_far_as_there_are() {
        for (max_rpm, wanted_hz) in [
            (10_000.0, 24_000.0),
            (18_000.0, 42_000.0),
            (60_000.0, 60_000.0),
        ] {
            let params = params(&[(ParamId::MotPolePairs, 7.0), (ParamId::CtlRpmMax, max_rpm)]);
            assert_eq!(get(&settings(&params), ParamId::PwmFreqHz).0, wanted_hz);
        }
    }

    #[test]
    fn a_setting_beyond_its_range_is_at_the_end_of_it() {
        let params = params(&[(ParamId::MotJGcm2, 0.1), (ParamId::LimPhaseA, 200.0)]);
        let entry = ParamId::CtlSlewRpmS.entry();
        assert_eq!(get(&settings(&params), ParamId::CtlSlewRpmS).0, entry.max);
    }
}
