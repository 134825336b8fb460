//! The state of a rack's ESC, for a simulator around it.

use std::f64::consts::TAU;

use siskin_control::drive::{Faults, Phase};

use crate::device::Device;
use crate::surroundings::Motion;

/// An ESC and its motor at the start of its next control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscState {
    /// Speed of the shaft, rpm; positive with the phases in the order a, b, c.
    pub rpm: f64,
    /// Electrical angle of the rotor, turns, 0..1.
    pub angle_turns: f64,
    /// Mean electromagnetic torque over the latest advance, Nm.
    pub torque_nm: f64,
    /// Currents into the phases, A.
    pub currents_a: [f64; 3],
    /// Mean current from the supply over the latest advance, A.
    pub bus_a: f64,
    /// Voltage of the supply, V.
    pub bus_v: f64,
    /// Temperature of the board, °C.
    pub board_c: f64,
    /// The ESC's own values for these.
    pub reported: Reported,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// Whether throttle may turn the motor.
    pub armed: bool,
    /// The drive's phase.
    pub phase: Phase,
}

/// What an ESC reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reported {
    /// Mechanical speed, rpm; forward is positive.
    pub rpm: f32,
    /// Supply voltage, V.
    pub bus_v: f32,
    /// Supply current, A.
    pub bus_a: f32,
    /// Temperature of the board, °C.
    pub temperature_c: f32,
}

/// Means over an advance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Means {
    time_s: f64,
    torque_nms: f64,
    charge_c: f64,
}

impl Means {
    #[inline] // in each period
    pub(super) fn add(&mut self, motion: &Motion, time_s: f64) {
        self.time_s += time_s;
        self.torque_nms += motion.flow.torque_nm * time_s;
        self.charge_c += motion.bus_a * time_s;
    }

    fn over(&self, sum: f64) -> f64 {
        if self.time_s > 0.0 {
            sum / self.time_s
        } else {
            0.0
        }
    }
}

/// Returns the state of an ESC.
pub(super) fn state(esc: &Device, means: &Means) -> EscState {
    let (rig, telemetry) = (esc.rig(), esc.esc().telemetry());
    let (plant, snapshot) = (rig.plant(), rig.snapshot());
    EscState {
        rpm: plant.speed_rad_s() * 60.0 / TAU,
        angle_turns: plant.angle_turns(),
        torque_nm: means.over(means.torque_nms),
        currents_a: plant.currents_a(),
        bus_a: means.over(means.charge_c),
        bus_v: rig.bus_v(),
        board_c: rig.around().sensor_c(),
        reported: Reported {
            rpm: telemetry.rpm,
            bus_v: telemetry.bus_v,
            bus_a: telemetry.bus_a,
            temperature_c: telemetry.temperature_c,
        },
        faults: snapshot.faults,
        armed: telemetry.armed,
        phase: snapshot.phase,
    }
}
