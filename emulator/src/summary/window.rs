//! The figures of one measuring window.

use serde::Serialize;
use siskin_control::drive::{Phase, Setpoint, Snapshot};

use super::since::Since;
use super::turning::Turning;
use crate::rig::Period;
use crate::shaft::Units;
use crate::surroundings::Motion;

/// Angle error within which the observer is locked: it costs 3.4 % of the torque.
const LOCKED_DEG: f64 = 15.0;

/// The figures of one measuring window; one is `None` only for lack of data, such as of a control that is not visible.
///
/// Speed and torque are the shaft's, positive with the phases in the order a, b, c: with `MOT_DIR` 1 a motor that runs
/// forward has a negative speed here, and so have the reference and the estimate that it is compared with.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Name.
    pub name: String,
    /// Start, s.
    pub t0_s: f64,
    /// End, s; that of the run if it ended earlier.
    pub t1_s: f64,
    /// Mean mechanical speed, rpm.
    pub rpm_mean: Option<f64>,
    /// Least mechanical speed, rpm.
    pub rpm_min: Option<f64>,
    /// Greatest mechanical speed, rpm.
    pub rpm_max: Option<f64>,
    /// Mean speed reference, rpm, while there is one.
    pub rpm_ref_mean: Option<f64>,
    /// Root mean square of speed less reference, rpm.
    pub speed_error_rms_rpm: Option<f64>,
    /// Its greatest magnitude.
    pub speed_error_max_rpm: Option<f64>,
    /// Root mean square of estimated less true speed, rpm, while the observer leads.
    pub speed_estimate_error_rms_rpm: Option<f64>,
    /// Mean of estimated less true electrical angle, degrees, while the observer leads.
    pub angle_error_mean_deg: Option<f64>,
    /// Its root mean square.
    pub angle_error_rms_deg: Option<f64>,
    /// Its standard deviation.
    pub angle_error_std_deg: Option<f64>,
    /// Its greatest magnitude.
    pub angle_error_max_deg: Option<f64>,
    /// Time from when the observer took the lead until that error stayed within 15°, s; `None` if it was not within at
    /// the end.
    pub lock_s: Option<f64>,
    /// Mean electromagnetic torque, Nm.
    pub torque_mean_nm: Option<f64>,
    /// Torque ripple: 100·√(T_rms² − T_avg²)/|T_avg|, if the drive has turned the motor.
    pub torque_ripple_pct: Option<f64>,
    /// Mean electrical power into the phases, W.
    pub p_motor_w: Option<f64>,
    /// Mean power lost in the windings, W.
    pub p_copper_w: Option<f64>,
    /// 1 − p_copper/p_motor, for a motor that takes power to turn: a tone does no work.
    pub efficiency: Option<f64>,
    /// Mean measured i_q, A.
    pub i_q_mean_a: Option<f64>,
    /// Mean measured i_d, A.
    pub i_d_mean_a: Option<f64>,
    /// Greatest magnitude of a true phase current at a sample, A.
    pub current_max_a: Option<f64>,
    /// Greatest magnitude by which the resistance that is followed exceeds the true one, %.
    pub r_error_max_pct: Option<f64>,
    /// The same of the flux.
    pub flux_error_max_pct: Option<f64>,
    /// Mean supply voltage, V.
    pub bus_v_mean: Option<f64>,
    /// Mean current from the supply, A.
    pub bus_a_mean: Option<f64>,
    /// The most by which the shaft fell behind the furthest point reached in the commanded direction, mechanical
    /// degrees.
    pub turned_back_deg: Option<f64>,
    /// Time from the start after which the shaft held 95 % of the commanded speed, s; `None` if it did not at the end.
    pub reached_s: Option<f64>,
    /// Time from the start after which the shaft stayed within 1 % of the last commanded speed, s; `None` if it did not
    /// at the end.
    pub settled_s: Option<f64>,
    /// Number of starts that the drive began (Park, or with six-step Ramp).
    pub starts: Option<u64>,
    /// Whether the angle error reached 90°.
    pub lock_lost: Option<bool>,
}

impl Figures {
    /// The keys of figures that are the control's, or need to know what it did.
    pub const OF_CONTROL: [&str; 20] = [
        "rpm_ref_mean",
        "speed_error_rms_rpm",
        "speed_error_max_rpm",
        "speed_estimate_error_rms_rpm",
        "angle_error_mean_deg",
        "angle_error_rms_deg",
        "angle_error_std_deg",
        "angle_error_max_deg",
        "lock_s",
        "torque_ripple_pct",
        "efficiency",
        "i_q_mean_a",
        "i_d_mean_a",
        "r_error_max_pct",
        "flux_error_max_pct",
        "turned_back_deg",
        "reached_s",
        "settled_s",
        "starts",
        "lock_lost",
    ];
}

/// A period as seen by the windows.
pub(super) struct Look<'a> {
    /// Its start, s.
    pub(super) t_s: f64,
    /// The truth.
    pub(super) motion: &'a Motion,
    /// The control, if visible.
    pub(super) control: Option<Control<'a>>,
}

/// The control in a period.
#[derive(Clone, Copy)]
pub(super) struct Control<'a> {
    /// Its command, and the truth.
    pub(super) period: &'a Period,
    /// The control's response.
    pub(super) snapshot: &'a Snapshot,
    /// The units of the control's numbers.
    pub(super) units: Units<'a>,
    /// Whether the drive began a start.
    pub(super) started: bool,
    /// By how much resistance and flux as they are followed exceed the true ones, %.
    pub(super) drift_pct: [f64; 2],
}

/// Sums over a measuring window.
#[derive(Clone, Debug)]
pub(super) struct Window {
    name: String,
    t0_s: f64,
    t1_s: f64,
    all: Mean<7>,
    /// i_q and i_d.
    control: Mean<2>,
    reference: Mean<2>,
    leading: Mean<3>,
    rpm_min: f64,
    rpm_max: f64,
    current_max_a: f64,
    speed_error_max_rpm: f64,
    angle_error_max_deg: f64,
    /// Of resistance and flux.
    drift_max_pct: [f64; 2],
    /// Since when the observer leads.
    led: Since,
    /// Since when it leads with a small angle error.
    locked: Since,
    turning: Turning,
    starts: u64,
    /// Whether the drive has turned the motor.
    drove: bool,
}

/// Means of several quantities over the same samples.
#[derive(Clone, Debug)]
struct Mean<const N: usize> {
    count: u64,
    sums: [f64; N],
}

impl<const N: usize> Mean<N> {
    const fn new() -> Self {
        Self {
            count: 0,
            sums: [0.0; N],
        }
    }

    fn add(&mut self, values: [f64; N]) {
        self.count += 1;
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum += value;
        }
    }

    fn get(&self, index: usize) -> Option<f64> {
        self.any(self.sums[index] / self.count as f64)
    }

    /// Returns a figure of these samples, if there are any.
    fn any(&self, figure: f64) -> Option<f64> {
        (self.count > 0).then_some(figure)
    }
}

impl Window {
    pub(super) const fn new(name: String, t0_s: f64, t1_s: f64) -> Self {
        Self {
            name,
            t0_s,
            t1_s,
            all: Mean::new(),
            control: Mean::new(),
            reference: Mean::new(),
            leading: Mean::new(),
            rpm_min: f64::INFINITY,
            rpm_max: f64::NEG_INFINITY,
            current_max_a: 0.0,
            speed_error_max_rpm: 0.0,
            angle_error_max_deg: 0.0,
            drift_max_pct: [0.0; 2],
            led: Since(None),
            locked: Since(None),
            turning: Turning::new(),
            starts: 0,
            drove: false,
        }
    }

    /// Returns true if a period that begins at `t_s` is within.
    pub(super) fn covers(&self, t_s: f64) -> bool {
        t_s >= self.t0_s && t_s < self.t1_s
    }

    pub(super) fn add(&mut self, look: &Look) {
        let Look {
            t_s,
            motion,
            control,
        } = *look;
        let rpm = motion.rpm();
        let flow = &motion.flow;
        self.all.add([
            rpm,
            flow.torque_nm,
            flow.torque_square,
            flow.motor_w,
            flow.copper_w,
            motion.bus_v,
            motion.bus_a,
        ]);
        self.rpm_min = self.rpm_min.min(rpm);
        self.rpm_max = self.rpm_max.max(rpm);
        for current_a in motion.currents_a {
            self.current_max_a = self.current_max_a.max(current_a.abs());
        }
        if let Some(control) = control {
            self.add_control(t_s, rpm, control);
        }
    }

    fn add_control(&mut self, t_s: f64, rpm: f64, control: Control) {
        let Control {
            period,
            snapshot,
            units,
            started,
            drift_pct,
        } = control;
        self.control.add([
            f64::from(units.scale.amperes(snapshot.i.q)),
            f64::from(units.scale.amperes(snapshot.i.d)),
        ]);
        for (most, drift) in self.drift_max_pct.iter_mut().zip(drift_pct) {
            *most = most.max(drift.abs());
        }
        self.drove |= snapshot.phase.drives();
        self.turning.add(t_s, rpm, period.setpoint, units);
        self.starts += u64::from(started);
        let leads = matches!(snapshot.phase, Phase::Run | Phase::Stopping);
        let angle_error_deg = period.angle_error_deg(snapshot);
        self.led.add(t_s, leads);
        self.locked
            .add(t_s, leads && angle_error_deg.abs() <= LOCKED_DEG);
        if !leads {
            return;
        }
        let estimate_error = units.rpm(snapshot.speed) - rpm;
        self.leading.add([
            estimate_error * estimate_error,
            angle_error_deg,
            angle_error_deg * angle_error_deg,
        ]);
        self.angle_error_max_deg = self.angle_error_max_deg.max(angle_error_deg.abs());
        if !matches!(period.setpoint, Setpoint::Speed(_)) {
            return;
        }
        let reference = units.rpm(snapshot.speed_reference);
        let error = rpm - reference;
        self.reference.add([reference, error * error]);
        self.speed_error_max_rpm = self.speed_error_max_rpm.max(error.abs());
    }

    pub(super) fn figures(&self, end_s: f64) -> Figures {
        let seen = self.all.count > 0 && self.control.count == self.all.count;
        let torque_mean_nm = self.all.get(1);
        let p_motor_w = self.all.get(3);
        let p_copper_w = self.all.get(4);
        let angle_error_mean_deg = self.leading.get(1);
        let angle_error_square = self.leading.get(2);
        let ripple = |mean: f64, square: f64| {
            (mean != 0.0).then(|| 100.0 * (square - mean * mean).max(0.0).sqrt() / mean.abs())
        };
        Figures {
            name: self.name.clone(),
            t0_s: self.t0_s,
            t1_s: self.t1_s.min(end_s),
            rpm_mean: self.all.get(0),
            rpm_min: self.all.any(self.rpm_min),
            rpm_max: self.all.any(self.rpm_max),
            rpm_ref_mean: self.reference.get(0),
            speed_error_rms_rpm: self.reference.get(1).map(f64::sqrt),
            speed_error_max_rpm: self.reference.any(self.speed_error_max_rpm),
            speed_estimate_error_rms_rpm: self.leading.get(0).map(f64::sqrt),
            angle_error_mean_deg,
            angle_error_rms_deg: angle_error_square.map(f64::sqrt),
            angle_error_std_deg: angle_error_mean_deg
                .zip(angle_error_square)
                .map(|(mean, square)| (square - mean * mean).max(0.0).sqrt()),
            angle_error_max_deg: self.leading.any(self.angle_error_max_deg),
            lock_s: self
                .locked
                .0
                .zip(self.led.0)
                .map(|(locked_s, led_s)| locked_s - led_s),
            torque_mean_nm,
            torque_ripple_pct: torque_mean_nm
                .zip(self.all.get(2))
                .filter(|_| self.drove)
                .and_then(|(mean, square)| ripple(mean, square)),
            p_motor_w,
            p_copper_w,
            efficiency: p_motor_w
                .zip(p_copper_w)
                .filter(|_| self.drove)
                .and_then(|(motor, copper)| (motor > 0.0).then(|| 1.0 - copper / motor)),
            i_q_mean_a: self.control.get(0),
            i_d_mean_a: self.control.get(1),
            current_max_a: self.all.any(self.current_max_a),
            r_error_max_pct: self.control.any(self.drift_max_pct[0]),
            flux_error_max_pct: self.control.any(self.drift_max_pct[1]),
            bus_v_mean: self.all.get(5),
            bus_a_mean: self.all.get(6),
            turned_back_deg: self.control.any(self.turning.turned_back_deg()),
            reached_s: self.turning.reached_at_s().map(|t_s| t_s - self.t0_s),
            settled_s: self.turning.settled_at_s().map(|t_s| t_s - self.t0_s),
            starts: seen.then_some(self.starts),
            lock_lost: seen.then_some(self.angle_error_max_deg >= 90.0),
        }
    }
}
