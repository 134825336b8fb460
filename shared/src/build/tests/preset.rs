//! The presets make drives.

use siskin_params::{Board, PRESETS, Params};

use crate::build::build;

#[test]
fn every_preset_makes_a_drive() {
    for preset in PRESETS {
        let params = Params::of(preset);
        for (id, value) in preset.settings {
            assert!(id.entry().allows(*value), "{}", id.entry().name);
        }
        build(&params, &Board::BENCH).expect(preset.name);
    }
}
