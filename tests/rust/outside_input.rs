//! Whatever comes from outside, on the throttle wire and by MAVLink, neither ends the program nor turns the
//! motor nor corrupts a parameter.

use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{Message, calculate_crc};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use siskin_control::drive::{Setpoint, Snapshot, State};
use siskin_control::esc::Esc;
use siskin_control::mavlink::{Receiver, Request};
use siskin_control::store::Kept;
use siskin_control::throttle::Throttle;
use siskin_emulator::device::Latest;
use siskin_emulator::rig::Bench;
use siskin_emulator::wire::Wire;
use siskin_params::{Board, ParamId, Params};

const MS_NS: u64 = 1_000_000;
const CAPTURE_HZ: u32 = 170_000_000;

/// Messages that the ESC obeys; it ignores the last one.
const MESSAGES: [u32; 11] = [0, 4, 20, 21, 23, 43, 75, 76, 110, SETUP_SIGNING, 290];
const SETUP_SIGNING: u32 = 256;
const COMMANDS: [u32; 2] = [75, 76];
const PARAM_SET: u32 = 23;
const COMMAND_OFFSET: usize = 28;
/// The commands that may turn the motor: ACTUATOR_TEST and DO_MOTOR_TEST.
const TESTS: [u16; 2] = [310, 209];
/// Other commands that it obeys: calibration, storage, restart, settings, arming, intervals and messages.
const OBEYED: [u16; 7] = [241, 245, 246, 311, 400, 511, 512];

/// An ESC with a wire and a link, at rest.
struct Desk {
    board: Board,
    esc: Esc,
    throttle: Throttle,
    stored: Kept,
    wire: Wire,
    receiver: Receiver,
    /// Reads what the ESC sends.
    listener: Receiver,
    snapshot: Snapshot,
    now_ns: u64,
    sent: u32,
}

impl Desk {
    fn new() -> Self {
        let bench = Bench::default();
        let board = bench.sensing.board(bench.delay);
        let (esc, throttle) = Self::esc(Params::default(), board);
        let config = esc.config().expect("it fits the bench");
        let snapshot = State::new(&config).snapshot();
        Self {
            board,
            esc,
            throttle,
            stored: Kept::default(),
            wire: Wire::detached(),
            receiver: Receiver::default(),
            listener: Receiver::default(),
            snapshot,
            now_ns: 0,
            sent: 0,
        }
    }

    /// Creates one at power-up. The stored parameters have been in force, so they fit the board.
    fn esc(params: Params, board: Board) -> (Esc, Throttle) {
        Esc::new(params, board, CAPTURE_HZ, 1_000_000).expect("the parameters fit the bench")
    }

    fn receive(&mut self, bytes: &[u8]) {
        let now_us = self.now_ns / 1000;
        let Self {
            receiver,
            esc,
            throttle,
            ..
        } = self;
        receiver.push(now_us, bytes, |frame| {
            esc.receive(throttle, now_us, frame);
        });
        self.check();
    }

    /// Lets a millisecond pass.
    fn pass(&mut self) {
        self.now_ns += MS_NS;
        while let Some((edge_ns, level)) = self.wire.next_edge(self.now_ns) {
            let ticks = u128::from(edge_ns) * u128::from(CAPTURE_HZ) / 1_000_000_000;
            self.throttle.edge(edge_ns / 1000, ticks as u32, level);
            self.check();
        }
        let now_us = self.now_ns / 1000;
        let (listener, sent) = (&mut self.listener, &mut self.sent);
        let throttle = &mut self.throttle;
        self.esc
            .poll(throttle, now_us, &self.snapshot, 25.0, &mut |frame| {
                *sent += 1;
                listener.push(now_us, frame, |_| {});
            });
        self.esc.test_itself(&self.snapshot, &mut Latest::at_rest());
        while let Some(request) = self.esc.take_request(&mut self.throttle) {
            self.answer(request);
        }
        self.check();
    }

    fn answer(&mut self, request: Request) {
        let result = match request {
            Request::ParamsChanged => return,
            Request::Save | Request::Keep => {
                self.stored = self.esc.kept();
                Ok(())
            }
            Request::Load => {
                self.esc.replace(&mut self.stored.clone());
                Ok(())
            }
            Request::FactoryReset => {
                self.stored = Kept::default();
                self.esc.replace(&mut Kept::default());
                Ok(())
            }
            Request::Reboot => {
                (self.esc, self.throttle) = Self::esc(self.stored.params.clone(), self.board);
                return;
            }
        };
        self.esc.storage_done(&mut self.throttle, result);
    }

    fn check(&self) {
        let setpoint = self.throttle.setpoint();
        assert!(
            matches!(
                setpoint,
                Setpoint::Stop | Setpoint::Zero | Setpoint::Tone(_)
            ),
            "{setpoint:?}"
        );
    }

    /// Asserts that every parameter is in range, and that every frame sent can be read.
    fn check_at_end(&self) {
        for id in ParamId::ALL {
            let (value, entry) = (self.esc.params().get(id), id.entry());
            assert!(entry.allows(value), "{} = {value}", entry.name);
        }
        assert_eq!(self.listener.counters().frames, self.sent);
    }
}

/// Returns a valid MAVLink 2 frame from a ground station.
fn frame(id: u32, payload: &[u8]) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let mut bytes = vec![
        0xFD,
        payload.len() as u8,
        0,
        0,
        0,
        255,
        190,
        low,
        middle,
        high,
    ];
    bytes.extend_from_slice(payload);
    let crc = calculate_crc(&bytes[1..], MavMessage::extra_crc(id));
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}

/// Draws a valid frame for this ESC or for another; half of those with a name use an existing one, half of
/// the values are in its range, and half of the commands are ones that it obeys.
fn any_frame() -> impl Strategy<Value = Vec<u8>> {
    let body = vec(any::<u8>(), 0..=255);
    let name = proptest::option::of(select(&ParamId::ALL[..]));
    let command = proptest::option::of((select(&OBEYED[..]), 0_u8..4));
    let share = proptest::option::of(0.0_f32..=1.0);
    (
        select(&MESSAGES[..]),
        body,
        name,
        share,
        command,
        any::<bool>(),
    )
        .prop_map(|(id, mut body, name, share, command, addressed)| {
            if let (PARAM_SET, Some(name), Some(share)) = (id, name, share) {
                let entry = name.entry();
                let value = entry.min + share * (entry.max - entry.min);
                body.resize(body.len().max(4), 0);
                body[..4].copy_from_slice(&value.round().clamp(entry.min, entry.max).to_le_bytes());
            }
            if let (true, Some((number, param1))) = (is_command(id), command) {
                body.resize(body.len().max(COMMAND_OFFSET + 2), 0);
                body[..4].copy_from_slice(&f32::from(param1).to_le_bytes());
                body[COMMAND_OFFSET..COMMAND_OFFSET + 2].copy_from_slice(&number.to_le_bytes());
            }
            spoken_to(id, body, name, addressed)
        })
}

fn is_command(id: u32) -> bool {
    COMMANDS.contains(&id)
}

/// Puts this ESC's address and a parameter name into a payload.
fn spoken_to(id: u32, mut body: Vec<u8>, name: Option<ParamId>, addressed: bool) -> Vec<u8> {
    // Offsets of the target and the name in each message.
    let (target, place) = match id {
        4 => (Some(12), None),
        20 => (Some(2), Some(4)),
        21 | 43 => (Some(0), None),
        23 => (Some(4), Some(6)),
        75 | 76 => (Some(30), None),
        110 => (Some(1), None),
        SETUP_SIGNING => (Some(8), None),
        _ => (None, None),
    };
    let mut put = |offset: usize, bytes: &[u8]| {
        let end = offset + bytes.len();
        body.resize(body.len().max(end), 0);
        body[offset..end].copy_from_slice(bytes);
    };
    if let (Some(target), true) = (target, addressed) {
        put(target, &[1, 1]);
    }
    if id == SETUP_SIGNING {
        // A valid time: it has 48 bits.
        put(5, &[0; 3]);
    }
    if let (Some(place), Some(id)) = (place, name) {
        let mut bytes = [0; 16];
        let name = id.entry().name.as_bytes();
        bytes[..name.len()].copy_from_slice(name);
        put(place, &bytes);
    }
    let command = body.get(COMMAND_OFFSET..COMMAND_OFFSET + 2);
    let tests = TESTS.map(u16::to_le_bytes);
    if is_command(id) && command.is_some_and(|command| tests.iter().any(|test| test == command)) {
        body[COMMAND_OFFSET] ^= 1;
    }
    frame(id, &body)
}

proptest! {
    // Always the same cases, so that a run can be repeated.
    #![proptest_config(ProptestConfig {
        cases: 200,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_datagram_on_the_wire(datagrams in vec(vec(any::<u8>(), 0..80), 1..60)) {
        let mut desk = Desk::new();
        for datagram in datagrams {
            let _ = desk.wire.play(desk.now_ns, &datagram);
            desk.pass();
        }
        desk.check_at_end();
    }

    #[test]
    fn any_levels_on_the_wire(
        levels in vec((any::<bool>(), vec(prop_oneof![0_u32..20_000, any::<u32>()], 1..200)), 1..20)
    ) {
        let mut desk = Desk::new();
        for (first, durations) in levels {
            let mut datagram = vec![255, u8::from(first)];
            for duration in durations {
                datagram.extend_from_slice(&duration.to_le_bytes());
            }
            let _ = desk.wire.play(desk.now_ns, &datagram);
            desk.pass();
        }
        desk.check_at_end();
    }

    #[test]
    fn any_throttle_that_was_never_zero(values in vec(48_u16..2048, 100..1_000)) {
        let mut desk = Desk::new();
        for value in values {
            let data = value << 1;
            let bits = data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF;
            let [low, high] = bits.to_le_bytes();
            prop_assert!(desk.wire.play(desk.now_ns, &[12, low, high]).is_ok());
            desk.pass();
        }
        desk.check_at_end();
    }

    #[test]
    fn any_bytes_on_a_link(bytes in vec(prop_oneof![Just(0xFD_u8), Just(0xFE_u8), any::<u8>()], 0..2_000)) {
        let mut desk = Desk::new();
        for piece in bytes.chunks(50) {
            desk.receive(piece);
            desk.pass();
        }
        desk.check_at_end();
    }

    #[test]
    fn any_sound_frame_but_a_test_of_the_motor(frames in vec(any_frame(), 1..100)) {
        let mut desk = Desk::new();
        for frame in frames {
            desk.receive(&frame);
            desk.pass();
        }
        desk.check_at_end();
    }
}
