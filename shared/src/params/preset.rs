//! Named sets of parameters.

use super::ParamId;
use super::choice::{CtlObsCure, CtlObserver, CtlRegulator, CtlSpeed};

/// Parameters that belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// Name.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// The parameters and their values, each within the table's range.
    pub settings: &'static [(ParamId, f32)],
}

/// The first paper's drive: pole placement with 1/ε = R/(1.5·L) and a speed loop of k_pω/J then gives
/// the gains of its Table III, on the motor of its Table I at 15 kHz.
pub const BOSSO_TABLE_III: Preset = Preset {
    name: "bosso-table-iii",
    description: "the first paper's motor and drive as published, with the gains of its Table III",
    settings: &[
        (ParamId::MotPolePairs, 12.0),
        (ParamId::MotRMohm, 108.0),
        (ParamId::MotLUh, 30.6),
        (ParamId::MotFluxMwb, 1.3),
        (ParamId::MotJGcm2, 1430.0),
        (ParamId::CtlRpmMax, 6000.0),
        (ParamId::PwmFreqHz, 15_000.0),
        CtlObserver::BackEmf.setting(),
        CtlObsCure::Published.setting(),
        CtlRegulator::ObserverBased.setting(),
        CtlSpeed::Pi.setting(),
        (ParamId::CtlBwCurHz, 375.0),
        (ParamId::CtlBwSpdHz, 7.9),
    ],
};

/// All presets.
pub const PRESETS: &[Preset] = &[BOSSO_TABLE_III];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{Board, Params, build};

    #[test]
    fn every_preset_makes_a_drive() {
        for preset in PRESETS {
            let mut params = Params::default();
            for (id, value) in preset.settings {
                params.set(*id, *value).expect("in range");
            }
            build(&params, &Board::BENCH).expect(preset.name);
        }
    }
}
