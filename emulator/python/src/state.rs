//! The state of an ESC as Python sees it.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use siskin_control::drive::Fault;
use siskin_emulator::rack;

/// Names of the drive's phases, by number.
pub(crate) const PHASES: [&str; 9] = [
    "idle", "sense", "charge", "park", "ramp", "run", "stopping", "brake", "tone",
];

/// The state of an ESC and its motor at the beginning of its next control period.
///
/// Means are over the latest :meth:`siskin.Emulator.advance`.
#[pyclass(frozen, eq, module = "siskin")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EscState {
    pub(crate) state: rack::EscState,
    pub(crate) replies: Vec<Reply>,
}

/// The state of motor and supply as the ESC itself reports it.
#[pyclass(frozen, eq, module = "siskin")]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reported(rack::Reported);

/// An ESC's answer on its throttle wire or serial line: a reply to a bidirectional frame, or telemetry.
#[pyclass(frozen, eq, module = "siskin")]
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reply {
    /// When the answered frame began, ns of simulated time.
    #[pyo3(get)]
    pub(crate) asked_ns: u64,
    pub(crate) datagram: Vec<u8>,
}

#[pymethods]
impl EscState {
    /// Shaft speed, rpm; positive with the phases in the order a, b, c.
    #[getter]
    fn rpm(&self) -> f64 {
        self.state.rpm
    }

    /// Electrical angle of the rotor, turns, 0 to 1.
    #[getter]
    fn angle_turns(&self) -> f64 {
        self.state.angle_turns
    }

    /// Electromagnetic torque, Nm, mean.
    #[getter]
    fn torque_nm(&self) -> f64 {
        self.state.torque_nm
    }

    /// Currents into the phases a, b and c, A.
    #[getter]
    fn currents_a(&self) -> (f64, f64, f64) {
        self.state.currents_a.into()
    }

    /// Supply current, A, mean; negative is returned to the supply.
    #[getter]
    fn bus_a(&self) -> f64 {
        self.state.bus_a
    }

    /// Supply voltage, V.
    #[getter]
    fn bus_v(&self) -> f64 {
        self.state.bus_v
    }

    /// Board temperature, °C.
    #[getter]
    fn board_c(&self) -> f64 {
        self.state.board_c
    }

    /// These quantities as the ESC itself reports them.
    #[getter]
    fn reported(&self) -> Reported {
        Reported(self.state.reported)
    }

    /// Faults that hold the bridge off, as the ESC names them.
    #[getter]
    fn faults(&self) -> Vec<&'static str> {
        self.state.faults.iter().map(Fault::text).collect()
    }

    /// Whether throttle may turn the motor.
    #[getter]
    fn armed(&self) -> bool {
        self.state.armed
    }

    /// Phase of the drive: idle, sense, charge, park, ramp, run, stopping, brake or tone.
    #[getter]
    fn phase(&self) -> &'static str {
        PHASES[self.state.phase as usize]
    }

    /// The ESC's answers during the latest advance, in order.
    #[getter]
    fn replies(&self) -> Vec<Reply> {
        self.replies.clone()
    }

    fn __repr__(&self) -> String {
        format!(
            "EscState(rpm={:.1}, bus_v={:.2}, bus_a={:.2}, phase='{}', armed={}, faults={:?})",
            self.state.rpm,
            self.state.bus_v,
            self.state.bus_a,
            self.phase(),
            if self.state.armed { "True" } else { "False" },
            self.faults(),
        )
    }
}

#[pymethods]
impl Reported {
    /// Mechanical speed, rpm; forward is positive, whichever way ``MOT_DIR`` turns the motor.
    #[getter]
    fn rpm(&self) -> f32 {
        self.0.rpm
    }

    /// Supply voltage, V.
    #[getter]
    fn bus_v(&self) -> f32 {
        self.0.bus_v
    }

    /// Supply current, A.
    #[getter]
    fn bus_a(&self) -> f32 {
        self.0.bus_a
    }

    /// Board temperature, °C.
    #[getter]
    fn temperature_c(&self) -> f32 {
        self.0.temperature_c
    }

    fn __repr__(&self) -> String {
        let rack::Reported {
            rpm,
            bus_v,
            bus_a,
            temperature_c,
        } = self.0;
        format!(
            "Reported(rpm={rpm:.1}, bus_v={bus_v:.2}, bus_a={bus_a:.2}, temperature_c={temperature_c:.1})"
        )
    }
}

#[pymethods]
impl Reply {
    /// A datagram of the throttle wire, as the emulator's guide describes it: byte 20 to 23, 30 or 31 first.
    #[getter]
    fn datagram<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.datagram)
    }

    fn __repr__(&self) -> String {
        let bytes = self.datagram.iter().map(|byte| format!("{byte:02x}"));
        let bytes: String = bytes.collect();
        format!(
            "Reply(asked_ns={}, datagram=bytes.fromhex('{bytes}'))",
            self.asked_ns
        )
    }
}
