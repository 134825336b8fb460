//! A bench for a run that is no scenario.

use std::path::Path;

use siskin_params::ParamId;
use toml::{Table, Value};

use super::ScenarioError;
use super::file::Scenario;
use crate::rig::Bench;

/// A bench by name, and what the ESC must know of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// The bench.
    pub bench: Bench,
    /// Parameters to set before the start.
    pub params: Vec<(ParamId, f32)>,
    /// The names of motor and load.
    pub names: [String; 2],
}

/// Builds the bench `base`, by name or path, with the keys of `given`, those of a scenario's
/// `[bench]`, overriding its own.
///
/// # Errors
/// Any [`ScenarioError`] that a scenario on this bench would show before it is played.
pub fn stand(base: &str, given: Table) -> Result<Standing, ScenarioError> {
    let mut bench = given;
    bench.insert("base".to_owned(), Value::String(base.to_owned()));
    let root = Table::from_iter([("bench".to_owned(), Value::Table(bench))]);
    let root = Scenario::complete(root, Path::new(""))?;
    let name = |kind: &str| {
        let part = root.get("bench").and_then(|bench| bench.get(kind));
        let name = part.and_then(|part| part.get("name")).or(part);
        let name = name.and_then(Value::as_str);
        name.map_or_else(|| format!("that of {base}"), str::to_owned)
    };
    let names = [name("motor"), name("load")];
    let states_dead_time = root
        .get("bench")
        .is_some_and(|bench| bench.get("dead_time_ns").is_some());
    let scenario = Scenario::understand(root)?;
    let mut bench = scenario.bench.bench()?;
    let params = scenario.params()?;
    // The bridge of a bench that states none, or the one that the ESC sets, has what is set while it runs too; any
    // other is one that the ESC does not know of.
    let mut own = params.iter().rev();
    let own = own.find(|(id, _)| *id == ParamId::PwmDeadtimeNs);
    let own_ns = own.map_or(ParamId::PwmDeadtimeNs.entry().default, |(_, value)| *value);
    if !states_dead_time || scenario.bench.dead_time_ns == f64::from(own_ns) {
        bench.dead_time_s = None;
    }
    Ok(Standing {
        bench,
        params,
        names,
    })
}

#[cfg(test)]
mod tests {
    use siskin_control::build::build;
    use siskin_control::control::speed::Bounds;
    use siskin_params::{BOSSO_BENCH, Params};
    use siskin_units::{Current, Speed};

    use super::*;
    use crate::bench::library;

    #[test]
    fn the_default_bench_is_the_first_one_of_the_library() {
        let standing = stand(library::DEFAULT, Table::new()).unwrap();
        assert_eq!(standing.bench, Bench::default());
        let of_bench = |setting| standing.params.contains(setting);
        assert!(BOSSO_BENCH.settings.iter().all(of_bench));
        assert_eq!(standing.params.len(), BOSSO_BENCH.settings.len());
        assert_eq!(standing.names, ["antigravity-4006-kv380", "cfprop-13x4.4"]);
    }

    #[test]
    fn every_bench_of_the_library_stands_and_fits_its_parameters() {
        for name in library::names() {
            let Standing { bench, params, .. } = stand(name, Table::new()).unwrap();
            let mut believed = Params::default();
            for (id, value) in params {
                believed.set(id, value).unwrap();
            }
            let board = bench.sensing.board(bench.delay);
            let built = build(&believed, &board);
            assert!(built.is_ok(), "{name}: {:?}", built.err());
            // The ESC's knowledge matches the bench.
            let believes = |id, truth: f64, name: &str| {
                let value = f64::from(believed.get(id));
                assert!(
                    (value / truth - 1.0).abs() < 0.05,
                    "{name}: {value} {truth}"
                );
            };
            // In a scenario, where it stands whatever is set, and in other runs, where it follows what is set.
            let ns = believed.get(ParamId::PwmDeadtimeNs);
            assert_eq!(bench.dead_time_s, None, "{name}");
            assert_eq!(scenario_dead_time_ns(name), f64::from(ns), "{name}");
            let inertia = bench.motor.inertia_kgm2 + bench.load.inertia_kgm2;
            believes(ParamId::MotPolePairs, bench.motor.pole_pairs.into(), name);
            believes(ParamId::MotRMohm, 1e3 * bench.motor.resistance_ohm, name);
            believes(ParamId::MotLUh, 1e6 * bench.motor.inductance_h, name);
            believes(ParamId::MotFluxMwb, 1e3 * bench.motor.flux_wb, name);
            believes(ParamId::MotJGcm2, 1e7 * inertia, name);
        }
    }

    fn scenario_dead_time_ns(base: &str) -> f64 {
        let root: Table = toml::from_str(&format!("[bench]\nbase = \"{base}\"")).unwrap();
        let stated = Scenario::complete(root.clone(), Path::new("")).unwrap();
        assert!(stated["bench"].get("dead_time_ns").is_some(), "{base}");
        let scenario = Scenario::read(root, Path::new("")).unwrap();
        let dead_time_s = scenario.bench.bench().unwrap().dead_time_s;
        libm::round(1e9 * dead_time_s.unwrap())
    }

    /// In other runs too: the ESC does not know of it.
    #[test]
    fn a_dead_time_that_the_esc_does_not_set_stands() {
        let given = Table::from_iter([("dead_time_ns".to_owned(), Value::Float(400.0))]);
        let standing = stand("quad-3-inch", given).unwrap();
        assert_eq!(standing.bench.dead_time_s, Some(400.0 * 1e-9));
    }

    /// As the control's README has it: φ/L bounds i_q in braking on three benches, and 1.5·φ/L in driving on none.
    #[test]
    fn the_winding_s_flux_bounds_the_braking_current_of_three_benches() {
        let full = Bounds {
            min: Current::MIN,
            max: Current::MAX,
        };
        let [mut braking, mut driving] = [Vec::new(), Vec::new()];
        for name in library::names() {
            let Standing { bench, params, .. } = stand(name, Table::new()).unwrap();
            let mut stated = Params::default();
            for (id, value) in params {
                stated.set(id, value).unwrap();
            }
            let built = build(&stated, &bench.sensing.board(bench.delay)).unwrap();
            let (_, bounds) = built.low_speed.bounds(full, Speed::MAX);
            let limit = built.scale.current_from_a(stated.get(ParamId::LimPhaseA));
            if bounds.min > -limit {
                braking.push(name);
            }
            if bounds.max < limit {
                driving.push(name);
            }
        }
        braking.sort_unstable();
        assert_eq!(braking, ["cinelifter", "quad-5-inch", "quad-7-inch"]);
        assert!(driving.is_empty(), "{driving:?}");
    }
}
