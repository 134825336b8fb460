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

/// A 5-inch racing motor, whose coefficients the tests calculate by hand: R 33 mΩ, L 12 µH, 0.3215 mWb, 7 pole pairs,
/// 63 g·cm²; 40 A, 20 V, 48 kHz, 200 ns. The rest follows.
pub const RACING: [(ParamId, f32); 11] = [
    (ParamId::CtlRpmMin, 0.0),
    (ParamId::MotPolePairs, 7.0),
    (ParamId::MotRMohm, 33.0),
    (ParamId::MotLUh, 12.0),
    (ParamId::MotFluxMwb, 0.3215),
    (ParamId::MotJGcm2, 63.0),
    (ParamId::CtlRpmMax, 20_000.0),
    (ParamId::PwmFreqHz, 48_000.0),
    (ParamId::PwmDeadtimeNs, 200.0),
    (ParamId::LimPhaseA, 40.0),
    (ParamId::LimBusVMax, 20.0),
];

/// All presets.
pub const PRESETS: &[Preset] = &[BOSSO_TABLE_III, BOSSO_BENCH, BOSSO_MOTOR];
