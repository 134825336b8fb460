//! The running control obeys the paper's limits and formulas.

use std::sync::LazyLock;

use super::*;
use crate::reproduce::item::Item;

static COLTON: LazyLock<Reproduction> = LazyLock::new(colton);

fn find(name: &str) -> &'static Item {
    let item = COLTON.items.iter().find(|item| item.name == name);
    item.expect("an item of this name")
}

fn both(name: &str) -> (f64, f64) {
    let item = find(name);
    let paper = item.paper.expect("the paper has one");
    (paper, item.measured.expect("it was measured"))
}

/// Checks that every item with this prefix is within `within` of its formula.
#[track_caller]
fn assert_close(prefix: &str, count: usize, within: f64) {
    let names = COLTON.items.iter().map(|item| item.name.as_str());
    let names: Vec<&str> = names.filter(|name| name.starts_with(prefix)).collect();
    assert_eq!(names.len(), count, "{names:?}");
    for name in names {
        let (paper, measured) = both(name);
        assert!(
            (measured - paper).abs() <= within,
            "{name}: {measured} of {paper}"
        );
    }
}

#[test]
fn the_errors_are_within_the_papers_bounds_and_limits() {
    for (name, most) in [
        ("fig28_of_bound", 100.0),
        ("fig28_error_1000_to_3400", 10.0),
        ("fig28_error_500_to_7300", 20.0),
        ("fig30_of_bound", 100.0),
        ("fig30_error_from_2000", 20.0),
        ("fig54_error_at_0.44", 10.0),
    ] {
        let (paper, got) = both(name);
        assert_eq!(paper, most, "{name}");
        assert!(got > 0.0 && got < most, "{name}: {got}");
    }
    let bounded = COLTON.items.iter().filter(|item| {
        ["fig27", "fig28", "fig30"]
            .iter()
            .any(|name| item.name.starts_with(name))
    });
    assert!(bounded.clone().count() > 15);
    for item in bounded {
        let (paper, got) = both(&item.name);
        assert!(got < paper, "{}: {got} of {paper}", item.name);
    }
}

#[test]
fn the_running_integrators_are_the_papers() {
    // A sampled filter resolves time to half a sampling period, 32 µs.
    assert_close("fig19_tau_int", 7, 0.032);
    assert_close("fig20_gain", 2, 0.05);
    assert_close("fig20_phase", 2, 0.5);
    assert_close("fig21_lead", 8, 0.2);
}

#[test]
fn each_source_of_error_is_as_large_as_its_formula_or_taken_care_of() {
    for name in ["low_pass", "hold_off", "digital_delay"] {
        let (formula, got) = both(&format!("table1_{name}"));
        assert!((got - formula).abs() < 0.5, "{name}: {got} of {formula}");
    }
    // The speed is measured at every edge instead of once in N turns.
    for name in ["extrapolation", "position_filter"] {
        let (formula, got) = both(&format!("table1_{name}"));
        assert!(
            got > 0.2 * formula && got < formula,
            "{name}: {got} of {formula}"
        );
    }
}

#[test]
fn the_scooters_flux_leads_and_its_current_leads_the_flux_as_the_paper_says() {
    // With noise, dead time and 12 bits.
    assert_close("fig42_lead", 5, 1.0);
    let (motor, flux) = both("fig43_flux");
    assert!((flux / motor - 1.0).abs() < 0.05, "{flux} of {motor}");
    assert_close("fig43_current_leads_flux", 1, 10.0);
}

#[test]
fn the_quadrotor_climbs_on_its_transient_current() {
    let (predicted, peak) = both("fig50_peak_i_q");
    // The paper: hardware must bear two to three times the predicted peak.
    assert!(
        peak > 0.9 * predicted && peak < 2.0 * predicted,
        "{peak} of {predicted}"
    );
    assert_close("fig50_speed", 1, 50.0);
    assert_close("fig50_i_d", 1, 1.0);
}

#[test]
fn the_quadrotors_flux_is_clean_at_every_speed() {
    assert_close("fig52_amplitude", 3, 0.05);
    let distortion = find("fig52_distortion").measured;
    assert!(
        distortion.is_some_and(|percent| percent < 10.0),
        "{distortion:?}"
    );
}

#[test]
fn the_tables_are_json_without_a_gap() {
    let value = serde_json::to_value(&*COLTON).expect("numbers and text");
    let items = value["items"].as_array().expect("a list");
    for item in items {
        assert!(item["measured"].is_f64(), "{item}");
        for key in ["name", "unit", "note"] {
            assert!(item[key].is_string(), "{item}");
        }
    }
}

#[test]
fn every_figure_has_its_picture() {
    let names: Vec<&str> = COLTON
        .figures
        .iter()
        .map(|figure| figure.name.as_str())
        .collect();
    let wanted = [
        "19", "20", "21", "27", "28", "30", "table-1", "42", "43", "50", "52", "54",
    ];
    assert_eq!(names, wanted.map(|name| format!("colton-{name}")));
}
