use mavlink::MAVLinkV1MessageRaw;
use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA};
use mavlink::types::CharArray;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;

/// Requests the first parameter.
fn request() -> PARAM_REQUEST_READ_DATA {
    PARAM_REQUEST_READ_DATA {
        param_index: 0,
        target_system: 1,
        target_component: 1,
        param_id: CharArray::new([0; 16]),
    }
}

fn request_bytes() -> Vec<u8> {
    encode(STATION, &request(), &[])
}

fn set_bytes() -> Vec<u8> {
    let message = PARAM_SET_DATA {
        param_value: 7.0,
        target_system: 1,
        target_component: 1,
        param_id: CharArray::new(*b"MOT_POLE_PAIRS\0\0"),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    };
    encode(STATION, &message, &[])
}

fn is_answered(bench: &mut Bench) -> bool {
    values(&bench.answers()).len() == 1
}

#[test]
fn frames_in_pieces_of_any_length_are_found() {
    let mut bytes = Vec::from([1, 2, 3]);
    for _ in 0..20 {
        bytes.extend(request_bytes());
    }
    for piece in 1..bytes.len() {
        let mut receiver = Receiver::new();
        let mut frames = 0;
        for part in bytes.chunks(piece) {
            receiver.push(0, part, |frame| {
                assert_eq!((frame.id, frame.from), (20, STATION));
                frames += 1;
            });
        }
        assert_eq!(frames, 20);
        assert_eq!(
            receiver.counters(),
            Counters {
                frames: 20,
                ..Counters::default()
            }
        );
    }
}

#[test]
fn both_versions_are_understood() {
    let mut raw = MAVLinkV1MessageRaw::new();
    let header = MavHeader {
        system_id: 255,
        component_id: 190,
        sequence: 9,
    };
    raw.serialize_message_data(header, &request());
    let mut bench = Bench::new();
    bench.receive(raw.raw_bytes());
    assert!(is_answered(&mut bench));
    bench.receive(&request_bytes());
    assert!(is_answered(&mut bench));
}

#[test]
fn a_false_start_holds_nothing_back_for_longer_than_the_silence() {
    // A header of HEARTBEAT that claims 255 bytes, and one of MAVLink 1.
    let long: &[u8] = &[0xfd, 255, 0, 0, 0, 1, 1, 0, 0, 0];
    for start in [long, &[0xfd], &[0xfe, 255, 0, 1, 1, 0]] {
        let mut bench = Bench::new();
        bench.receive(start);
        bench.receive(&request_bytes());
        let sent = bench.run_ms(120);
        assert_eq!(values(&sent).len(), 1, "{start:?}");
    }
}

#[test]
fn a_half_frame_is_given_up_and_the_next_is_whole() {
    let mut bench = Bench::new();
    let bytes = request_bytes();
    bench.receive(&bytes[..bytes.len() / 2]);
    bench.run_ms(150);
    assert_eq!(bench.receiver.counters().incomplete, 1);
    bench.receive(&bytes);
    assert!(is_answered(&mut bench));
}

#[test]
fn unknown_flags_and_signatures_are_not_obeyed() {
    let mut bench = Bench::new();
    let before = bench.params.clone();
    let plain = set_bytes();
    let payload = &plain[10..plain.len() - 2];
    let id = (PARAM_SET_DATA::ID, PARAM_SET_DATA::EXTRA_CRC);
    for flags in [0x02, 0x80] {
        bench.receive(&frame(STATION, id, flags, payload));
    }
    let mut both = frame(STATION, id, 0x03, payload);
    both.extend_from_slice(&[0; 13]);
    bench.receive(&both);
    let mut signed = frame(STATION, id, 0x01, payload);
    // The signature holds a whole frame's start and is not searched.
    signed.extend_from_slice(&[0xfd, 3, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0]);
    bench.receive(&signed);
    assert_eq!(bench.params, before);
    assert_eq!(bench.answers().len(), 0);
    let counters = bench.receiver.counters();
    assert_eq!(
        (counters.incompatible, counters.signed, counters.frames),
        (3, 1, 1)
    );

    bench.receive(&request_bytes());
    assert!(is_answered(&mut bench));
    bench.receive(&plain);
    assert_eq!(bench.params.get(ParamId::MotPolePairs), 7.0);
}

#[test]
fn a_frame_within_a_frame_is_data() {
    let mut bench = Bench::new();
    // ENCAPSULATED_DATA, which an ESC does not obey: nor must it obey the contents.
    let mut payload = Vec::from([0, 0]);
    payload.extend(set_bytes());
    bench.receive(&frame(STATION, (131, 223), 0, &payload));
    assert_eq!(bench.receiver.counters().frames, 1);
    assert_ne!(bench.params.get(ParamId::MotPolePairs), 7.0);
}

#[test]
fn a_frame_within_one_with_unknown_flags_is_data() {
    for flags in [0x02, 0x40, 0x03] {
        let mut bench = Bench::new();
        let mut payload = Vec::from([0, 0]);
        payload.extend(set_bytes());
        let mut bytes = frame(STATION, (131, 223), flags, &payload);
        if flags & 1 != 0 {
            bytes.extend_from_slice(&[0; 13]);
        }
        bench.receive(&bytes);
        bench.receive(&request_bytes());
        assert!(is_answered(&mut bench), "{flags:#x}");
        assert_ne!(bench.params.get(ParamId::MotPolePairs), 7.0);
        let counters = bench.receiver.counters();
        assert_eq!((counters.incompatible, counters.frames), (1, 1));

        // With a bad check it may be a start byte in noise: what it seems to hold is found.
        let mut bench = Bench::new();
        bytes[10] ^= 1;
        bench.receive(&bytes);
        bench.run_ms(110);
        assert_eq!(bench.params.get(ParamId::MotPolePairs), 7.0);
        assert_eq!(bench.receiver.counters().incompatible, 0);
    }
}

#[test]
fn one_wrong_bit_anywhere_is_noticed() {
    let plain = set_bytes();
    for bit in 0..plain.len() * 8 {
        let mut bench = Bench::new();
        let before = bench.params.clone();
        let mut bytes = plain.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        bench.receive(&bytes);
        bench.run_ms(110);
        // The sequence number and the two unused flags are checked too.
        assert_eq!(bench.params, before, "bit {bit}");
        bench.receive(&request_bytes());
        assert!(is_answered(&mut bench), "bit {bit}");
    }
}

proptest! {
    // One in 65536 heavily damaged frames passes its check by chance: the cases are always the same
    // ones, of which none does.
    #![proptest_config(ProptestConfig {
        cases: 1000,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn noise_changes_nothing_and_the_next_frame_is_answered(
        pieces in prop::collection::vec(
            prop_oneof![
                prop::collection::vec(any::<u8>(), 0..400),
                // Start bytes are more frequent than in random data.
                prop::collection::vec(prop_oneof![Just(0xfd_u8), Just(0xfe), Just(0), any::<u8>()], 0..400),
            ],
            0..6,
        ),
    ) {
        let mut bench = Bench::new();
        let before = bench.params.clone();
        for piece in &pieces {
            bench.receive(piece);
            bench.run_ms(1);
        }
        let by_chance = bench.receiver.counters().frames;
        bench.receive(&request_bytes());
        let mut answers = values(&bench.run_ms(110)).len();
        if answers == 0 && bench.receiver.counters().frames > by_chance {
            // Noise whose 16-bit check fits by chance has claimed the request's first bytes.
            bench.receive(&request_bytes());
            answers = values(&bench.run_ms(110)).len();
        }
        prop_assert_eq!(answers, 1);
        prop_assert_eq!(bench.params, before);
    }

    #[test]
    fn a_mutated_frame_is_not_obeyed(
        at in 0_usize..60,
        with in prop::collection::vec(any::<u8>(), 0..3),
        cut in 0_usize..3,
    ) {
        let plain = set_bytes();
        let mut bytes = plain.clone();
        let at = at % bytes.len();
        let end = bytes.len().min(at + cut);
        bytes.splice(at..end, with);
        if bytes.windows(plain.len()).any(|window| window == plain) {
            return Ok(());
        }
        let mut bench = Bench::new();
        let before = bench.params.clone();
        bench.receive(&bytes);
        bench.receive(&request_bytes());
        let sent = bench.run_ms(110);
        prop_assert_eq!(&bench.params, &before);
        prop_assert_eq!(values(&sent).len(), 1);
    }

    #[test]
    fn any_payload_of_any_message_is_survived(
        id in prop_oneof![
            Just(0_u32), Just(4), Just(20), Just(21), Just(43), Just(75), Just(76), Just(110),
        ],
        payload in prop::collection::vec(any::<u8>(), 1..=255),
    ) {
        let mut bench = Bench::new();
        let before = bench.params.clone();
        bench.receive(&frame(STATION, (id, MavMessage::extra_crc(id)), 0, &payload));
        bench.run_ms(3);
        prop_assert_eq!(bench.params, before);
    }
}
