//! Whatever parts a build has: `cargo test -p siskin-params --no-default-features --features ... --test parts`.

use siskin_params::choice::{CtlAdaptL, CtlHall, CtlObserver, CtlRegulator, CtlSpeed};
use siskin_params::metadata::PARAMETER_METADATA;
use siskin_params::parts::Part;
use siskin_params::{BOSSO_BENCH, ParamId, Params};

/// Returns a parameter's entry in the metadata.
fn metadata(id: ParamId) -> &'static str {
    let name = format!("\"name\":\"{}\"", id.entry().name);
    PARAMETER_METADATA
        .split("{\"type\":")
        .find(|entry| entry.contains(&name))
        .expect("it is listed")
}

/// Every choice that needs a part: its parameter, number, meaning and part.
fn parted() -> impl Iterator<Item = (ParamId, u8, &'static str, Part)> {
    ParamId::ALL.into_iter().flat_map(|id| {
        let choices = id.text().choices.iter();
        choices
            .filter_map(move |(number, meaning)| Some((id, *number, *meaning, id.part(*number)?)))
    })
}

#[test]
fn the_metadata_has_the_choices_whose_part_is_here() {
    let mut seen = 0;
    for (id, number, meaning, part) in parted() {
        let choice = format!("{{\"value\":{number},\"description\":\"{meaning}\"}}");
        let name = id.entry().name;
        assert_eq!(
            metadata(id).contains(&choice),
            part.is_here(),
            "{name} {number}"
        );
        assert_eq!(
            id.lacks(f32::from(number)),
            !part.is_here(),
            "{name} {number}"
        );
        seen += 1;
    }
    assert!(seen >= 8, "{seen}");
}

#[test]
fn a_parameter_that_nothing_here_uses_says_so() {
    for id in ParamId::ALL {
        let said = metadata(id).contains("\"group\":\"Not in this image\"");
        assert_eq!(said, !id.text().is_used(), "{}", id.entry().name);
    }
    assert_eq!(ParamId::CtlFfA.text().is_used(), Part::Propeller.is_here());
    assert!(ParamId::LimPhaseA.text().is_used());
}

/// As after another image has stored it.
#[test]
fn a_choice_that_is_not_here_is_kept_and_another_is_in_force() {
    for (id, number, _, part) in parted() {
        let mut params = Params::of(&BOSSO_BENCH);
        params.set(id, f32::from(number)).expect("it is in range");
        assert_eq!(params.get(id), f32::from(number));
        assert_eq!(
            params.lacking(),
            (!part.is_here() && !params.is_default(id)).then_some(id)
        );
    }
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, value) in [
        CtlObserver::BackEmf.setting(),
        CtlRegulator::ObserverBased.setting(),
        CtlSpeed::Propeller.setting(),
        CtlAdaptL::On.setting(),
        CtlHall::Merged.setting(),
    ] {
        params.set(id, value).expect("it is in range");
    }
    let here = |part: Part, chosen: bool| assert_eq!(chosen, part.is_here(), "{}", part.name());
    here(Part::BackEmf, params.chosen(CtlObserver::BackEmf));
    here(Part::BackEmf, !params.chosen(CtlObserver::Compensated));
    here(Part::BackEmf, params.chosen(CtlRegulator::ObserverBased));
    here(Part::BackEmf, !params.chosen(CtlRegulator::Synchronous));
    here(Part::Propeller, !params.chosen(CtlSpeed::Inertia));
    here(Part::AdaptL, !params.chosen(CtlAdaptL::Off));
    here(Part::FluxCrossings, !params.chosen(CtlHall::Alone));
}
