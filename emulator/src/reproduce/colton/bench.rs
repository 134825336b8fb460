//! The second paper's machines from the library, on the bench under its observer.

use siskin_control::build::build;
use siskin_control::drive::Setpoint;
use siskin_params::{BOSSO_BENCH, ParamId, Params};
use siskin_units::Scale;

use crate::plant::{Load, Motor};
use crate::rig::{Bench, Period, Rig};
use crate::scenario::{Standing, stand};

/// A drive on its bench.
pub(super) struct Drive {
    pub(super) rig: Rig,
    pub(super) params: Params,
    pub(super) motor: Motor,
    pub(super) load: Load,
    time_s: f64,
}

/// Returns the scooter of section 4.1, which its rider pushes to 150 rpm. The flux is followed down
/// to 100.
///
/// The paper does not give its poles. Here they are 30 instead of the library's 14, for the same
/// speed at the same voltage: the supply must exceed an eighth of the control's unit of voltage,
/// π·φ/(2·T_s), which at 15.625 kHz means 11 mWb for 35 V.
pub(super) fn scooter() -> Drive {
    drive(
        "scooter",
        "initial_rpm = 150.0
         motor.pole_pairs = 15
         motor.flux = 10.1e-3",
        &[
            (ParamId::MotPolePairs, 15.0),
            (ParamId::MotFluxMwb, 10.1),
            (ParamId::CtlRpmMin, 200.0),
            (ParamId::StaRunRpm, 200.0),
            (ParamId::CtlSlewRpmS, 100.0),
        ],
    )
}

/// Returns the quadrotor of section 4.2 at the sampling frequency of the paper's drives.
pub(super) fn quadrotor(others: &[(ParamId, f64)]) -> Drive {
    let own = [(ParamId::PwmFreqHz, super::estimator::SAMPLE_HZ)];
    drive("quad-10-inch", "", &[&own, others].concat())
}

/// Returns a library bench with these keys and parameters overriding its own.
fn drive(base: &str, keys: &str, others: &[(ParamId, f64)]) -> Drive {
    let keys = keys.parse().expect("written here");
    let stands = stand(base, keys).expect("the built-in benches are tested");
    let Standing {
        bench, params: own, ..
    } = stands;
    let mut params = Params::of(&BOSSO_BENCH);
    let others = others.iter().map(|(id, value)| (*id, *value as f32));
    let observer = [(ParamId::CtlObserver, 1.0)];
    for (id, value) in own.into_iter().chain(observer).chain(others) {
        params.set(id, value).expect("within the table");
    }
    Drive::new(bench, params)
}

impl Drive {
    fn new(bench: Bench, params: Params) -> Self {
        let board = bench.sensing.board(bench.delay);
        let config = build(&params, &board).expect("the parameters fit the bench");
        Self {
            motor: bench.motor,
            load: bench.load,
            rig: Rig::new(bench, config),
            params,
            time_s: 0.0,
        }
    }

    /// Returns the units of the control's numbers.
    pub(super) fn scale(&self) -> Scale {
        self.rig.config().scale
    }

    /// Returns the set-point of a speed, rpm.
    pub(super) fn at_rpm(&self, rpm: f64) -> Setpoint {
        Setpoint::Speed(self.scale().speed_from_rpm(rpm as f32))
    }

    /// Returns the torque per current, Nm/A.
    pub(super) fn torque_nm_per_a(&self) -> f64 {
        1.5 * f64::from(self.motor.pole_pairs) * self.motor.flux_wb
    }

    /// Runs for this long; `each` sees every period with its start, s.
    pub(super) fn run(
        &mut self,
        setpoint: Setpoint,
        for_s: f64,
        mut each: impl FnMut(f64, &Period, &Rig),
    ) {
        let end_s = self.time_s + for_s;
        while self.time_s < end_s {
            let period = self.rig.period(setpoint);
            each(self.time_s, &period, &self.rig);
            self.time_s += self.rig.period_s();
        }
    }
}
