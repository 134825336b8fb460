use super::*;

const FILE: &str = r#"
    [bench]
    duration_s = 0.1
    [[signal]]
    at_s = 0.0
    rpm = 1000.0
    [sweep]
    "bench.scale.R" = [0.7, 1.0, 1.3]
    "signal.0.rpm" = [3000.0, 6000.0]
    [random]
    "bench.scale.L" = [0.7, 1.3]
    "bench.delay_periods" = { of = [0.0, 0.5, 1.0] }
    "bench.adc_bits" = [10, 12]
"#;

fn read(text: &str, set: &[(&str, &str)], seeds: Option<RangeInclusive<u64>>) -> Variations {
    let set = set
        .iter()
        .map(|(key, value)| ((*key).to_owned(), toml_value(value)));
    Variations::read(text, &set.collect::<Vec<_>>(), seeds, Path::new("")).unwrap()
}

fn toml_value(text: &str) -> Value {
    toml::from_str::<Table>(&format!("x = {text}")).unwrap()["x"].clone()
}

fn refused(text: &str) -> String {
    Variations::read(text, &[], None, Path::new(""))
        .unwrap_err()
        .to_string()
}

fn cases(variations: &Variations) -> Vec<Case> {
    let all = 0..variations.runs();
    all.map(|index| variations.case(index).unwrap()).collect()
}

#[test]
fn every_combination_runs_for_every_seed() {
    let cases = cases(&read(FILE, &[], Some(3..=4)));
    let places: Vec<_> = cases.iter().map(|case| case.place.to_string()).collect();
    assert_eq!(places.len(), 3 * 2 * 2);
    assert_eq!(
        places[0],
        "--seed 3 --set bench.scale.R=0.7 --set signal.0.rpm=3000.0"
    );
    assert_eq!(
        places[1],
        "--seed 4 --set bench.scale.R=0.7 --set signal.0.rpm=3000.0"
    );
    assert_eq!(
        places[2],
        "--seed 3 --set bench.scale.R=0.7 --set signal.0.rpm=6000.0"
    );
    assert_eq!(
        places[11],
        "--seed 4 --set bench.scale.R=1.3 --set signal.0.rpm=6000.0"
    );
    let last = &cases[11].scenario;
    assert_eq!((last.bench.seed, last.signal[0].rpm), (4, Some(6000.0)));
    assert!((last.bench.bench().unwrap().motor.resistance_ohm - 1.3 * 0.108).abs() < 1e-12);
}

#[test]
fn a_run_is_the_same_alone() {
    let all = cases(&read(FILE, &[], Some(1..=20)));
    let alone = read(
        FILE,
        &[("bench.scale.R", "1.3"), ("signal.0.rpm", "3000.0")],
        Some(17..=17),
    );
    assert_eq!(alone.runs(), 1);
    let alone = alone.case(0).unwrap();
    let text = alone.place.to_string();
    let same = all.iter().find(|case| case.place.to_string() == text);
    assert_eq!(alone.place.drawn, same.unwrap().place.drawn);
}

#[test]
fn draws_are_even_over_their_range_and_each_key_has_its_own() {
    let cases = cases(&read(FILE, &[("bench.scale.R", "1.0")], Some(1..=1000)));
    let of = |key: &str| -> Vec<f64> {
        let drawn = cases.iter().flat_map(|case| &case.place.drawn);
        let values = drawn.filter(|(other, _)| other == key);
        values
            .map(|(_, v)| v.as_float().or(v.as_integer().map(|i| i as f64)).unwrap())
            .collect()
    };
    let (inductances, delays, bits) = (
        of("bench.scale.L"),
        of("bench.delay_periods"),
        of("bench.adc_bits"),
    );
    assert!(inductances.iter().all(|x| (0.7..1.3).contains(x)));
    // Each seed is drawn twice here, for two speeds: the mean's deviation is 0.6/√12/√1000.
    let mean = inductances.iter().sum::<f64>() / inductances.len() as f64;
    assert!((mean - 1.0).abs() < 4.0 * 0.0055, "{mean}");
    let thirds = |values: &[f64], x: f64| {
        let count = values.iter().filter(|value| **value == x).count();
        count as f64 / values.len() as f64
    };
    // 1/3 within four deviations of √(2/9/1000).
    for x in [0.0, 0.5, 1.0] {
        assert!((thirds(&delays, x) - 1.0 / 3.0).abs() < 0.06, "{x}");
    }
    for x in [10.0, 11.0, 12.0] {
        assert!((thirds(&bits, x) - 1.0 / 3.0).abs() < 0.06, "{x}");
    }
    let same = delays
        .iter()
        .zip(&bits)
        .filter(|(d, b)| **d * 2.0 + 10.0 == **b);
    let same = same.count() as f64 / delays.len() as f64;
    assert!((same - 1.0 / 3.0).abs() < 0.06, "they are one draw: {same}");
}

#[test]
fn what_is_set_is_neither_swept_nor_drawn() {
    let set = [("bench.scale.L", "0.9"), ("bench.scale.R", "1.1")];
    let variations = read(FILE, &set, None);
    assert_eq!(variations.runs(), 2);
    let case = variations.case(0).unwrap();
    assert!(
        case.place
            .drawn
            .iter()
            .all(|(key, _)| key != "bench.scale.L")
    );
    let motor = case.scenario.bench.bench().unwrap().motor;
    assert!((motor.resistance_ohm - 1.1 * 0.108).abs() < 1e-12);
    assert!((motor.inductance_h - 0.9 * 30.6e-6).abs() < 1e-15);
}

#[test]
fn the_seed_of_the_file_makes_its_draws_and_may_be_swept() {
    let text = "[bench]\nseed = 5\n[random]\n\"bench.noise_a\" = [0.0, 1.0]";
    let of_file = read(text, &[], None).case(0).unwrap();
    let given = read(text, &[], Some(5..=5)).case(0).unwrap();
    assert_eq!(of_file.place.drawn, given.place.drawn);
    let swept = read(
        &format!("{text}\n[sweep]\n\"bench.seed\" = [4, 5]"),
        &[],
        None,
    );
    assert_eq!(swept.case(1).unwrap().place.drawn, given.place.drawn);
    assert_eq!(swept.case(0).unwrap().scenario.bench.seed, 4);
}

#[test]
fn a_wrong_key_is_named() {
    for (text, words) in [
        (
            "[sweep]\n\"bench.scale.Q\" = [1.0]",
            ["bench.scale.Q", "unknown field"],
        ),
        (
            "[sweep]\n\"bench.noise_a\" = ['loud']",
            ["bench.noise_a", "f64"],
        ),
        (
            "[sweep]\n\"bench.noise_a\" = []",
            ["bench.noise_a", "no values"],
        ),
        (
            "[sweep]\n\"signal.0.rpm\" = [1.0]",
            ["signal.0.rpm", "sequence"],
        ),
        (
            "signal = [{ at_s = 0.0, rpm = 1.0 }]\n[sweep]\n\"signal.1.rpm\" = [1.0]",
            ["signal.1.rpm", "none of its 1 entries"],
        ),
        (
            "[bench]\nbus = 24.0\n[sweep]\n\"bench.bus.x\" = [1.0]",
            ["bench.bus.x", "float"],
        ),
        ("[sweep]\nbench.noise_a = [0.0]", ["line 2", "sequence"]),
        (
            "[random]\n\"bench.noise_a\" = [1.0, 0.0]",
            ["bench.noise_a", "greater"],
        ),
        (
            "[random]\n\"bench.noise_a\" = [0.0, inf]",
            ["bench.noise_a", "finite"],
        ),
        (
            "[random]\n\"bench.noise_a\" = { of = [] }",
            ["bench.noise_a", "no values"],
        ),
        (
            "[random]\n\"bench.noise_a\" = 1.0",
            ["line 2", "[least, greatest]"],
        ),
        (
            "[random]\n\"bench.nose_a\" = [0.0, 1.0]",
            ["bench.nose_a", "unknown field"],
        ),
        (
            "[random]\n\"bench.seed\" = [1, 9]",
            ["bench.seed", "cannot"],
        ),
        (
            "[random]\n\"bench.seed\" = [1, 9]\n[sweep]\n\"bench.seed\" = [1]",
            ["bench.seed", "both"],
        ),
    ] {
        let line = refused(text);
        assert!(!line.contains('\n'), "{line}");
        assert!(
            words.iter().all(|word| line.contains(word)),
            "{text}: {line}"
        );
    }
}

#[test]
fn there_are_only_so_many_runs() {
    let error = Variations::read("", &[], Some(0..=u64::MAX), Path::new("")).unwrap_err();
    assert!(
        error.to_string().starts_with("18446744073709551616 runs"),
        "{error}"
    );
}
