//! What a run comes to: figures over measuring windows, and a hash of the control state.

use serde::Serialize;
use siskin_control::drive::{Fault, Faults, Phase, Setpoint};
use xxhash_rust::xxh3::Xxh3;

use crate::rig::{Period, Rig};

/// Watches a run.
pub struct Summary {
    hash: Xxh3,
    steps: u64,
    faults: Faults,
    windows: Vec<Window>,
}

/// The figures of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Simulated time, s.
    pub sim_s: f64,
    /// Wall time, s.
    pub wall_s: f64,
    /// Simulated seconds per wall second.
    pub sim_per_wall: Option<f64>,
    /// Control periods.
    pub steps: u64,
    /// Hash over the control state of every step: 16 hexadecimal digits, equal for equal seed and
    /// inputs on any machine.
    pub trace_hash: String,
    /// Faults that have turned the bridge off.
    pub faults: Vec<&'static str>,
    /// What came in from outside and was refused; not for a scenario, where nothing does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rejected: Option<Rejected>,
    /// The measuring windows.
    pub windows: Vec<Figures>,
}

/// What came in and was refused.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Rejected {
    /// Datagrams on the throttle wire that were malformed or found no room.
    pub wire_datagrams: u64,
    /// Runs of edges that were no frame, or failed its check.
    pub wire_frames: u32,
    /// MAVLink frames that failed their check, are unknown, or cannot be trusted.
    pub mavlink_frames: u64,
}

/// The figures of one measuring window; none is `None` but for lack of data.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Name.
    pub name: String,
    /// Start, s.
    pub t0_s: f64,
    /// End, s; that of the run where it ended before.
    pub t1_s: f64,
    /// Mean mechanical speed, rpm.
    pub rpm_mean: Option<f64>,
    /// Mean reference of the speed, rpm, while there is one.
    pub rpm_ref_mean: Option<f64>,
    /// Root mean square of speed less reference, rpm.
    pub speed_error_rms_rpm: Option<f64>,
    /// Root mean square of estimated less true speed, rpm, while the observer leads.
    pub speed_estimate_error_rms_rpm: Option<f64>,
    /// Mean of estimated less true electrical angle, degrees, while the observer leads.
    pub angle_error_mean_deg: Option<f64>,
    /// Root mean square of it.
    pub angle_error_rms_deg: Option<f64>,
    /// Greatest magnitude of it.
    pub angle_error_max_deg: Option<f64>,
    /// Mean electromagnetic torque, Nm.
    pub torque_mean_nm: Option<f64>,
    /// Torque ripple: 100·√(T_rms² − T_avg²)/T_avg.
    pub torque_ripple_pct: Option<f64>,
    /// Mean electrical power into the phases, W.
    pub p_motor_w: Option<f64>,
    /// Mean power lost in the windings, W.
    pub p_copper_w: Option<f64>,
    /// 1 − p_copper/p_motor, for a motor that takes power.
    pub efficiency: Option<f64>,
    /// Mean measured i_q, A.
    pub i_q_mean_a: Option<f64>,
    /// Mean measured i_d, A.
    pub i_d_mean_a: Option<f64>,
    /// Mean supply voltage, V.
    pub bus_v_mean: Option<f64>,
    /// Mean current from the supply, A.
    pub bus_a_mean: Option<f64>,
    /// Whether the angle error was 90° or more.
    pub lock_lost: bool,
}

/// Sums over a measuring window.
#[derive(Clone, Debug)]
struct Window {
    name: String,
    t0_s: f64,
    t1_s: f64,
    all: Mean<8>,
    reference: Mean<2>,
    leading: Mean<3>,
    angle_error_max_deg: f64,
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
        (self.count > 0).then(|| self.sums[index] / self.count as f64)
    }
}

impl Window {
    fn add(&mut self, period: &Period, rig: &Rig) {
        let snapshot = rig.snapshot();
        let scale = &rig.config().scale;
        let rpm = period.rpm();
        let flow = &period.flow;
        self.all.add([
            rpm,
            flow.torque_nm,
            flow.torque_square,
            flow.motor_w,
            flow.copper_w,
            f64::from(scale.amperes(snapshot.i.q)),
            f64::from(scale.amperes(snapshot.i.d)),
            period.bus_v,
        ]);
        if snapshot.phase != Phase::Run && snapshot.phase != Phase::Stopping {
            return;
        }
        let angle_error_deg = period.angle_error_deg(&snapshot);
        let estimate_error = f64::from(scale.rpm(snapshot.speed)) - rpm;
        self.leading.add([
            estimate_error * estimate_error,
            angle_error_deg,
            angle_error_deg * angle_error_deg,
        ]);
        self.angle_error_max_deg = self.angle_error_max_deg.max(angle_error_deg.abs());
        if !matches!(period.setpoint, Setpoint::Speed(_)) {
            return;
        }
        let reference = f64::from(scale.rpm(snapshot.speed_reference));
        let error = rpm - reference;
        self.reference.add([reference, error * error]);
    }

    fn figures(&self, end_s: f64) -> Figures {
        let torque_mean_nm = self.all.get(1);
        let p_motor_w = self.all.get(3);
        let p_copper_w = self.all.get(4);
        let bus_v_mean = self.all.get(7);
        let ripple = |mean: f64, square: f64| {
            (mean != 0.0).then(|| 100.0 * (square - mean * mean).max(0.0).sqrt() / mean)
        };
        Figures {
            name: self.name.clone(),
            t0_s: self.t0_s,
            t1_s: self.t1_s.min(end_s),
            rpm_mean: self.all.get(0),
            rpm_ref_mean: self.reference.get(0),
            speed_error_rms_rpm: self.reference.get(1).map(f64::sqrt),
            speed_estimate_error_rms_rpm: self.leading.get(0).map(f64::sqrt),
            angle_error_mean_deg: self.leading.get(1),
            angle_error_rms_deg: self.leading.get(2).map(f64::sqrt),
            angle_error_max_deg: (self.leading.count > 0).then_some(self.angle_error_max_deg),
            torque_mean_nm,
            torque_ripple_pct: torque_mean_nm
                .zip(self.all.get(2))
                .and_then(|(mean, square)| ripple(mean, square)),
            p_motor_w,
            p_copper_w,
            efficiency: p_motor_w
                .zip(p_copper_w)
                .and_then(|(motor, copper)| (motor > 0.0).then(|| 1.0 - copper / motor)),
            i_q_mean_a: self.all.get(5),
            i_d_mean_a: self.all.get(6),
            bus_v_mean,
            bus_a_mean: p_motor_w
                .zip(bus_v_mean)
                .and_then(|(power, volts)| (volts > 0.0).then(|| power / volts)),
            lock_lost: self.angle_error_max_deg >= 90.0,
        }
    }
}

impl Summary {
    /// Watches with these measuring windows: name, start and end, s.
    pub fn new(windows: impl IntoIterator<Item = (String, f64, f64)>) -> Self {
        let window = |(name, t0_s, t1_s)| Window {
            name,
            t0_s,
            t1_s,
            all: Mean::new(),
            reference: Mean::new(),
            leading: Mean::new(),
            angle_error_max_deg: 0.0,
        };
        Self {
            hash: Xxh3::new(),
            steps: 0,
            faults: Faults::NONE,
            windows: windows.into_iter().map(window).collect(),
        }
    }

    /// Takes in a period that began at `t_s`.
    pub fn add(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.steps += 1;
        let words = rig.trace();
        let mut bytes = [0; 4 * siskin_control::drive::TRACE_WORDS];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        self.hash.update(&bytes);
        for fault in rig.snapshot().faults.iter() {
            self.faults.insert(fault);
        }
        for window in &mut self.windows {
            if t_s >= window.t0_s && t_s < window.t1_s {
                window.add(period, rig);
            }
        }
    }

    /// The figures, after `sim_s` simulated and `wall_s` real seconds.
    pub fn report(&self, sim_s: f64, wall_s: f64) -> Report {
        Report {
            sim_s,
            wall_s,
            sim_per_wall: (wall_s > 0.0).then(|| sim_s / wall_s),
            steps: self.steps,
            trace_hash: format!("{:016x}", self.hash.digest()),
            faults: self.faults.iter().map(Fault::text).collect(),
            rejected: None,
            windows: self.windows.iter().map(|w| w.figures(sim_s)).collect(),
        }
    }
}
