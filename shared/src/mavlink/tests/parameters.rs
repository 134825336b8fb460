use mavlink::dialects::ardupilotmega::{
    MavParamError, MavParamType, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA,
};
use mavlink::types::CharArray;
use siskin_params::TABLE;

use super::*;

fn name(text: &str) -> CharArray<16> {
    let mut bytes = [0; 16];
    bytes[..text.len()].copy_from_slice(text.as_bytes());
    CharArray::new(bytes)
}

pub(super) fn set(text: &str, value: f32) -> PARAM_SET_DATA {
    PARAM_SET_DATA {
        param_value: value,
        target_system: 1,
        target_component: 1,
        param_id: name(text),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    }
}

pub(super) fn read(text: &str, index: i16) -> PARAM_REQUEST_READ_DATA {
    PARAM_REQUEST_READ_DATA {
        param_index: index,
        target_system: 1,
        target_component: 1,
        param_id: name(text),
    }
}

/// Returns why this parameter's value was refused, as reported to the requester.
pub(super) fn refusal(sent: &[Sent], id: ParamId) -> MavParamError {
    let errors: Vec<_> = sent
        .iter()
        .filter_map(|sent| match &sent.message {
            MavMessage::PARAM_ERROR(error) => Some(error),
            _ => None,
        })
        .collect();
    let [error] = errors[..] else {
        panic!("{sent:?}");
    };
    assert_eq!((error.target_system, error.target_component), (255, 190));
    assert_eq!(error.param_id, name(id.entry().name));
    assert_eq!(error.param_index, -1, "the name counts");
    error.error
}

#[test]
fn a_list_is_whole_and_takes_half_the_link() {
    let mut bench = Bench::with(Params::default(), 11_520);
    bench.receive(&encode(
        STATION,
        &PARAM_REQUEST_LIST_DATA {
            target_system: 1,
            target_component: 1,
        },
        &[],
    ));
    let sent = bench.run_ms(1000);
    let mut got = values(&sent);
    assert_eq!(got.len(), TABLE.len());
    got.dedup_by_key(|(index, _)| *index);
    for (id, (index, value)) in ParamId::ALL.into_iter().zip(&got) {
        assert_eq!(*index, id as u16);
        assert_eq!(*value, bench.params.get(id));
    }
    let list: Vec<_> = sent
        .iter()
        .filter(|sent| matches!(sent.message, MavMessage::PARAM_VALUE(_)))
        .collect();
    let MavMessage::PARAM_VALUE(first) = &list[0].message else {
        unreachable!("filtered");
    };
    assert_eq!(usize::from(first.param_count), TABLE.len());
    assert_eq!(first.param_type, MavParamType::MAV_PARAM_TYPE_REAL32);
    // Within any 100 ms the list takes 576 bytes and the first burst of 480.
    let half = f64::from(bench.link_bytes_per_s) / 2.0;
    for window in list.windows(16) {
        let bytes: usize = window.iter().map(|sent| sent.len).sum();
        let seconds = (window[15].at_us - window[0].at_us) as f64 * 1e-6;
        assert!(bytes as f64 <= half * seconds + 480.0 + 37.0);
    }
}

#[test]
fn asking_again_does_not_hold_a_list_up() {
    let mut bench = Bench::with(Params::default(), 2000);
    let request = PARAM_REQUEST_LIST_DATA {
        target_system: 0,
        target_component: 0,
    };
    let mut seen = Vec::new();
    for _ in 0..40 {
        bench.receive(&encode(STATION, &request, &[]));
        seen.extend(values(&bench.run_ms(100)));
    }
    for id in ParamId::ALL {
        assert!(seen.iter().any(|(index, _)| *index == id as u16), "{id:?}");
    }
}

#[test]
fn a_value_is_read_by_name_and_by_index() {
    let mut bench = Bench::new();
    let flux = bench.params.get(ParamId::MotFluxMwb);
    let expected = [(ParamId::MotFluxMwb as u16, flux)];
    assert_eq!(values(&bench.ask(&read("MOT_FLUX_MWB", -1))), expected);
    let index = ParamId::MotFluxMwb as i16;
    assert_eq!(values(&bench.ask(&read("", index))), expected);
    // With an index the name does not count.
    assert_eq!(values(&bench.ask(&read("NO_SUCH", index))), expected);
}

#[test]
fn every_name_is_found_whatever_its_length() {
    let mut bench = Bench::new();
    for id in ParamId::ALL {
        let got = values(&bench.ask(&read(id.entry().name, -1)));
        assert_eq!(got, [(id as u16, bench.params.get(id))]);
    }
    // 16 characters without a zero: nothing of the next field is taken for the name, and no name
    // that it begins with is found.
    for sixteen in ["ABCDEFGHIJKLMNOP", "MOT_POLE_PAIRS__"] {
        for sent in [bench.ask(&read(sixteen, -1)), bench.ask(&set(sixteen, 7.0))] {
            let MavMessage::PARAM_ERROR(error) = &sent[0].message else {
                panic!("{sent:?}");
            };
            assert_eq!(sent.len(), 1);
            assert_eq!(error.param_id.to_str(), Ok(sixteen));
        }
    }
    assert!(ParamId::ALL.iter().any(|id| id.entry().name.len() == 16));
}

#[test]
fn what_does_not_exist_is_an_error_and_nothing_else() {
    let mut bench = Bench::new();
    let before = bench.params.clone();
    let unknown = [
        bench.ask(&read("NO_SUCH", -1)),
        bench.ask(&read("", 30_000)),
        bench.ask(&read("", -2)),
        bench.ask(&set("NO_SUCH", 1.0)),
    ];
    for sent in unknown {
        assert_eq!(sent.len(), 1);
        let MavMessage::PARAM_ERROR(error) = &sent[0].message else {
            panic!("{sent:?}");
        };
        assert_eq!(error.error, MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST);
        assert_eq!((error.target_system, error.target_component), (255, 190));
    }
    assert_eq!(bench.params, before);
    assert_eq!(bench.component.take_request(), None);
}

#[test]
fn a_set_value_is_taken_and_broadcast() {
    let mut bench = Bench::new();
    let sent = bench.ask(&set("MOT_POLE_PAIRS", 7.0));
    assert_eq!(sent.len(), 1);
    assert_eq!(values(&sent), [(ParamId::MotPolePairs as u16, 7.0)]);
    assert_eq!(bench.params.get(ParamId::MotPolePairs), 7.0);
    assert_eq!(bench.component.take_request(), Some(Request::ParamsChanged));
    assert_eq!(bench.component.take_request(), None);
}

#[test]
fn a_refused_value_is_answered_with_the_old_one_and_the_reason() {
    let mut bench = Bench::new();
    let before = bench.params.clone();
    let out_of_range = MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE;
    let read_only = MavParamError::MAV_PARAM_ERROR_READ_ONLY;
    let mismatch = MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH;
    let cases = [
        ("MOT_POLE_PAIRS", 6.5, "whole", out_of_range),
        ("LIM_PHASE_A", 1e9, "out of range", out_of_range),
        // The least value above its range: nothing is clamped.
        (
            "LIM_PHASE_A",
            200.0_f32.next_up(),
            "out of range",
            out_of_range,
        ),
        ("LIM_PHASE_A", -0.0, "out of range", out_of_range),
        ("LIM_PHASE_A", f32::NAN, "finite", out_of_range),
        ("LIM_PHASE_A", f32::INFINITY, "finite", out_of_range),
        ("LIM_PHASE_A", f32::NEG_INFINITY, "finite", out_of_range),
        ("MOT_KV", 400.0, "read-only", read_only),
        // 7 as an integer's bytes.
        ("PWM_DEADTIME_NS", f32::from_bits(7), "REAL32", mismatch),
    ];
    for (text, value, reason, error) in cases {
        let id = ParamId::find(text).expect("in the table");
        let sent = bench.ask(&set(text, value));
        assert_eq!(sent.len(), 3, "{sent:?}");
        assert_eq!(values(&sent), [(id as u16, before.get(id))]);
        assert_eq!(refusal(&sent, id), error, "{text} = {value}");
        let text = texts(&sent)[0];
        assert!(
            text.starts_with(id.entry().name) && text.contains(reason),
            "{text}"
        );
    }
    assert_eq!(bench.params, before);
    assert_eq!(bench.component.take_request(), None);
}

/// Another motor's parameters come one by one and in any order.
#[test]
fn a_value_that_makes_no_drive_with_the_others_is_taken_at_rest() {
    let mut bench = Bench::new();
    let sent = bench.ask(&set("LIM_PHASE_A", 1.5));
    assert_eq!(sent.len(), 1);
    assert_eq!(values(&sent), [(ParamId::LimPhaseA as u16, 1.5)]);
    assert_eq!(bench.params.get(ParamId::LimPhaseA), 1.5);
    assert_eq!(bench.component.take_request(), Some(Request::ParamsChanged));
}

/// What a board cannot have is refused at once, whatever the others are.
#[test]
fn a_value_beyond_the_board_is_refused_with_the_bound() {
    let mut bench = Bench::new();
    for (text, value, reason) in [
        (
            "LIM_PHASE_A",
            30.0,
            "its trip is beyond the current sensors' range",
        ),
        ("INP_PROTO", 7.0, "neither 0, 1 to 4, 10 to 13 nor 20 to 23"),
    ] {
        let id = ParamId::find(text).expect("in the table");
        let before = bench.params.get(id);
        let sent = bench.ask(&set(text, value));
        assert_eq!(values(&sent), [(id as u16, before)]);
        let out_of_range = MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE;
        assert_eq!(refusal(&sent, id), out_of_range);
        let whole: std::string::String = texts(&sent).concat();
        assert_eq!(whole, std::format!("{text} refused: {reason}"));
        assert_eq!(bench.component.take_request(), None);
    }
}

#[test]
fn what_would_have_the_motor_turn_and_is_refused_asks_why_it_is_off() {
    let mut bench = Bench::new();
    bench.params.set(ParamId::LimPhaseA, 1.5).expect("in range");
    for (command, params) in [
        (400, [1.0, 0.0]),
        (310, [0.1, 9.0]),
        (209, [1.0, 3.0]),
        (31_010, [3.0, 0.0]),
    ] {
        bench.command(command, &params);
        let act = bench.component.take_act();
        assert_eq!(act, Some(Act::SayWhyOff), "{command}");
    }
}

#[test]
fn a_value_that_makes_no_drive_is_refused_while_the_motor_turns() {
    let mut bench = Bench::new();
    bench.telemetry.phase = Phase::Run;
    bench.telemetry.rpm = 3000.0;
    let before = bench.params.clone();
    let sent = bench.ask(&set("LIM_PHASE_A", 1.5));
    assert_eq!(
        values(&sent),
        [(ParamId::LimPhaseA as u16, before.get(ParamId::LimPhaseA))]
    );
    assert_eq!(
        refusal(&sent, ParamId::LimPhaseA),
        MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    );
    assert_eq!(bench.params, before);
    // Longer than one STATUSTEXT: chunks with one id, the last one not full.
    let chunks: Vec<_> = sent
        .iter()
        .filter(|sent| matches!(sent.message, MavMessage::STATUSTEXT(_)))
        .collect();
    let whole: std::string::String = texts(&sent).concat();
    assert_eq!(
        whole,
        "LIM_PHASE_A refused: CTL_BW_CUR_HZ: too fast for so low a limit, lower it first"
    );
    assert_eq!(chunks.len(), 2);
    for (i, chunk) in chunks.iter().enumerate() {
        assert_eq!(
            u16::from_le_bytes([chunk.payload[51], chunk.payload[52]]),
            1
        );
        assert_eq!(usize::from(chunk.payload[53]), i);
    }
}

#[test]
fn the_motor_and_the_bridge_are_not_changed_while_it_turns() {
    let mut bench = Bench::new();
    bench.telemetry.phase = Phase::Run;
    bench.telemetry.rpm = 3000.0;
    for text in [
        "MOT_L_UH",
        "PWM_FREQ_HZ",
        "CTL_OBSERVER",
        "CTL_MODE",
        "INP_PROTO",
        "STA_RUN_RPM",
        "CTL_BW_CUR_HZ",
        "CTL_RPM_MIN",
        "CTL_RPM_MAX",
        "LIM_BUS_V_MAX",
    ] {
        let id = ParamId::find(text).expect("in the table");
        let before = bench.params.get(id);
        let other = if before == id.entry().max {
            id.entry().min
        } else {
            id.entry().max
        };
        let sent = bench.ask(&set(text, other));
        assert_eq!(values(&sent), [(id as u16, before)]);
        assert!(texts(&sent)[0].contains("the motor turns"));
        assert_eq!(
            refusal(&sent, id),
            MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED
        );
    }
    let sent = bench.ask(&set("CTL_BW_SPD_HZ", 5.0));
    assert_eq!(values(&sent), [(ParamId::CtlBwSpdHz as u16, 5.0)]);
    assert_eq!(texts(&sent).len(), 0);

    // A coasting shaft turns too.
    bench.telemetry.phase = Phase::Idle;
    bench.ask(&set("MOT_L_UH", 50.0));
    assert_ne!(bench.params.get(ParamId::MotLUh), 50.0);
    bench.telemetry.rpm = 0.0;
    bench.ask(&set("MOT_L_UH", 50.0));
    assert_eq!(bench.params.get(ParamId::MotLUh), 50.0);
}

#[test]
fn any_number_of_requests_at_once_is_answered() {
    let mut bench = Bench::new();
    let mut bytes = Vec::new();
    for index in 0..TABLE.len() as i16 {
        for _ in 0..3 {
            bytes.extend(encode(STATION, &read("", index), &[]));
        }
    }
    bench.receive(&bytes);
    assert_eq!(values(&bench.poll()).len(), TABLE.len());
}
