//! Ten million bytes that are no frames for this ESC: random ones, and damaged frames.

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, PARAM_REQUEST_LIST_DATA};
use siskin_throttle::authority::Command;

use super::parameters::{read, set};
use super::signing::{KEY, SECOND, TODAY, keyed, setup, signed};
use super::*;

/// Bytes on each kind of link.
const BYTES: usize = 5_000_000;

/// SplitMix64: the same bytes on every machine and in every run.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ word >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        word ^ word >> 31
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn bytes(&mut self, most: usize) -> Vec<u8> {
        (0..self.below(most)).map(|_| self.next() as u8).collect()
    }

    /// Flips some bits, drops the rest, or inserts or removes a byte. Spares the last two: what
    /// follows could make the frame whole.
    fn mutate(&mut self, frame: &mut Vec<u8>) {
        let at = self.below(frame.len() - 2);
        match self.below(6) {
            0 => frame.truncate(at),
            1 => frame.insert(at, self.next() as u8),
            2 => drop(frame.remove(at)),
            turned => {
                for _ in 0..turned - 2 {
                    let bit = self.below(frame.len() * 8);
                    frame[bit / 8] ^= 1 << (bit % 8);
                }
            }
        }
    }
}

fn command(number: MavCmd, param1: f32) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        param1,
        param2: 1.0,
        param5: 1.0,
        command: number,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::DEFAULT
    }
}

fn list() -> PARAM_REQUEST_LIST_DATA {
    PARAM_REQUEST_LIST_DATA {
        target_system: 1,
        target_component: 1,
    }
}

/// Nothing has been changed, turned or requested.
fn check(bench: &mut Bench, before: &Params) {
    assert_eq!(&bench.params, before);
    assert_eq!(bench.authority.command(), Command::Stop);
    assert_eq!(bench.component.take_request(), None);
    assert_eq!(bench.component.take_act(), None);
}

/// Receives bytes that hold no frame. One candidate in 65536 has a valid check by chance and is
/// one: those are counted, and not obeyed.
fn receive_but_chance(bench: &mut Bench, bytes: &[u8]) -> usize {
    let mut found = 0;
    let mut ahead = bench.receiver.clone();
    ahead.push(bench.now_us, bytes, |_| found += 1);
    if found == 0 {
        bench.receive(bytes);
    } else {
        bench.receiver = ahead;
    }
    found
}

/// After a silence a request is answered on its last byte, and not before.
fn answers(bench: &mut Bench, request: &[u8]) {
    bench.run_ms(200);
    let (last, first) = request.split_last().expect("a frame");
    bench.receive(first);
    assert_eq!(values(&bench.poll()), []);
    bench.receive(&[*last]);
    assert_eq!(values(&bench.poll()).len(), 1);
}

#[test]
fn five_million_bytes_of_noise_and_broken_frames_change_nothing() {
    let frames = [
        encode(STATION, &set("MOT_POLE_PAIRS", 7.0), &[]),
        encode(STATION, &command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1), &[]),
        encode(STATION, &command(MavCmd::MAV_CMD_DO_MOTOR_TEST, 1.0), &[]),
        encode(
            STATION,
            &command(MavCmd::MAV_CMD_PREFLIGHT_STORAGE, 2.0),
            &[],
        ),
        encode(
            STATION,
            &command(MavCmd::MAV_CMD_CONFIGURE_ACTUATOR, 5.0),
            &[],
        ),
        encode(STATION, &setup(KEY, TODAY), &[]),
        encode(STATION, &list(), &[]),
    ];
    let request = encode(STATION, &read("MOT_POLE_PAIRS", -1), &[]);
    let mut bench = Bench::new();
    let before = bench.params.clone();
    let mut chance = Chance(1);
    let (mut received, mut by_chance) = (0, 0);
    while received < BYTES {
        for _ in 0..200 {
            let bytes = match chance.below(4) {
                0 => chance.bytes(600),
                // Start bytes are more frequent than in random data.
                1 => {
                    let pick = |byte: u8| [0xfd, 0xfe, 0, byte][usize::from(byte & 3)];
                    chance.bytes(600).into_iter().map(pick).collect()
                }
                _ => {
                    let mut frame = frames[chance.below(frames.len())].clone();
                    chance.mutate(&mut frame);
                    // A byte in front leaves it whole.
                    let whole = |whole: &Vec<u8>| frame.windows(whole.len()).any(|w| w == whole);
                    if frames.iter().any(whole) {
                        Vec::new()
                    } else {
                        frame
                    }
                }
            };
            received += bytes.len();
            by_chance += receive_but_chance(&mut bench, &bytes);
            bench.now_us += 1000;
            bench.poll();
            check(&mut bench, &before);
        }
        // What a false start holds back is searched after a silence.
        bench.now_us += 200_000;
        by_chance += receive_but_chance(&mut bench, &[]);
        answers(&mut bench, &request);
    }
    assert!(bench.component.kept_signing().is_none());
    // Of 600 000 candidates.
    let began = bench.receiver.counters().bad_checks;
    assert!(began > 500_000 && by_chance < 30, "{by_chance} of {began}");
}

/// Half of these frames have a valid check: only the signature can tell. The rest is noise,
/// unsigned frames, and replays.
#[test]
fn five_million_bytes_without_the_key_change_nothing() {
    let mut bench = keyed();
    let before = bench.params.clone();
    let at = |time: u64| {
        [
            signed(STATION, &set("MOT_POLE_PAIRS", 7.0), &KEY, 1, time),
            signed(
                STATION,
                &command(MavCmd::MAV_CMD_ACTUATOR_TEST, 0.1),
                &KEY,
                1,
                time + 1,
            ),
            signed(
                STATION,
                &command(MavCmd::MAV_CMD_PREFLIGHT_STORAGE, 2.0),
                &KEY,
                1,
                time + 2,
            ),
            signed(STATION, &setup([9; 32], time), &KEY, 1, time + 3),
        ]
    };
    let frames = at(TODAY + 10 * SECOND);
    let old = at(TODAY - 1000 * SECOND);
    let mut time = TODAY + SECOND;
    let mut chance = Chance(2);
    let mut received = 0;
    while received < BYTES {
        for _ in 0..200 {
            let bytes = match chance.below(4) {
                0 => chance.bytes(600),
                1 => old[chance.below(old.len())].clone(),
                kind => {
                    let mut frame = frames[chance.below(frames.len())].clone();
                    let len = frame.len();
                    // After the start, the length and the flags.
                    for _ in 0..=chance.below(3) {
                        let bit = 32 + chance.below((len - 4) * 8);
                        frame[bit / 8] ^= 1 << (bit % 8);
                    }
                    if kind == 2 {
                        let id = usize::from(frame[7]) | usize::from(frame[8]) << 8;
                        let check =
                            calculate_crc(&frame[1..len - 15], MavMessage::extra_crc(id as u32));
                        frame[len - 15..len - 13].copy_from_slice(&check.to_le_bytes());
                    }
                    if frames.contains(&frame) {
                        Vec::new()
                    } else {
                        frame
                    }
                }
            };
            received += bytes.len();
            bench.receive(&bytes);
            bench.now_us += 1000;
            bench.poll();
            check(&mut bench, &before);
        }
        time += SECOND / 2;
        answers(
            &mut bench,
            &signed(STATION, &read("MOT_POLE_PAIRS", -1), &KEY, 0, time),
        );
    }
    assert_eq!(
        bench.component.kept_signing().map(|kept| kept.key.0),
        Some(KEY)
    );
    // The key permits what these could not do.
    bench.receive(&signed(
        STATION,
        &set("MOT_POLE_PAIRS", 7.0),
        &KEY,
        0,
        time + SECOND,
    ));
    assert_eq!(bench.params.get(ParamId::MotPolePairs), 7.0);
}
