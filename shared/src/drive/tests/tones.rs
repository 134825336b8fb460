//! Tones: when one plays, and what ends it.

use siskin_units::Speed;

use super::*;
use crate::drive::config::tone::PITCH_MAX;
use crate::drive::schedule::CYCLE;
use crate::drive::transitions::Why;

/// Returns a pitch of 1 kHz.
fn tone(bench: &Bench) -> Setpoint {
    Setpoint::Tone(Speed::from_num(1000.0 * bench.config.scale.period_s))
}

/// Returns a bench whose rotor is known to stand, with a tone playing.
fn playing(changes: &[(ParamId, f32)]) -> Bench {
    let mut bench = Bench::new(changes);
    let tone = tone(&bench);
    bench.until(Phase::Tone, tone);
    bench
}

/// Both drives, at a speed that gives six-step enough periods per sextant.
const DRIVES: [[(ParamId, f32); 2]; 2] = [
    [(ParamId::CtlDrive, 0.0), (ParamId::CtlRpmMax, 4500.0)],
    [(ParamId::CtlDrive, 1.0), (ParamId::CtlRpmMax, 4500.0)],
];

#[test]
fn a_tone_begins_with_the_zeros_of_the_currents_and_charged_drivers() {
    for drive in DRIVES {
        let mut bench = Bench::new(&drive);
        let tone = tone(&bench);
        let phases = bench.phases(1000, tone);
        let order: Vec<_> = phases.iter().map(|(phase, _)| *phase).collect();
        let wanted = [Phase::Idle, Phase::Sense, Phase::Charge, Phase::Tone];
        assert_eq!(order, wanted);
        let first_ms = |phase| {
            let before = phases.iter().take_while(|(p, _)| *p != phase);
            before.map(|(_, periods)| periods).sum::<u32>() / 24
        };
        assert!(first_ms(Phase::Sense) < 10, "{phases:?}");
        assert!(first_ms(Phase::Tone) < 16, "{phases:?}");
    }
}

#[test]
fn a_tone_of_no_current_is_silent() {
    for drive in DRIVES {
        let [which, speed] = drive;
        let silent = [which, speed, (ParamId::MotToneA, 0.0)];
        let mut bench = Bench::new(&silent);
        let tone = tone(&bench);
        for _ in 0..5000 {
            assert_eq!(bench.quiet(1, tone), Bridge::Off);
        }
        // Nor does one that is silenced while playing.
        let mut bench = playing(&drive);
        bench.config = config_with(&silent);
        assert_eq!(bench.quiet(1, tone), Bridge::Off);
    }
}

#[test]
fn a_rotor_that_turns_or_cannot_be_seen_hears_no_tone() {
    for drive in DRIVES {
        for rpm in [-2000.0, 200.0, 5000.0] {
            let mut bench = Bench::new(&drive);
            let tone = tone(&bench);
            for k in 0..5000 {
                let turns = f64::from(k) * rpm * 12.0 / 60.0 / 24_000.0;
                let sample = Sample {
                    terminals: terminals(turns, rpm),
                    ..sample([0.0; 3], 24.0)
                };
                assert_eq!(bench.run(1, sample, tone), Bridge::Off, "{rpm}");
            }
        }
        let mut bench = Bench::new(&drive);
        let tone = tone(&bench);
        let stuck = Sample {
            terminals: [AdcCounts::from_num(800); 3],
            ..sample([0.0; 3], 24.0)
        };
        for _ in 0..5000 {
            assert_eq!(bench.run(1, stuck, tone), Bridge::Off);
        }
    }
}

#[test]
fn a_rotor_that_begins_to_turn_while_the_zeros_are_measured_hears_none() {
    let mut bench = Bench::new(&[]);
    let tone = tone(&bench);
    bench.until(Phase::Sense, tone);
    for k in 0..3000 {
        let turns = f64::from(k) * 3000.0 * 12.0 / 60.0 / 24_000.0;
        let sample = Sample {
            terminals: terminals(turns, 3000.0),
            ..sample([0.0; 3], 24.0)
        };
        let bridge = bench.run(1, sample, tone);
        assert!(!matches!(bridge, Bridge::Duty(_)));
    }
    assert_eq!(bench.phase(), Phase::Idle);
}

#[test]
fn a_fault_ends_a_tone_and_holds_the_next_one_off() {
    for drive in DRIVES {
        let mut bench = playing(&drive);
        let tone = tone(&bench);
        // The trip is at 1.4 times 20 A.
        let above = sample([28.1, -14.1, -14.0], 24.0);
        assert_eq!(bench.run(2, above, tone), Bridge::Off);
        assert!(bench.faults().contains(Fault::OverCurrent));
        for _ in 0..20_000 {
            assert_eq!(bench.quiet(1, tone), Bridge::Off);
        }
        assert!(bench.faults().contains(Fault::OverCurrent));
        bench.quiet(7300, Setpoint::Zero);
        bench.until(Phase::Tone, tone);
    }
}

#[test]
fn what_a_tone_found_is_what_it_leaves() {
    for drive in DRIVES {
        let mut bench = playing(&drive);
        assert_eq!(bench.quiet(1, Setpoint::Zero), Bridge::Off);
        assert_eq!(bench.phase(), Phase::Idle);

        bench.state.change(&bench.config, Why::Shorted);
        bench.quiet(2000, Setpoint::Stop);
        let tone = tone(&bench);
        bench.until(Phase::Tone, tone);
        for _ in 0..100 {
            assert_eq!(bench.quiet(1, Setpoint::Stop), Bridge::Brake);
        }
    }
}

/// Brakes with a tone requested until it reaches a phase.
fn braked_until(drive: &[(ParamId, f32)], phase: Phase) -> Bench {
    let mut bench = Bench::new(drive);
    bench.state.change(&bench.config, Why::Shorted);
    bench.quiet(2000, Setpoint::Stop);
    let tone = tone(&bench);
    bench.until(phase, tone);
    bench
}

#[test]
fn a_tone_that_never_came_to_play_leaves_the_brake_too() {
    for drive in DRIVES {
        for phase in [Phase::Sense, Phase::Charge] {
            for (periods, setpoint) in [(0, Setpoint::Stop), (5, Setpoint::Zero)] {
                let mut bench = braked_until(&drive, phase);
                let tone = tone(&bench);
                bench.quiet(periods, tone);
                assert_eq!(bench.phase(), phase);
                let most = bench.periods(0.02);
                assert!(bench.until(Phase::Brake, setpoint) < most);
                assert_eq!(bench.quiet(2000, setpoint), Bridge::Brake);
            }
        }
        // It does not delay throttle, after which the previous state is forgotten.
        let mut bench = braked_until(&drive, Phase::Sense);
        let turn = bench.turn();
        bench.quiet(10, Setpoint::Stop);
        bench.quiet(10, turn);
        assert_eq!(bench.quiet(5000, Setpoint::Stop), Bridge::Off);
        assert_eq!(bench.phase(), Phase::Idle);
    }
}

#[test]
fn a_rotor_that_is_seen_to_turn_is_not_braked_until_it_stands() {
    for drive in DRIVES {
        let mut bench = braked_until(&drive, Phase::Sense);
        let tone = tone(&bench);
        for k in 0..3000 {
            let turns = f64::from(k) * 3000.0 * 12.0 / 60.0 / 24_000.0;
            let sample = Sample {
                terminals: terminals(turns, 3000.0),
                ..sample([0.0; 3], 24.0)
            };
            let setpoint = if k < 1500 { tone } else { Setpoint::Stop };
            let bridge = bench.run(1, sample, setpoint);
            assert!(matches!(bridge, Bridge::Off | Bridge::Charge(_)), "{k}");
        }
        bench.until(Phase::Brake, Setpoint::Stop);
    }
}

#[test]
fn a_tone_refused_to_a_rotor_that_is_braked_does_not_hurry_what_follows_it() {
    let mut bench = Bench::new(&[]);
    bench.state.change(&bench.config, Why::Shorted);
    bench.quiet(10, Setpoint::Stop);
    let tone = tone(&bench);
    for period in 0..100 {
        bench.state.shared.seen.speed = bench.config.slow;
        let before = u32::from(bench.state.foc.loops.slot);
        assert_eq!(bench.quiet(1, tone), Bridge::Brake);
        let slot = u32::from(bench.state.foc.loops.slot);
        assert_eq!(slot, (before + 1) % CYCLE, "{period}");
    }
}

#[test]
fn a_pause_keeps_the_drivers_charged() {
    let mut bench = playing(&[]);
    let pause = Setpoint::Tone(Speed::ZERO);
    assert_eq!(bench.quiet(500, pause), Bridge::Brake);
    let tone = tone(&bench);
    assert!(matches!(bench.quiet(1, tone), Bridge::Duty(_)));
    assert_eq!(bench.phase(), Phase::Tone);
}

#[test]
fn throttle_in_a_tone_starts_the_motor_as_from_rest() {
    for drive in DRIVES {
        let mut rested = Bench::new(&drive);
        let turn = rested.turn();
        rested.quiet(1000, Setpoint::Stop);
        let begins = rested.beginning();
        let usual = rested.until(begins, turn);
        let mut bench = playing(&drive);
        let took = bench.until(begins, turn);
        assert!(took <= usual + 1, "{took} of {usual}");
        // Also before it has begun.
        let mut bench = Bench::new(&drive);
        let tone = tone(&bench);
        bench.until(Phase::Sense, tone);
        assert!(bench.until(begins, turn) <= usual);
    }
}

/// Returns the vector of the duties, V: along phase a and across it.
fn vector(bridge: Bridge) -> (f64, f64) {
    let Bridge::Duty(duties) = bridge else {
        panic!("{bridge:?}");
    };
    let [a, b, c] = duties.map(|duty| 24.0 * duty.to_num::<f64>());
    ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

#[test]
fn with_sine_modulation_a_tone_has_the_same_voltage() {
    let tone_a = (ParamId::MotToneA, 6.0);
    let benches =
        [0.0, 1.0].map(|modulation| playing(&[tone_a, (ParamId::CtlModulation, modulation)]));
    let [mut space_vector, mut sine] = benches;
    let tone = tone(&sine);
    let (mut most, mut differs) = (0.0_f64, false);
    for period in 0..5000 {
        let bridges = [space_vector.quiet(1, tone), sine.quiet(1, tone)];
        let [wanted, seen] = bridges.map(vector);
        // Duties are rounded to 2^-16 of 24 V.
        let error = (seen.0 - wanted.0).abs().max(seen.1.abs());
        assert!(error < 1e-3, "{period}: {seen:?}, {wanted:?}");
        most = most.max(seen.0.abs());
        differs |= bridges[0] != bridges[1];
    }
    assert!(most > 1.0 && differs, "{most}");
}

#[test]
fn the_voltage_is_along_one_axis_as_often_one_way_as_the_other_and_bounded() {
    for (pitch_hz, tone_a) in [(600.0, 1.5), (3000.0, 1.5), (2000.0, 6.0)] {
        let mut bench = Bench::new(&[(ParamId::MotToneA, tone_a)]);
        let tone = Setpoint::Tone(Speed::from_num(pitch_hz / 24_000.0));
        bench.until(Phase::Tone, tone);
        // The sensors show nothing, so the amplitude grows to its bound.
        let (mut most, mut sum) = (0.0_f64, 0.0);
        let periods = 24_000;
        for _ in 0..periods {
            let (along, across) = vector(bench.quiet(1, tone));
            assert!(across.abs() < 1e-4, "{across}");
            most = most.max(along.abs());
            sum += along;
        }
        // Twice what 0.75 of the bound needs, plus the dead time's 4/3·0.5 µs of 41.7 µs.
        let needed = 0.108_f64.hypot(TAU * pitch_hz * 30.6e-6) * 0.75 * f64::from(tone_a);
        let bound = 2.0 * needed + 24.0 * 0.016;
        assert!(most < bound * 1.001 && most > bound * 0.9, "{most} {bound}");
        assert!((sum / f64::from(periods)).abs() < 1e-3 * bound, "{sum}");
    }
}

#[test]
fn the_bound_is_never_above_half_of_the_limit() {
    let peak = |changes: &[(ParamId, f32)]| {
        let config = config_with(changes);
        config.scale.amperes(config.tone.expect("audible").peak)
    };
    let loud = (ParamId::MotToneA, 10.0);
    assert!((peak(&[loud]) - 7.5).abs() < 0.01);
    assert!((peak(&[loud, (ParamId::LimPhaseA, 4.0)]) - 1.5).abs() < 0.01);
}

#[test]
fn a_tone_above_the_highest_is_the_highest() {
    let mut bench = playing(&[]);
    let cycle = |bench: &mut Bench, pitch| {
        let voltages = (0..800).map(|_| vector(bench.quiet(1, Setpoint::Tone(pitch))).0);
        voltages.skip(400).collect::<Vec<_>>()
    };
    let wanted = cycle(&mut bench, PITCH_MAX);
    let seen = cycle(&mut bench, Speed::from_num(0.4));
    let changes = |volts: &[f64]| volts.windows(2).filter(|w| w[0] * w[1] < 0.0).count();
    assert_eq!(changes(&seen), changes(&wanted));
}
