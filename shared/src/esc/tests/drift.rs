//! A turning motor's resistance and flux: when they are followed, and what forgets them.

use siskin_params::choice::{CtlAdaptL, CtlDrive, CtlObserver};
use siskin_units::{Current, FLUX_NOMINAL, Flux, Speed, Voltage};

use super::*;
use crate::drive::Drift;

/// More samples than pass between two changes of the values in force.
const FOLLOWED_MS: u32 = 1200;

impl Bench {
    /// Creates one whose motor runs at full speed with 8 % less flux than stated.
    fn warm() -> Self {
        let mut bench = Self::new();
        let (speed, i_q) = (0.08, 0.16);
        let own_flux = 30.6e-6 * bench.esc.scale.current_a / 1.3e-3;
        let snapshot = &mut bench.snapshot;
        snapshot.phase = Phase::Run;
        snapshot.bus = Voltage::from_f32(0.49);
        snapshot.speed = Speed::from_f32(speed);
        snapshot.i.q = Current::from_f32(i_q);
        // The back-EMF of a unit of speed is four units of voltage.
        snapshot.u.d = Voltage::from_f32(-4.0 * speed * own_flux * i_q);
        snapshot.flux = Flux::from_f32(0.92 * FLUX_NOMINAL.to_f32());
        bench
    }

    /// Creates one whose drift is in force.
    fn followed() -> Self {
        let mut bench = Self::warm();
        bench.wait_ms(FOLLOWED_MS);
        assert_ne!(bench.esc.tracker.in_force(), Drift::NONE);
        bench.requests.clear();
        bench
    }

    fn change(&mut self, id: ParamId, value: f32) {
        self.esc.change(&[(id, value)]).expect("it fits");
    }

    /// Returns what the parameters make of the motor with this drift.
    fn built(&self, drift: Drift) -> Config {
        let mut config = Config::default();
        build_in(&self.esc.running(), &Board::BENCH, drift, &mut config).expect("it fits");
        config
    }

    fn told(&self) -> [f32; 2] {
        let telemetry = self.esc.telemetry();
        [telemetry.r_mohm, telemetry.flux_mwb]
    }

    fn stated(&self) -> [f32; 2] {
        [ParamId::MotRMohm, ParamId::MotFluxMwb].map(|id| self.get(id))
    }
}

#[test]
fn the_drive_runs_with_the_flux_that_a_warm_motor_shows() {
    let mut bench = Bench::warm();
    let params = bench.esc.params().clone();
    bench.wait_ms(FOLLOWED_MS);
    let drift = bench.esc.tracker.in_force();
    assert!((0.92..0.98).contains(&drift.flux), "{drift:?}");
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    assert_eq!(bench.config(), bench.built(drift));
    assert_ne!(bench.config(), bench.built(Drift::NONE));
    let [told, stated] = [bench.told(), bench.stated()];
    assert!((0.92..0.98).contains(&(told[1] / stated[1])), "{told:?}");
    assert_eq!(bench.esc.params(), &params, "no parameter changes");
}

#[test]
fn nothing_is_followed_but_by_the_default_observer_with_the_stated_motor() {
    for (id, value) in [
        CtlDrive::SixStep.setting(),
        CtlObserver::BackEmf.setting(),
        CtlObserver::FluxCrossings.setting(),
        CtlObserver::Hall.setting(),
        CtlAdaptL::On.setting(),
        // Without one of these, the motor is assumed.
        (ParamId::MotRMohm, 0.0),
        (ParamId::MotLUh, 0.0),
        (ParamId::MotFluxMwb, 0.0),
    ] {
        for mut bench in [Bench::warm(), Bench::followed()] {
            // Six-step needs 24 periods a turn.
            bench.change(ParamId::CtlRpmMax, 3000.0);
            bench.change(id, value);
            bench.wait_ms(1);
            bench.requests.clear();
            bench.wait_ms(FOLLOWED_MS);
            let changed = bench.requests.contains(&Request::ParamsChanged);
            assert!(!changed, "{id:?} {value}");
            assert_eq!(bench.config(), bench.built(Drift::NONE), "{id:?} {value}");
            assert_eq!(bench.told(), bench.stated(), "{id:?} {value}");
        }
    }
}

#[test]
fn a_motor_that_is_stated_anew_is_followed_from_there() {
    for (id, value) in [
        (ParamId::MotRMohm, 120.0),
        (ParamId::MotLUh, 32.0),
        (ParamId::MotFluxMwb, 1.25),
    ] {
        let mut bench = Bench::followed();
        bench.change(id, value);
        bench.wait_ms(2);
        assert_eq!(bench.config(), bench.built(Drift::NONE), "{id:?}");
        bench.wait_ms(FOLLOWED_MS);
        assert_ne!(bench.esc.tracker.in_force(), Drift::NONE, "{id:?}");
    }
}

#[test]
fn another_parameter_leaves_the_drift_in_force() {
    let mut bench = Bench::followed();
    let drift = bench.esc.tracker.in_force();
    bench.change(ParamId::LimBusA, 20.0);
    bench.wait_ms(2);
    assert_eq!(bench.config(), bench.built(drift));
}

#[test]
fn an_identification_starts_from_the_stated_motor() {
    let mut bench = Bench::followed();
    bench.esc.identify(bench.now_us, false);
    bench.wait_ms(1);
    assert!(bench.esc.identify.is_under_way());
    assert_eq!(bench.told(), bench.stated());
    assert_eq!(bench.esc.tracker.in_force(), Drift::NONE);
    bench.esc.end_identification("cancelled");
    bench.wait_ms(1);
    assert_eq!(bench.config(), bench.built(Drift::NONE));
}
