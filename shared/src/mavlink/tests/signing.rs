use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, MavCmd, MavParamError, MavResult, SETUP_SIGNING_DATA,
};
use sha2::{Digest, Sha256};

use super::parameters::{read, refusal, set};
use super::*;

mod time;

pub(super) const KEY: [u8; 32] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25,
    26, 27, 28, 29, 30, 31,
];

/// 2026-11-22, in 10 µs since 2015.
pub(super) const TODAY: u64 = 37_542_528_000_000;
pub(super) const SECOND: u64 = 100_000;

/// MOT_POLE_PAIRS = 7 from the station over link 3, signed by pymavlink 2.4.50 with [`KEY`] at the
/// timestamp 0x0102030405.
const BY_PYMAVLINK: [u8; 48] = [
    0xfd, 0x17, 0x01, 0x00, 0x00, 0xff, 0xbe, 0x17, 0x00, 0x00, 0x00, 0x00, 0xe0, 0x40, 0x01, 0x01,
    0x4d, 0x4f, 0x54, 0x5f, 0x50, 0x4f, 0x4c, 0x45, 0x5f, 0x50, 0x41, 0x49, 0x52, 0x53, 0x00, 0x00,
    0x09, 0x55, 0x34, 0x03, 0x05, 0x04, 0x03, 0x02, 0x01, 0x00, 0x80, 0x0b, 0x1f, 0xd2, 0xb1, 0x3e,
];

pub(super) fn setup(key: [u8; 32], timestamp: u64) -> SETUP_SIGNING_DATA {
    SETUP_SIGNING_DATA {
        initial_timestamp: timestamp,
        target_system: 1,
        target_component: 1,
        secret_key: key,
    }
}

/// Returns a frame sent at this time, with its hash computed independently.
pub(super) fn signed<D: MessageData>(
    from: Address,
    data: &D,
    key: &[u8],
    link: u8,
    timestamp: u64,
) -> Vec<u8> {
    let plain = encode(from, data, &[]);
    let payload = &plain[10..plain.len() - 2];
    let mut bytes = frame(from, (D::ID, D::EXTRA_CRC), 1, payload);
    bytes.push(link);
    bytes.extend_from_slice(&timestamp.to_le_bytes()[..6]);
    let mut hasher = Sha256::new();
    hasher.update(key);
    hasher.update(&bytes);
    bytes.extend_from_slice(&hasher.finalize()[..6]);
    bytes
}

fn command(number: MavCmd, param1: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        param1,
        command: number,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::DEFAULT
    }
}

/// Returns a bench with a key as of today.
pub(super) fn keyed() -> Bench {
    let mut bench = Bench::new();
    bench.receive(&encode(STATION, &setup(KEY, TODAY), &[]));
    let answers = bench.answers();
    let wanted = ["Signing: changes need the key"];
    assert_eq!(texts(&answers), wanted);
    bench
}

/// Sends a value of CTL_BW_SPD_HZ signed like this; returns true if it was taken.
fn takes(bench: &mut Bench, value: f32, from: Address, link: u8, timestamp: u64) -> bool {
    bench.receive(&signed(
        from,
        &set("CTL_BW_SPD_HZ", value),
        &KEY,
        link,
        timestamp,
    ));
    bench.answers();
    bench.params.get(ParamId::CtlBwSpdHz) == value
}

#[test]
fn what_pymavlink_has_signed_is_obeyed() {
    let mut bench = Bench::new();
    bench.receive(&encode(STATION, &setup(KEY, 0x01_0203_0000), &[]));
    let mut spoilt = BY_PYMAVLINK;
    for at in [12, 35, 40, 47] {
        spoilt[at] ^= 1;
        bench.receive(&spoilt);
        assert_ne!(bench.params.get(ParamId::MotPolePairs), 7.0, "{at}");
        spoilt[at] ^= 1;
    }
    bench.receive(&BY_PYMAVLINK);
    assert_eq!(bench.params.get(ParamId::MotPolePairs), 7.0);
}

#[test]
fn without_a_signature_one_may_ask_and_change_nothing() {
    let mut bench = keyed();
    let before = bench.params.clone();
    let answers = bench.ask(&set("CTL_BW_SPD_HZ", 5.0));
    assert_eq!(values(&answers), [(ParamId::CtlBwSpdHz as u16, 7.9)]);
    assert_eq!(texts(&answers), ["CTL_BW_SPD_HZ refused: it is not signed"]);
    assert_eq!(
        refusal(&answers, ParamId::CtlBwSpdHz),
        MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED
    );
    for number in [
        MavCmd::MAV_CMD_PREFLIGHT_STORAGE,
        MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
        MavCmd::MAV_CMD_ACTUATOR_TEST,
        MavCmd::MAV_CMD_DO_MOTOR_TEST,
        MavCmd::MAV_CMD_CONFIGURE_ACTUATOR,
        MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION,
    ] {
        let answers = bench.ask(&command(number, 1.0));
        let MavMessage::COMMAND_ACK(ack) = &answers[0].message else {
            panic!("{:?}", answers[0]);
        };
        assert_eq!(ack.result, MavResult::MAV_RESULT_DENIED, "{number:?}");
        assert_eq!(bench.component.take_request(), None, "{number:?}");
        assert_eq!(bench.component.take_act(), None, "{number:?}");
    }
    // Nor may such a frame remove the key, or set another.
    bench.receive(&encode(STATION, &setup([0; 32], TODAY), &[]));
    bench.receive(&encode(STATION, &setup([9; 32], TODAY), &[]));
    assert_eq!(bench.answers().len(), 0);
    assert_eq!(
        bench.component.kept_signing().map(|kept| kept.key.0),
        Some(KEY)
    );

    assert_eq!(bench.params, before);
    let answers = bench.ask(&read("CTL_BW_SPD_HZ", -1));
    assert_eq!(values(&answers).len(), 1);
}

#[test]
fn another_key_opens_nothing() {
    let mut bench = keyed();
    let value = set("CTL_BW_SPD_HZ", 5.0);
    bench.receive(&signed(STATION, &value, &[9; 32], 0, TODAY + SECOND));
    assert_eq!(bench.answers().len(), 0);
    assert_ne!(bench.params.get(ParamId::CtlBwSpdHz), 5.0);
}

#[test]
fn without_a_key_nothing_that_is_signed_is_obeyed() {
    let mut bench = Bench::new();
    bench.receive(&BY_PYMAVLINK);
    assert_eq!(bench.answers().len(), 0);
    assert_ne!(bench.params.get(ParamId::MotPolePairs), 7.0);
}

#[test]
fn a_frame_is_obeyed_once_and_in_its_order() {
    let mut bench = keyed();
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY + 2 * SECOND));
    assert!(takes(&mut bench, 6.0, STATION, 1, TODAY + 3 * SECOND));
    assert!(
        !takes(&mut bench, 5.0, STATION, 1, TODAY + 2 * SECOND),
        "again"
    );
    assert!(
        !takes(&mut bench, 4.0, STATION, 1, TODAY + 3 * SECOND),
        "as old"
    );
    // Another link has its own order, within a minute.
    assert!(takes(&mut bench, 7.0, STATION, 2, TODAY + SECOND));
    let later = TODAY + 100 * SECOND;
    bench.now_us += 97_000_000;
    assert!(takes(&mut bench, 8.0, STATION, 1, later));
    assert!(!takes(&mut bench, 9.0, STATION, 3, later - 61 * SECOND));
    assert!(takes(&mut bench, 9.0, STATION, 3, later - 59 * SECOND));
}

#[test]
fn time_passes_for_a_stream_that_begins() {
    let mut bench = keyed();
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY));
    bench.run_ms(61_000);
    assert!(!takes(&mut bench, 6.0, STATION, 2, TODAY));
    assert!(takes(&mut bench, 6.0, STATION, 2, TODAY + 2 * SECOND));
}

#[test]
fn more_streams_than_can_be_followed_push_out_none_that_could_be_played_again() {
    let mut bench = keyed();
    for link in 0..8 {
        assert!(takes(
            &mut bench,
            5.0 + f32::from(link),
            STATION,
            link,
            TODAY + SECOND
        ));
    }
    assert!(!takes(&mut bench, 20.0, STATION, 8, TODAY + 2 * SECOND));
    // A minute later they are too old to start again, and make room.
    let later = TODAY + 62 * SECOND;
    bench.now_us += 61_000_000;
    assert!(takes(&mut bench, 20.0, STATION, 7, later));
    assert!(takes(&mut bench, 21.0, STATION, 8, later));
    assert!(!takes(&mut bench, 5.0, STATION, 0, TODAY + SECOND), "again");
}

#[test]
fn what_was_heard_before_a_loss_of_power_is_not_obeyed_after_it() {
    let mut bench = keyed();
    let heard = TODAY + 5 * SECOND;
    assert!(takes(&mut bench, 5.0, STATION, 1, heard));
    let kept = bench.component.kept_signing();

    let mut bench = Bench::new();
    bench.component.keep_signing(kept);
    for link in [1, 2] {
        assert!(!takes(&mut bench, 5.0, STATION, link, heard), "{link}");
        assert!(
            !takes(&mut bench, 5.0, STATION, link, heard - SECOND),
            "{link}"
        );
    }
    assert!(takes(&mut bench, 5.0, STATION, 1, heard + SECOND));
}

#[test]
fn who_has_the_key_may_change_it_and_take_it_away() {
    let mut bench = keyed();
    let other = [7; 32];
    bench.receive(&signed(
        STATION,
        &setup(other, TODAY),
        &KEY,
        0,
        TODAY + SECOND,
    ));
    assert_eq!(
        bench.component.kept_signing().map(|kept| kept.key.0),
        Some(other)
    );
    assert!(!takes(&mut bench, 5.0, STATION, 0, TODAY + 2 * SECOND));
    let off = setup([0; 32], TODAY);
    bench.receive(&signed(STATION, &off, &other, 0, TODAY + 3 * SECOND));
    assert_eq!(bench.component.kept_signing(), None);
    bench.ask(&set("CTL_BW_SPD_HZ", 6.0));
    assert_eq!(bench.params.get(ParamId::CtlBwSpdHz), 6.0);
}

#[test]
fn what_leaves_is_signed_by_times_that_grow_also_over_a_loss_of_power() {
    let mut bench = keyed();
    let mut last = 0;
    for start in 0..2 {
        for _ in 0..3 {
            let mut frames = Vec::new();
            bench.receive(&encode(STATION, &read("CTL_BW_SPD_HZ", -1), &[]));
            bench.poll_bytes(&mut frames);
            for bytes in frames {
                let (frame, signature) = bytes.split_at(bytes.len() - 13);
                assert_eq!((frame[2], signature[0]), (1, 0));
                let mut hasher = Sha256::new();
                hasher.update(KEY);
                hasher.update(&bytes[..bytes.len() - 6]);
                assert_eq!(hasher.finalize()[..6], signature[7..]);
                let mut timestamp = [0; 8];
                timestamp[..6].copy_from_slice(&signature[1..7]);
                let timestamp = u64::from_le_bytes(timestamp);
                assert!(timestamp > last, "{start}: {timestamp} {last}");
                last = timestamp;
            }
        }
        let kept = bench.component.kept_signing();
        bench = Bench::new();
        bench.component.keep_signing(kept);
    }
    assert!(last > TODAY);
}

#[test]
fn a_key_does_not_print() {
    let kept = keyed().component.kept_signing();
    let text = std::format!("{kept:?}");
    assert!(text.contains("Key(..)") && !text.contains("30"), "{text}");
}

/// So that a recording cannot be replayed after a restart.
#[test]
fn whatever_would_change_something_leaves_its_time_to_be_kept() {
    let mut bench = keyed();
    assert!(bench.component.take_changed(), "the key");
    let mut now = TODAY;
    let mut keeps = |number, param1, is_signed| {
        now += SECOND;
        let message = command(number, param1);
        let bytes = if is_signed {
            signed(STATION, &message, &KEY, 3, now)
        } else {
            encode(STATION, &message, &[])
        };
        bench.receive(&bytes);
        bench.answers();
        let newest = bench.component.kept_signing().expect("a key").newest;
        (
            bench.component.take_changed(),
            u64::from(newest) >= now >> 16,
        )
    };
    use MavCmd::*;
    assert_eq!(keeps(MAV_CMD_COMPONENT_ARM_DISARM, 0.0, true), (true, true));
    assert_eq!(keeps(MAV_CMD_PREFLIGHT_STORAGE, 0.0, true), (true, true));
    assert!(!keeps(MAV_CMD_REQUEST_MESSAGE, 0.0, true).0);
    // Refused commands wear the flash no more than unsigned ones.
    assert_eq!(
        keeps(MAV_CMD_COMPONENT_ARM_DISARM, 2.0, true),
        (false, true)
    );
    assert!(!keeps(MAV_CMD_COMPONENT_ARM_DISARM, 0.0, false).0);
    assert!(!keeps(MAV_CMD_SET_MESSAGE_INTERVAL, 0.0, false).0);
    now += SECOND;
    assert!(takes(&mut bench, 5.0, STATION, 3, now));
    assert!(bench.component.take_changed());
    assert!(!takes(&mut bench, -5.0, STATION, 3, now + SECOND));
    assert!(!bench.component.take_changed(), "refused");
}

#[test]
fn the_same_key_again_opens_nothing_that_was_heard() {
    let mut bench = keyed();
    bench.now_us += 100_000_000;
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY + 100 * SECOND));
    assert!(takes(&mut bench, 6.0, STATION, 1, TODAY + 101 * SECOND));
    let again = signed(STATION, &setup(KEY, TODAY), &KEY, 1, TODAY + 102 * SECOND);
    bench.receive(&again);
    bench.answers();
    assert!(!takes(&mut bench, 5.0, STATION, 1, TODAY + 100 * SECOND));
    assert!(
        !takes(&mut bench, 5.0, STATION, 2, TODAY + 2 * SECOND),
        "time"
    );
    assert!(takes(&mut bench, 7.0, STATION, 1, TODAY + 103 * SECOND));
}

#[test]
fn what_leaves_no_time_for_others_sets_no_key() {
    for timestamp in [(1 << 48) - 1, 1 << 48, u64::MAX] {
        let mut bench = Bench::new();
        bench.receive(&encode(STATION, &setup(KEY, timestamp), &[]));
        let answers = bench.answers();
        assert!(texts(&answers)[0].starts_with("Signing refused: "));
        assert_eq!(bench.component.kept_signing(), None);
    }
}

#[test]
fn what_others_say_to_others_leaves_room_for_a_station() {
    let mut bench = keyed();
    for component in 141..161 {
        let other = Address {
            system: 1,
            component,
        };
        let mut heard = set("CTL_BW_SPD_HZ", 5.0);
        heard.target_component = 200;
        bench.receive(&signed(other, &heard, &KEY, 0, TODAY + SECOND));
    }
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY + SECOND));
}

#[test]
fn a_key_may_be_set_by_a_frame_that_it_signs() {
    let mut bench = Bench::new();
    bench.receive(&signed(STATION, &setup(KEY, TODAY), &KEY, 0, TODAY));
    bench.answers();
    assert_eq!(
        bench.component.kept_signing().map(|kept| kept.key.0),
        Some(KEY)
    );
}

const YEAR: u64 = 365 * 86_400 * SECOND;
const LAST: u64 = (1 << 48) - 1;

/// Sets another key, or none, by a frame signed with the previous one.
fn give(bench: &mut Bench, key: [u8; 32], by: &[u8], timestamp: u64) {
    let message = setup(key, timestamp);
    if by == [0; 32] {
        bench.receive(&encode(STATION, &message, &[]));
    } else {
        bench.receive(&signed(STATION, &message, by, 1, timestamp));
    }
    bench.answers();
    let kept = bench.component.kept_signing();
    assert_eq!(kept.map_or([0; 32], |kept| kept.key.0), key);
}

#[test]
fn a_key_that_comes_back_opens_nothing_that_was_heard() {
    for other in [[7; 32], [0; 32]] {
        // Whoever sets it states the time, or that it is unknown.
        for returns in [TODAY + 12 * SECOND, TODAY] {
            let mut bench = keyed();
            for (value, link, after) in [(5.0, 1, 5), (6.0, 2, 6), (7.0, 1, 7)] {
                let at = TODAY + after * SECOND;
                assert!(takes(&mut bench, value, STATION, link, at));
            }
            bench.now_us += 10_000_000;
            give(&mut bench, other, &KEY, TODAY + 10 * SECOND);
            if other == [0; 32] {
                give(&mut bench, KEY, &other, returns);
            } else {
                give(&mut bench, KEY, &other, TODAY + 12 * SECOND);
            }
            for (value, link, after) in [(5.0, 1, 5), (6.0, 2, 6), (7.0, 1, 7)] {
                let at = TODAY + after * SECOND;
                bench
                    .params
                    .set(ParamId::CtlBwSpdHz, 3.0)
                    .expect("in range");
                assert!(!takes(&mut bench, value, STATION, link, at), "{after}");
            }
            assert!(takes(&mut bench, 8.0, STATION, 2, TODAY + 13 * SECOND));
        }
    }
}

/// Even across a loss of power without a key.
#[test]
fn what_was_signed_before_a_key_was_set_is_not_obeyed() {
    let mut bench = Bench::new();
    bench.receive(&encode(STATION, &setup(KEY, TODAY), &[]));
    bench.answers();
    assert!(!takes(&mut bench, 5.0, STATION, 1, TODAY - SECOND));
    assert!(takes(&mut bench, 5.0, STATION, 1, TODAY));
}
