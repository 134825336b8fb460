//! Angle error of the flux crossings (second paper, Table 1): how far each error source can put it
//! off, by speed.
//!
//! Each function returns the magnitude of its error in electrical degrees. ω is the electrical
//! speed in rad/s, not negative; α the electrical acceleration in rad/s², negative while braking; N
//! the electrical turns over which the speed is measured.
//!
//! The running observer stays below these: it compensates its known lead and the time from a
//! crossing to its sample, and measures the speed at every edge instead of once in N turns.

use core::f64::consts::{FRAC_PI_3, PI};

/// A, the extrapolated angle: the distance between two of a turn's six crossings.
const EXTRAPOLATION_DEG: f64 = 60.0;

/// Largest angle up to which [`position_filter`] is accurate (2.4.2).
pub const POSITION_FILTER_VALID_DEG: f64 = 20.0;

/// Returns the lead of the pseudo-integrator λ̂ = τ_int/(τ_int·s + 1)·(v − i·R) over an integrator:
/// 90° − arctan(τ_int·ω) (2.2.2). An infinite time constant has none.
pub fn low_pass(tau_int_s: f64, omega_rad_s: f64) -> f64 {
    if tau_int_s.is_infinite() {
        return 0.0;
    }
    degrees(libm::atan2(1.0, tau_int_s * omega_rad_s))
}

/// Returns the lead of the second-order form, with an additional high-pass of τ_HPFS (2.2.2, figure
/// 21).
pub fn second_order(tau_int_s: f64, tau_hpfs_s: f64, omega_rad_s: f64) -> f64 {
    low_pass(tau_int_s, omega_rad_s) + low_pass(tau_hpfs_s, omega_rad_s)
}

/// Returns the smallest τ_int, s, for which [`low_pass`] is at most `lead_deg` from this speed up
/// (2.2.2, figure 19): 5.671/ω for 10°.
pub fn tau_int_s(lead_deg: f64, omega_rad_s: f64) -> f64 {
    1.0 / (libm::tan(lead_deg * (PI / 180.0)) * omega_rad_s)
}

/// Returns the lag of a crossing delayed by a hold-off of T_h: T_h·ω (2.3.2).
pub fn hold_off(hold_off_s: f64, omega_rad_s: f64) -> f64 {
    degrees(hold_off_s * omega_rad_s)
}

/// Returns K of appendix A, the dimensionless acceleration: (18N − 1)·α·A/ω̂².
pub fn acceleration(turns: f64, alpha_rad_s2: f64, omega_rad_s: f64) -> f64 {
    (18.0 * turns - 1.0) * per_sixth(alpha_rad_s2, omega_rad_s)
}

/// Returns K where every edge ends a measurement over the last N turns, as in the running observer:
/// the middles of measurement and extrapolation are 3N + 1/2 sixths apart instead of up to 9N −
/// 1/2, so K is (6N + 1)·α·A/ω̂².
pub fn acceleration_every_edge(turns: f64, alpha_rad_s2: f64, omega_rad_s: f64) -> f64 {
    (6.0 * turns + 1.0) * per_sixth(alpha_rad_s2, omega_rad_s)
}

/// Returns θ_ex, the error that K causes by the next speed measurement: |1 − 1/√(1 + K)|·A (2.4.1,
/// appendix A). It lags while accelerating and leads, by more, while braking. Infinite for K ≤ −1,
/// where the rotor would stop before that measurement.
pub fn extrapolation(k: f64) -> f64 {
    if k <= -1.0 {
        return f64::INFINITY;
    }
    libm::fabs(1.0 - 1.0 / libm::sqrt(1.0 + k)) * EXTRAPOLATION_DEG
}

/// Returns θ_ef, the approximate contribution of the position filter A_e: (α·A/ω̂²)·(A_e/(1 −
/// A_e))·6N·A (2.4.2). Valid while α·A/ω̂² is well below (1 − A_e)/A_e, which is up to
/// [`POSITION_FILTER_VALID_DEG`].
pub fn position_filter(a_e: f64, turns: f64, alpha_rad_s2: f64, omega_rad_s: f64) -> f64 {
    if a_e == 0.0 {
        return 0.0;
    }
    let sixths = a_e / (1.0 - a_e) * 6.0 * turns;
    libm::fabs(per_sixth(alpha_rad_s2, omega_rad_s)) * sixths * EXTRAPOLATION_DEG
}

/// Returns θ_es, the lag of a crossing seen one sampling period T_s late: T_s·ω (2.4.1).
pub fn digital_delay(period_s: f64, omega_rad_s: f64) -> f64 {
    degrees(period_s * omega_rad_s)
}

/// Returns α·A/ω²; zero without acceleration, even at standstill.
fn per_sixth(alpha_rad_s2: f64, omega_rad_s: f64) -> f64 {
    if alpha_rad_s2 == 0.0 {
        return 0.0;
    }
    alpha_rad_s2 * FRAC_PI_3 / (omega_rad_s * omega_rad_s)
}

fn degrees(angle_rad: f64) -> f64 {
    angle_rad * (180.0 / PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The motor of figures 27 to 30: 14 poles at 10,000 rpm/s, sampled at 15.625 kHz, N = 1.
    const RAD_S_PER_RPM: f64 = 7.0 * PI / 30.0;
    const ALPHA: f64 = 10_000.0 * RAD_S_PER_RPM;
    const PERIOD_S: f64 = 1.0 / 15_625.0;

    fn theta_ex(rpm: f64) -> f64 {
        extrapolation(acceleration(1.0, ALPHA, rpm * RAD_S_PER_RPM))
    }

    fn theta_es(rpm: f64) -> f64 {
        digital_delay(PERIOD_S, rpm * RAD_S_PER_RPM)
    }

    fn theta_ef(rpm: f64) -> f64 {
        position_filter(0.9, 1.0, ALPHA, rpm * RAD_S_PER_RPM)
    }

    #[test]
    fn ten_degrees_of_lead_take_a_corner_that_is_5_671_times_slower() {
        assert!((tau_int_s(10.0, 1.0) - 5.671).abs() < 0.001);
        for omega in [3.0, 70.0, 2000.0] {
            let tau_s = tau_int_s(10.0, omega);
            assert!((low_pass(tau_s, omega) - 10.0).abs() < 1e-9);
            assert!(low_pass(tau_s, 1.01 * omega) < 10.0);
        }
        assert_eq!(low_pass(0.1, 0.0), 90.0);
        for omega in [0.0, 1.0] {
            assert_eq!(low_pass(f64::INFINITY, omega), 0.0);
        }
    }

    #[test]
    fn a_much_slower_high_pass_adds_little_where_the_low_pass_leads_by_ten_degrees() {
        let tau_s = tau_int_s(10.0, 100.0);
        let added = second_order(tau_s, 10.0 * tau_s, 100.0) - 10.0;
        assert!(added > 0.0 && added < 1.1, "{added}");
    }

    #[test]
    fn acceleration_takes_ten_degrees_at_a_k_of_0_44() {
        assert!((extrapolation(0.44) - 10.0).abs() < 1e-9);
        // Below 10° above 750 rpm (figure 27).
        assert!(theta_ex(750.0) < 10.0 && theta_ex(735.0) > 10.0);
        // Without a speed estimate it is all of A.
        assert_eq!(theta_ex(0.0), 60.0);
    }

    #[test]
    fn braking_takes_more_than_accelerating_and_everything_where_the_rotor_stands() {
        for k in [0.01, 0.2, 0.9] {
            assert!(extrapolation(-k) > extrapolation(k));
        }
        assert_eq!(extrapolation(-1.0), f64::INFINITY);
        assert_eq!(extrapolation(acceleration(1.0, -ALPHA, 0.0)), f64::INFINITY);
        assert_eq!(extrapolation(acceleration(1.0, 0.0, 0.0)), 0.0);
    }

    #[test]
    fn from_edge_to_edge_both_ways_of_measuring_are_the_same() {
        let (once, every) = (
            acceleration(1.0 / 6.0, ALPHA, 100.0),
            acceleration_every_edge(1.0 / 6.0, ALPHA, 100.0),
        );
        assert!((once / every - 1.0).abs() < 1e-12);
        let (once, every) = (
            acceleration(2.0, ALPHA, 100.0),
            acceleration_every_edge(2.0, ALPHA, 100.0),
        );
        assert!((once / every - 35.0 / 13.0).abs() < 1e-12);
    }

    #[test]
    fn acceleration_and_sampling_leave_the_ranges_of_figure_28() {
        for (rpm, bound) in [
            (1000.0, 10.0),
            (3400.0, 10.0),
            (500.0, 20.0),
            (7300.0, 20.0),
        ] {
            assert!(theta_ex(rpm) + theta_es(rpm) < bound, "{rpm}");
        }
        // "About": slightly beyond, they are exceeded.
        for (rpm, bound) in [(850.0, 10.0), (3740.0, 10.0), (450.0, 20.0), (8030.0, 20.0)] {
            assert!(theta_ex(rpm) + theta_es(rpm) > bound, "{rpm}");
        }
    }

    #[test]
    fn with_the_filter_twenty_degrees_are_left_below_2000_rpm() {
        let all = |rpm: f64| theta_ex(rpm) + theta_es(rpm) + theta_ef(rpm);
        assert!(all(2000.0) < 20.0, "{}", all(2000.0));
        assert!(all(1850.0) > 20.0, "{}", all(1850.0));
        // The approximation breaks down below, where it leaves its range.
        assert!(theta_ef(2000.0) < POSITION_FILTER_VALID_DEG);
        assert!(theta_ef(1500.0) > POSITION_FILTER_VALID_DEG);
        assert_eq!(position_filter(0.0, 1.0, ALPHA, 0.0), 0.0);
    }

    #[test]
    fn twenty_degrees_of_sampling_are_eighteen_periods_a_turn() {
        let turn_s = 18.0 * PERIOD_S;
        assert!((digital_delay(PERIOD_S, 2.0 * PI / turn_s) - 20.0).abs() < 1e-9);
        assert_eq!(
            hold_off(2.0 * PERIOD_S, 50.0),
            2.0 * digital_delay(PERIOD_S, 50.0)
        );
    }
}
