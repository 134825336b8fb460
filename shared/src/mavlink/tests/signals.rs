//! The control's signals, streamed for tuning.

use std::string::String;

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};

use super::parameters::set;
use super::streams::{ESC_INFO, ESC_STATUS, HEARTBEAT};
use super::*;

/// Returns names, values and times of the signals among what was sent.
fn signals(sent: &[Sent]) -> Vec<(String, f32, u32)> {
    let named = sent.iter().filter_map(|sent| match &sent.message {
        MavMessage::NAMED_VALUE_FLOAT(value) => {
            let name = value.name.to_str().expect("ASCII");
            Some((name.into(), value.value, value.time_boot_ms))
        }
        _ => None,
    });
    named.filter(|(name, ..)| name != "bad_frames").collect()
}

#[test]
fn signals_are_streamed_by_choice_and_those_of_one_moment_together() {
    let mut bench = Bench::new();
    for (i, value) in bench.telemetry.signals.iter_mut().enumerate() {
        *value = i as f32 + 0.5;
    }
    assert_eq!(signals(&bench.run_ms(1000)), [], "none by default");
    // i_d, duty and bus_a.
    for (bits, chosen) in [
        (0b1_0100_0100, &[2, 6, 8][..]),
        (511, &[0, 1, 2, 3, 4, 5, 6, 7, 8]),
    ] {
        bench.ask(&set("TEL_SIGNALS", bits as f32));
        let told = signals(&bench.run_ms(1000));
        let samples: Vec<_> = told.chunks(chosen.len()).collect();
        assert!(samples.len().abs_diff(50) <= 1, "{}", samples.len());
        for (i, sample) in samples.iter().enumerate() {
            for ((name, value, time_ms), signal) in sample.iter().zip(chosen) {
                assert_eq!(name, SIGNALS[*signal]);
                assert_eq!(*value, *signal as f32 + 0.5);
                assert_eq!(*time_ms, samples[0][0].2 + 20 * i as u32);
            }
        }
    }
    bench.ask(&set("TEL_SIG_HZ", 200.0));
    let told = signals(&bench.run_ms(1000)).len();
    assert!(told.abs_diff(200 * 9) <= 9, "{told}");
    // This message's interval is the wire's; parameters set that of the signals.
    bench.receive(&encode(STATION, &interval(251, -1.0), &[]));
    assert!(signals(&bench.run_ms(1000)).len() > 1700);
    bench.ask(&set("TEL_SIGNALS", 0.0));
    assert_eq!(signals(&bench.run_ms(1000)), []);
}

fn interval(message: u32, us: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        param1: message as f32,
        param2: us,
        command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::DEFAULT
    }
}

#[test]
fn names_of_signals_fit_their_message() {
    for (i, name) in SIGNALS.iter().enumerate() {
        assert!(name.is_ascii() && (1..=10).contains(&name.len()), "{name}");
        assert!(!SIGNALS[i + 1..].contains(name) && *name != "bad_frames");
    }
    let entry = ParamId::TelSignals.entry();
    assert_eq!(entry.max, ((1 << SIGNALS.len()) - 1) as f32);
    let text = ParamId::TelSignals.text().description;
    for (i, name) in SIGNALS.iter().enumerate() {
        assert!(text.contains(&std::format!("{} {name}", 1 << i)), "{name}");
    }
}

/// All signals at the highest rate are 28 times what half the link carries, signed 41 times. Names shorter than the
/// longest leave some of their share unused.
#[test]
fn signals_take_their_turn_on_a_slow_link() {
    for key in [None, Some(Key([7; 32]))] {
        let mut params = Params::default();
        for (id, value) in [(ParamId::TelSignals, 2047.0), (ParamId::TelSigHz, 500.0)] {
            params.set(id, value).expect("in range");
        }
        let mut bench = Bench::with(params, 11_520);
        bench
            .component
            .keep_signing(key.map(|key| KeptSigning { key, newest: 0 }));
        let mut frames = Vec::new();
        for _ in 0..10_000 {
            bench.now_us += 1000;
            bench.poll_bytes(&mut frames);
        }
        let bytes: usize = frames.iter().map(Vec::len).sum();
        assert!(
            (40_000..=57_600 + 480 + 34 * 10).contains(&bytes),
            "{bytes} bytes in 10 s"
        );
        let count = |id: u32| {
            frames
                .iter()
                .filter(|f| f[7..10] == id.to_le_bytes()[..3])
                .count()
        };
        assert_eq!(count(HEARTBEAT), 10);
        assert!((9..=10).contains(&count(ESC_INFO)), "{}", count(ESC_INFO));
        // Each stream gets as many turns as another that is always due.
        assert!(count(ESC_STATUS) > 60, "{}", count(ESC_STATUS));
        assert!(count(251) > 9 * 100, "{}", count(251));
    }
}
