//! What the paper's section III takes from a run: mean torque, its ripple, power and losses.

use crate::plant::Flow;

/// Means over a run of whole stretches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Means {
    time_s: f64,
    /// Integrals of torque, its square, power into the motor and copper losses.
    sums: [f64; 4],
}

impl Means {
    /// Adds a stretch of this length.
    pub(super) fn add(&mut self, flow: &Flow, time_s: f64) {
        self.time_s += time_s;
        let parts = [
            flow.torque_nm,
            flow.torque_square,
            flow.motor_w,
            flow.copper_w,
        ];
        for (sum, part) in self.sums.iter_mut().zip(parts) {
            *sum += part * time_s;
        }
    }

    /// Adds another run's stretches.
    pub(super) fn join(mut self, other: &Self) -> Self {
        self.time_s += other.time_s;
        for (sum, part) in self.sums.iter_mut().zip(other.sums) {
            *sum += part;
        }
        self
    }

    /// Returns T_avg, Nm.
    pub(super) fn torque_nm(&self) -> f64 {
        self.sums[0] / self.time_s
    }

    /// Returns 100·√(T_rms² − T_avg²)/T_avg; the paper's text has the division under the root.
    pub(super) fn ripple_pct(&self) -> f64 {
        let mean = self.torque_nm();
        let square = self.sums[1] / self.time_s;
        100.0 * (square - mean * mean).max(0.0).sqrt() / mean
    }

    /// Returns the electrical power into the motor, W.
    pub(super) fn motor_w(&self) -> f64 {
        self.sums[2] / self.time_s
    }

    /// Returns the power lost in the windings, W.
    pub(super) fn copper_w(&self) -> f64 {
        self.sums[3] / self.time_s
    }

    /// Returns 1 − p_copper/p_motor, %.
    pub(super) fn efficiency_pct(&self) -> f64 {
        100.0 * (1.0 - self.sums[3] / self.sums[2])
    }
}

/// Steps of [`seek`]: each leaves a hundredth of the error or less.
const STEPS: u32 = 3;

/// Finds the setting that gives a mean torque, by the secant from two settings near it.
pub(super) fn seek(wanted_nm: f64, near: [f64; 2], torque_nm: impl Fn(f64) -> f64) -> f64 {
    let [mut before, mut setting] = near;
    let mut error_before = torque_nm(before) - wanted_nm;
    for _ in 0..STEPS {
        let error = torque_nm(setting) - wanted_nm;
        let slope = (error - error_before) / (setting - before);
        if slope == 0.0 || !slope.is_finite() {
            break;
        }
        (before, error_before) = (setting, error);
        setting -= error / slope;
    }
    setting
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ripple_and_efficiency_are_those_of_the_definitions() {
        let flow = |torque_nm: f64| Flow {
            torque_nm,
            torque_square: torque_nm * torque_nm,
            motor_w: 100.0 * torque_nm,
            copper_w: 5.0,
            ..Flow::default()
        };
        // A square wave of 1 ± 0.5 Nm.
        let mut means = Means::default();
        means.add(&flow(0.5), 1e-3);
        let mut rest = Means::default();
        rest.add(&flow(1.5), 1e-3);
        let means = means.join(&rest);
        assert!((means.torque_nm() - 1.0).abs() < 1e-12);
        assert!((means.ripple_pct() - 50.0).abs() < 1e-9);
        assert!((means.efficiency_pct() - 95.0).abs() < 1e-9);
    }

    #[test]
    fn a_torque_is_sought_until_it_is_there() {
        let found = seek(0.5, [0.6, 0.7], |x: f64| x * x);
        assert!((found - 0.5_f64.sqrt()).abs() < 1e-6, "{found}");
    }
}
