//! ESCs in simulated time, driven by a Python program.

use std::path::PathBuf;

use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use siskin_emulator::laboratory::{self, Setup};
use siskin_emulator::parameter::parameter;
use siskin_emulator::rack::{ESCS_MAX, Environment, Shaft};
use siskin_emulator::scenario::{self, Standing, ThrottleSignal, stand};
use siskin_emulator::watch::Void;
use siskin_params::ParamId;

use crate::Error;
use crate::convert::to_table;
use crate::held::{Held, Unusable};
use crate::state::{EscState, Reply};

/// Simulated time between two checks for Ctrl-C, ns: some milliseconds of wall time.
const LOOK_NS: u64 = 500_000_000;

/// The longest advance, s.
const ADVANCE_MAX_S: f64 = 1e6;

/// Several ESCs on one clock, one supply and one MAVLink stream.
#[pyclass(frozen, module = "siskin._siskin")]
pub(crate) struct Laboratory {
    inner: Held<laboratory::Laboratory>,
    escs: usize,
    /// Warnings at the start.
    #[pyo3(get)]
    warnings: Vec<&'static str>,
}

impl Laboratory {
    /// Runs `work` on the ESCs while Python's other threads run, one of which may hold them.
    ///
    /// Refuses after a panic, and in a process forked while another thread used them.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut laboratory::Laboratory) -> T + Send,
    ) -> PyResult<T> {
        let worked = py.detach(|| self.inner.with(work));
        worked.map_err(|unusable| {
            wrong(match unusable {
                Unusable::Failed => "the emulator has failed; create a new one",
                Unusable::Forked => {
                    "the process was forked while another thread advanced this emulator; create one after the fork"
                }
            })
        })
    }

    fn check(&self, esc: usize) -> PyResult<usize> {
        if esc < self.escs {
            return Ok(esc);
        }
        let what = format!("there is no ESC {esc}; give 0 to {}", self.escs - 1);
        Err(PyIndexError::new_err(what))
    }
}

fn wrong(error: impl ToString) -> PyErr {
    Error::new_err(error.to_string())
}

fn known(name: &str) -> PyResult<ParamId> {
    ParamId::find(name).ok_or_else(|| PyKeyError::new_err(format!("there is no parameter {name}")))
}

/// Converts a program's seconds to nanoseconds.
fn ns(seconds: f64) -> PyResult<u64> {
    if (0.0..=ADVANCE_MAX_S).contains(&seconds) {
        Ok((seconds * 1e9).round() as u64)
    } else {
        let what = format!("{seconds} s are out of range; give 0 to {ADVANCE_MAX_S}");
        Err(Error::new_err(what))
    }
}

#[pymethods]
impl Laboratory {
    #[new]
    #[pyo3(signature = (bench, escs, given, signal, params, storage, records, traces))]
    #[expect(
        clippy::too_many_arguments,
        reason = "the package names and explains them"
    )]
    fn new(
        bench: &str,
        escs: i64,
        given: &Bound<'_, PyDict>,
        signal: String,
        params: Vec<(String, f32)>,
        storage: Option<PathBuf>,
        records: bool,
        traces: bool,
    ) -> PyResult<Self> {
        let some = usize::try_from(escs).ok();
        let Some(escs) = some.filter(|escs| (1..=ESCS_MAX).contains(escs)) else {
            return Err(wrong(format!("{escs} ESCs; give 1 to {ESCS_MAX}")));
        };
        let Standing {
            bench,
            params: of_bench,
            ..
        } = stand(bench, to_table(given)?).map_err(wrong)?;
        let given = params.iter().map(|(name, value)| parameter(name, *value));
        let given = given.collect::<Result<Vec<_>, _>>().map_err(wrong)?;
        let setup = Setup {
            bench,
            escs,
            signal: ThrottleSignal::try_from(signal).map_err(wrong)?,
            params: of_bench.into_iter().chain(given).collect(),
            storage,
            records,
            traces,
        };
        let (inner, warnings) = laboratory::Laboratory::set_up(setup).map_err(wrong)?;
        Ok(Self {
            inner: Held::new(inner),
            escs,
            warnings,
        })
    }

    #[getter]
    fn escs(&self) -> usize {
        self.escs
    }

    #[getter]
    fn now_ns(&self, py: Python<'_>) -> PyResult<u64> {
        self.with(py, |inner| inner.rack().now_ns())
    }

    fn advance(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let mut left_ns = ns(seconds)?;
        self.with(py, laboratory::Laboratory::begin)?;
        loop {
            let stride_ns = left_ns.min(LOOK_NS);
            left_ns -= stride_ns;
            let gone = self.with(py, |inner| -> Result<(), Void> {
                let until_ns = inner.rack().now_ns() + stride_ns;
                inner.go_on_to(until_ns)
            });
            gone?.map_err(wrong)?;
            if left_ns == 0 {
                return Ok(());
            }
            py.check_signals()?;
        }
    }

    fn throttle(&self, py: Python<'_>, esc: usize) -> PyResult<Option<f64>> {
        let esc = self.check(esc)?;
        self.with(py, |inner| inner.throttles()[esc])
    }

    fn set_throttle(&self, py: Python<'_>, esc: usize, throttle: Option<f64>) -> PyResult<()> {
        let esc = self.check(esc)?;
        if let Some(value) = throttle
            && !(0.0..=1.0).contains(&value)
        {
            let what = format!("throttle = {value} is out of range; give 0 to 1, or None");
            return Err(wrong(what));
        }
        self.with(py, |inner| inner.set_throttle(esc, throttle))
    }

    fn send(&self, py: Python<'_>, esc: usize, datagram: &[u8], after_s: f64) -> PyResult<()> {
        let (esc, after_ns) = (self.check(esc)?, ns(after_s)?);
        let sent = self.with(py, |inner| inner.send(esc, after_ns, datagram));
        sent?.map_err(wrong)
    }

    #[pyo3(signature = (supply_v, supply_ohm, ambient_c, torques_nm, winds_rpm))]
    fn environment(
        &self,
        py: Python<'_>,
        supply_v: Option<f64>,
        supply_ohm: Option<f64>,
        ambient_c: Option<f64>,
        torques_nm: Vec<Option<f64>>,
        winds_rpm: Vec<Option<f64>>,
    ) -> PyResult<()> {
        let shafts = torques_nm.into_iter().zip(winds_rpm);
        let shafts = shafts.map(|(torque_nm, wind_rpm)| Shaft {
            torque_nm,
            wind_rpm,
        });
        let change = Environment {
            supply_v,
            supply_ohm,
            ambient_c,
            shafts: shafts.collect(),
        };
        let changed = self.with(py, |inner| inner.surround(&change));
        changed?.map_err(wrong)
    }

    fn states(&self, py: Python<'_>) -> PyResult<Vec<EscState>> {
        self.with(py, |inner| {
            let rack = inner.rack();
            let states = rack.states().map(|state| EscState {
                state,
                replies: Vec::new(),
            });
            let mut states: Vec<_> = states.collect();
            for answer in rack.answers() {
                states[answer.esc].replies.push(Reply {
                    asked_ns: answer.asked_ns,
                    datagram: answer.datagram.clone(),
                });
            }
            states
        })
    }

    fn param(&self, py: Python<'_>, esc: usize, name: &str) -> PyResult<f32> {
        let (esc, id) = (self.check(esc)?, known(name)?);
        self.with(py, |inner| inner.param(esc, id))
    }

    fn set_param(&self, py: Python<'_>, esc: usize, name: &str, value: f32) -> PyResult<()> {
        let esc = self.check(esc)?;
        known(name)?;
        let (id, value) = parameter(name, value).map_err(wrong)?;
        let set = self.with(py, |inner| inner.set_param(esc, id, value));
        set?.map_err(wrong)
    }

    fn receive(&self, py: Python<'_>, bytes: &[u8]) -> PyResult<()> {
        self.with(py, |inner| inner.receive(bytes))
    }

    fn take_sent<'py>(&self, py: Python<'py>, most: usize) -> PyResult<Bound<'py, PyBytes>> {
        let sent = self.with(py, |inner| inner.take_sent(most))?;
        Ok(PyBytes::new(py, &sent))
    }

    fn inject(&self, py: Python<'_>, esc: usize, text: String) -> PyResult<()> {
        let esc = self.check(esc)?;
        let fault = scenario::fault(&text).map_err(wrong)?;
        self.with(py, |inner| inner.inject(esc, fault, text))
    }

    fn mend(&self, py: Python<'_>, esc: usize) -> PyResult<()> {
        let esc = self.check(esc)?;
        self.with(py, |inner| inner.mend(esc))
    }

    fn faults(&self, py: Python<'_>, esc: usize) -> PyResult<Vec<String>> {
        let esc = self.check(esc)?;
        self.with(py, |inner| inner.faults(esc))
    }

    fn take_recorded<'py>(
        &self,
        py: Python<'py>,
        esc: usize,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let esc = self.check(esc)?;
        let rows = self.with(py, |inner| inner.take_recorded(esc))?;
        Ok(rows.map(|rows| PyBytes::new(py, &rows)))
    }

    fn trace_hash(&self, py: Python<'_>, esc: usize) -> PyResult<Option<String>> {
        let esc = self.check(esc)?;
        self.with(py, |inner| inner.trace_hash(esc))
    }
}
