//! The columns of a recording.

#[cfg(feature = "parquet")]
use serde::Deserializer;
use serde::{Deserialize, Serialize};
use siskin_control::drive::{Bridge, Phase, Snapshot};

use crate::rig::{Period, Rig};
use crate::shaft::Units;
use crate::surroundings::Motion;

/// One control period. The fields are the columns, in this order, with the unit as the last part of the name. Single
/// precision exceeds any sensor's, and halves the file. Columns from the control are empty if it is not visible.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Start of the period, s, to the nanosecond.
    pub t_s: f64,
    /// What the drive is doing, in lower case.
    #[serde(with = "spelt")]
    pub phase: Option<Phase>,
    /// Faults that hold the bridge off, one bit each.
    pub faults: Option<u8>,
    /// True mechanical speed, positive with the phases in the order a, b, c.
    pub rpm: f32,
    /// Estimated mechanical speed, likewise.
    pub rpm_est: Option<f32>,
    /// Reference of the mechanical speed, likewise.
    pub rpm_ref: Option<f32>,
    /// True electrical angle, 0 to 360.
    pub angle_deg: f32,
    /// Estimated electrical angle, 0 to 360.
    pub angle_est_deg: Option<f32>,
    /// Estimated less true electrical angle, ±180.
    pub angle_error_deg: Option<f32>,
    /// True current into phase a.
    pub i_a_a: f32,
    /// True current into phase b.
    pub i_b_a: f32,
    /// True current into phase c.
    pub i_c_a: f32,
    /// Measured current along the estimated rotor axis.
    pub i_d_a: Option<f32>,
    /// Measured current a quarter turn ahead of it.
    pub i_q_a: Option<f32>,
    /// Commanded voltage along the estimated rotor axis.
    pub u_d_v: Option<f32>,
    /// Commanded voltage a quarter turn ahead of it.
    pub u_q_v: Option<f32>,
    /// Share of the period for which phase a is high; empty while all switches are off, and while the low sides only
    /// charge the drivers.
    pub duty_a: Option<f32>,
    /// Likewise for phase b.
    pub duty_b: Option<f32>,
    /// Likewise for phase c.
    pub duty_c: Option<f32>,
    /// True supply voltage.
    pub bus_v: f32,
    /// True current from the supply.
    pub bus_a: f32,
    /// Electromagnetic torque, mean over the period.
    pub torque_nm: f32,
}

/// [`Phase`] as spelt in a recording.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Phase", rename_all = "lowercase")]
enum PhaseName {
    Idle,
    Sense,
    Charge,
    Park,
    Ramp,
    Run,
    Stopping,
    Brake,
    Tone,
}

/// The phase, or nothing.
mod spelt {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Phase, PhaseName};

    #[derive(Serialize, Deserialize)]
    struct Name(#[serde(with = "PhaseName")] Phase);

    pub(super) fn serialize<S: Serializer>(
        phase: &Option<Phase>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        phase.map(Name).serialize(to)
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Option<Phase>, D::Error> {
        Ok(Option::<Name>::deserialize(from)?.map(|name| name.0))
    }
}

impl Row {
    /// The names of the columns.
    pub const COLUMNS: [&str; 22] = [
        "t_s",
        "phase",
        "faults",
        "rpm",
        "rpm_est",
        "rpm_ref",
        "angle_deg",
        "angle_est_deg",
        "angle_error_deg",
        "i_a_a",
        "i_b_a",
        "i_c_a",
        "i_d_a",
        "i_q_a",
        "u_d_v",
        "u_q_v",
        "duty_a",
        "duty_b",
        "duty_c",
        "bus_v",
        "bus_a",
        "torque_nm",
    ];

    /// Returns the phase as spelt in a recording.
    #[cfg(feature = "parquet")]
    pub(super) fn phase_name(&self) -> Option<String> {
        let phase = self.phase?;
        Some(format!("{phase:?}").to_lowercase())
    }

    /// Returns the phase with this spelling.
    #[cfg(feature = "parquet")]
    pub(super) fn phase_named<'a, D: Deserializer<'a>>(name: D) -> Result<Phase, D::Error> {
        PhaseName::deserialize(name)
    }

    /// Bytes of a packed row.
    pub const PACKED_BYTES: usize = 8 + 1 + 1 + 4 * (Self::COLUMNS.len() - 3);

    /// Appends the row's bytes: its columns in order, little-endian without gaps, time as f64, phase and faults as one
    /// byte each, and the others as f32. The phase is the number of [`Phase`]; 255 means none, as does NaN.
    pub fn pack(&self, out: &mut Vec<u8>) {
        out.extend(self.t_s.to_le_bytes());
        out.extend([
            self.phase.map_or(u8::MAX, |phase| phase as u8),
            self.faults.unwrap_or(u8::MAX),
        ]);
        let values = [
            Some(self.rpm),
            self.rpm_est,
            self.rpm_ref,
            Some(self.angle_deg),
            self.angle_est_deg,
            self.angle_error_deg,
            Some(self.i_a_a),
            Some(self.i_b_a),
            Some(self.i_c_a),
            self.i_d_a,
            self.i_q_a,
            self.u_d_v,
            self.u_q_v,
            self.duty_a,
            self.duty_b,
            self.duty_c,
            Some(self.bus_v),
            Some(self.bus_a),
            Some(self.torque_nm),
        ];
        for value in values {
            out.extend(value.unwrap_or(f32::NAN).to_le_bytes());
        }
    }

    /// Returns the row of the period that began at `t_s`, and the control's response in the rig.
    pub fn of(t_s: f64, period: &Period, rig: &Rig) -> Self {
        let (snapshot, units) = (&rig.snapshot(), Units::of(rig.config()));
        Self::seen(t_s, (period.bridge, &period.motion), (snapshot, units))
    }

    /// Returns the same from what was kept of it.
    pub fn seen(
        t_s: f64,
        (bridge, motion): (Bridge, &Motion),
        (snapshot, units): (&Snapshot, Units<'_>),
    ) -> Self {
        let scale = units.scale;
        let turns = snapshot.angle.to_num::<f64>();
        let duties = match bridge {
            Bridge::Off | Bridge::Charge(_) => [None; 3],
            Bridge::Legs(legs) => legs.map(|leg| leg.map(|duty| duty.to_num::<f32>())),
            Bridge::Brake => [Some(0.0); 3],
            Bridge::Duty(duties) => duties.map(|duty| Some(duty.to_num::<f32>())),
        };
        Self {
            phase: Some(snapshot.phase),
            faults: Some(snapshot.faults.bits()),
            rpm_est: Some(units.rpm(snapshot.speed) as f32),
            rpm_ref: Some(units.rpm(snapshot.speed_reference) as f32),
            angle_est_deg: Some(((turns - turns.floor()) * 360.0) as f32),
            angle_error_deg: Some(motion.angle_error_deg(snapshot) as f32),
            i_d_a: Some(scale.amperes(snapshot.i.d)),
            i_q_a: Some(scale.amperes(snapshot.i.q)),
            u_d_v: Some(scale.volts(snapshot.u.d)),
            u_q_v: Some(scale.volts(snapshot.u.q)),
            duty_a: duties[0],
            duty_b: duties[1],
            duty_c: duties[2],
            ..Self::outside(t_s, motion)
        }
    }

    /// Returns the row of the period that began at `t_s`, of a machine whose control is not visible.
    pub fn outside(t_s: f64, motion: &Motion) -> Self {
        let [i_a_a, i_b_a, i_c_a] = motion.currents_a.map(|current_a| current_a as f32);
        Self {
            t_s: (t_s * 1e9).round() / 1e9,
            phase: None,
            faults: None,
            rpm: motion.rpm() as f32,
            rpm_est: None,
            rpm_ref: None,
            angle_deg: (motion.angle_turns * 360.0) as f32,
            angle_est_deg: None,
            angle_error_deg: None,
            i_a_a,
            i_b_a,
            i_c_a,
            i_d_a: None,
            i_q_a: None,
            u_d_v: None,
            u_q_v: None,
            duty_a: None,
            duty_b: None,
            duty_c: None,
            bus_v: motion.bus_v as f32,
            bus_a: motion.bus_a as f32,
            torque_nm: motion.flow.torque_nm as f32,
        }
    }
}
