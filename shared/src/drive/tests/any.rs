//! Arbitrary input.

use super::*;
use fixed::types::I1F31;

/// Pseudo-random numbers.
pub(super) struct Noise(pub(super) u32);

impl Noise {
    fn bits(&mut self) -> i32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 12) as i32
    }

    fn counts(&mut self, most: i32) -> AdcCounts {
        AdcCounts::from_num(self.bits() % most)
    }

    pub(super) fn sample(&mut self, period: u32) -> Sample {
        // Occasionally full range, otherwise below the trip; zero for a while, too.
        let wild = period % 8192 > 8000;
        let (range, bus) = if wild { (4096, 4096) } else { (1000, 300) };
        let still = period / 2048 % 4 == 1;
        let half = AdcCounts::from_num(range / 2);
        Sample {
            currents: [0; 3].map(|_| match still {
                true => AdcCounts::ZERO,
                false => self.counts(range) - half,
            }),
            bus: self.counts(bus) + AdcCounts::from_num(if wild { 0 } else { 1200 }),
            terminals: [0; 3].map(|_| self.counts(4096) >> (period / 64 % 13)),
            hall: (period / 37) as u8 & 7,
        }
    }

    pub(super) fn setpoint(&mut self, period: u32, turn: Setpoint) -> Setpoint {
        let value = self.bits() << 12;
        match period / 1024 % 16 {
            0 => Setpoint::Speed(Speed::from_bits(value)),
            1 => Setpoint::Torque(Current::from_bits(value)),
            2 => Setpoint::Voltage(I1F31::from_bits(value)),
            3 => Setpoint::Test(Current::from_bits(value)),
            4 => Setpoint::Zero,
            5 => Setpoint::Torque(Current::from_bits(value >> 4)),
            6 => Setpoint::Tone(Speed::from_bits(value)),
            7 => Setpoint::Tone(Speed::from_bits(1 << 27)),
            _ => turn,
        }
    }
}

fn words(config: &Config, state: &State) -> usize {
    let mut words = 0;
    state.trace(config, &mut |_| words += 1);
    words
}

/// Returns the phases seen in this many periods of arbitrary input. Overflow panics in this build.
fn anything(changes: &[(ParamId, f32)], periods: u32, seed: u32) -> Vec<Phase> {
    let mut bench = Bench::new(changes);
    let turn = bench.turn();
    let mut noise = Noise(seed);
    let mut seen = Vec::new();
    let expected = words(&bench.config, &bench.state);
    for period in 0..periods {
        let sample = noise.sample(period);
        let setpoint = noise.setpoint(period, turn);
        let bridge = bench.run(1, sample, setpoint);
        let phase = bench.phase();
        if matches!(phase, Phase::Idle | Phase::Sense | Phase::Charge) {
            let off = matches!(bridge, Bridge::Off | Bridge::Charge(_));
            assert!(off, "{changes:?}, {period}: {phase:?} {bridge:?}");
        }
        if !seen.contains(&phase) {
            seen.push(phase);
        }
        assert_eq!(
            words(&bench.config, &bench.state),
            expected,
            "{changes:?}, {period}: {phase:?}"
        );
        if !bench.faults().is_empty() {
            bench.clear_faults();
        }
    }
    seen
}

#[test]
fn no_sample_and_no_set_point_makes_any_drive_overflow() {
    for observer in [0.0, 1.0, 2.0, 3.0] {
        for regulator in [0.0_f32, 1.0, 2.0] {
            for drive in [0.0, 1.0] {
                let changes = [
                    (ParamId::CtlObserver, observer),
                    (ParamId::CtlRegulator, regulator),
                    (ParamId::CtlDrive, drive),
                    // Six-step needs a period per quarter sextant at least.
                    (ParamId::PwmFreqHz, 24_000.0 + 6_000.0 * drive),
                    (ParamId::Inp3d, drive),
                    (ParamId::CtlAdaptL, regulator.min(1.0)),
                    (ParamId::CtlObsCure, drive),
                    // Short starts, so that more than starts is covered.
                    (ParamId::StaParkAs, 0.01),
                    (ParamId::MotJGcm2, 30.0),
                    (ParamId::StaRampRpmS, 20_000.0),
                ];
                let seen = anything(&changes, 33_000, 1 + drive as u32);
                for phase in [Phase::Idle, Phase::Sense, Phase::Charge] {
                    assert!(seen.contains(&phase), "{changes:?}: {seen:?}");
                }
                let drives = if drive == 1.0 {
                    Phase::Ramp
                } else if observer == 2.0 {
                    Phase::Run
                } else {
                    Phase::Park
                };
                assert!(seen.contains(&drives), "{changes:?}: {seen:?}");
            }
        }
    }
}

#[test]
fn at_the_ends_of_the_limits_nothing_overflows_either() {
    for observer in [0.0, 1.0, 2.0, 3.0] {
        for extreme in [
            &[(ParamId::LimPhaseA, 27.0), (ParamId::LimBusVMax, 60.0)][..],
            &[(ParamId::LimPhaseA, 0.5), (ParamId::StaRampA, 100.0)][..],
            &[
                (ParamId::StaRampRpmS, 1e6),
                (ParamId::StaParkAs, 0.01),
                (ParamId::MotPolePairs, 1.0),
            ][..],
        ] {
            let mut changes = extreme.to_vec();
            changes.push((ParamId::CtlObserver, observer));
            let seen = anything(&changes, 20_000, 7);
            assert!(
                seen.iter().any(|phase| phase.drives()),
                "{changes:?}: {seen:?}"
            );
        }
    }
}
