//! Named sets of parameters.

use super::ParamId;
use super::choice::{CtlObsCure, CtlObserver, CtlRegulator, CtlSpeed, StaMode};

/// A named set of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// Name.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// The parameters and their values, each within the table's range.
    pub settings: &'static [(ParamId, f32)],
}

/// The motor of the first paper's Table I, with its propeller's inertia.
pub const BOSSO_MOTOR: Preset = Preset {
    name: "bosso-motor",
    description: "the first paper's motor, an Antigravity 4006 KV380, and its 13x4.4 propeller",
    settings: &MOTOR,
};

const MOTOR: [(ParamId, f32); 5] = [
    (ParamId::MotPolePairs, 12.0),
    (ParamId::MotRMohm, 108.0),
    (ParamId::MotLUh, 30.6),
    (ParamId::MotFluxMwb, 1.3),
    (ParamId::MotJGcm2, 1430.0),
];

/// The first paper's drive: pole placement with 1/ε = R/(1.5·L) and a speed loop of k_pω/J reproduces the gains of its
/// Table III, for the motor of its Table I at 15 kHz.
pub const BOSSO_TABLE_III: Preset = Preset {
    name: "bosso-table-iii",
    description: "the first paper's motor and drive as published, with the gains of its Table III",
    settings: &[
        MOTOR[0],
        MOTOR[1],
        MOTOR[2],
        MOTOR[3],
        MOTOR[4],
        (ParamId::CtlRpmMax, 6000.0),
        (ParamId::PwmFreqHz, 15_000.0),
        CtlObserver::BackEmf.setting(),
        CtlObsCure::Published.setting(),
        CtlRegulator::ObserverBased.setting(),
        CtlSpeed::Pi.setting(),
        (ParamId::CtlBwCurHz, 375.0),
        (ParamId::CtlBwSpdHz, 7.9),
        (ParamId::CtlRpmMin, 300.0),
        (ParamId::CtlSlewRpmS, 20_000.0),
        (ParamId::StaParkAs, 0.4),
        (ParamId::StaRampA, 4.0),
        (ParamId::StaRampRpmS, 800.0),
        (ParamId::StaRunRpm, 300.0),
        StaMode::Stated.setting(),
    ],
};

/// The settings that drive the first paper's bench here. Chosen by hand, and the basis of every figure of that bench;
/// with [`BOSSO_MOTOR`] alone they follow from the motor.
pub const BOSSO_BENCH: Preset = Preset {
    name: "bosso-bench",
    description: "the first paper's motor, and settings of start and control loops for its bench, chosen by hand",
    settings: &[
        MOTOR[0],
        MOTOR[1],
        MOTOR[2],
        MOTOR[3],
        MOTOR[4],
        (ParamId::CtlRpmMin, 300.0),
        (ParamId::CtlSlewRpmS, 20_000.0),
        (ParamId::CtlBwCurHz, 375.0),
        (ParamId::CtlBwSpdHz, 7.9),
        (ParamId::StaParkAs, 0.4),
        (ParamId::StaRampA, 4.0),
        (ParamId::StaRampRpmS, 800.0),
        (ParamId::StaRunRpm, 300.0),
        StaMode::Stated.setting(),
    ],
};

/// All presets.
pub const PRESETS: &[Preset] = &[BOSSO_TABLE_III, BOSSO_BENCH, BOSSO_MOTOR];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{Board, Params, build};

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
}
