//! The image on its board, with a flight controller on the throttle wire and a ground station on the serial
//! port.
//!
//! `SISKIN_IMAGE` names the image; by default it is where the test command puts it. Run with `--release`: a
//! simulated second then takes about one, and twenty without.

mod made;

use std::collections::hash_map::DefaultHasher;
use std::env;
use std::hash::Hash;

use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, MavCmd, MavParamType,
    PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA, STATUSTEXT_DATA,
};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, MessageData};
use siskin_control::mavlink::{Address, Receiver};
use siskin_emulator::device::Start;
use siskin_emulator::machine::{Machine, Onlooker};
use siskin_emulator::plant::Gate;
use siskin_emulator::rig::{Period, Rig};
use siskin_emulator::surroundings::{Motion, Passage};
use siskin_params::ParamId;
use siskin_throttle::dshot::{Frame as Dshot, check_mask};
use siskin_vboard::chip::Cause;
use siskin_vboard::image::Image;
use siskin_vboard::machine::VirtualBoard;
use siskin_vboard::processor::{Register, Surroundings, Width};
use siskin_vboard::time::{CLOCK_HZ, Cycles, ns};
use siskin_vboard::world::World;

use made::{is_made, made, of_workspace};

pub(crate) const US: u64 = 1_000;
pub(crate) const MS: u64 = 1_000_000;

/// A PWM period at its 24 kHz.
pub(crate) const PWM_PERIOD: Cycles = CLOCK_HZ / 24_000;

/// Protocols of the throttle wire (`emulator/README.md`): a pulse of 1 to 2 ms, and bidirectional DShot300,
/// 600 and 1200.
const PULSE: u8 = 1;
pub(crate) const BIDIRECTIONAL_300: u8 = 21;
pub(crate) const BIDIRECTIONAL_600: u8 = 22;
pub(crate) const BIDIRECTIONAL_1200: u8 = 23;

/// Returns the image to test. Relative paths begin at the workspace.
pub(crate) fn image() -> Image {
    const BOARD: &str = "b-g431b-esc1";
    let given = env::var_os("SISKIN_IMAGE");
    let path = given.map_or_else(|| made(BOARD, "elf"), of_workspace);
    is_made(BOARD, &path);
    Image::read(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the image with all of the papers, which does not follow R and flux: the configuration stays the one that
/// the parameters make.
pub(crate) fn papers() -> Image {
    const NAME: &str = "b-g431b-esc1-papers";
    let path = made(NAME, "elf");
    is_made("b-g431b-esc1 --parts papers", &path);
    Image::read(&path).unwrap_or_else(|error| panic!("{error}"))
}

/// What the flight controller sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Throttle {
    /// Nothing.
    Silent,
    /// Bidirectional DShot, at 1.96 kHz so that frames come at all phases of the PWM: 0 is stop, 48 to 2047
    /// are throttle.
    Dshot(u16),
    /// Pulses of this width, ns, at 400 Hz.
    Pulse(u32),
}

impl Throttle {
    fn period_ns(self) -> u64 {
        match self {
            Self::Silent | Self::Dshot(_) => 510 * US,
            Self::Pulse(_) => 2_500 * US,
        }
    }

    /// Returns the frame to send, DShot with this protocol.
    fn datagram(self, protocol: u8) -> Option<Vec<u8>> {
        Some(match self {
            Self::Silent => return None,
            Self::Dshot(value) => {
                let frame = Dshot {
                    value,
                    telemetry: false,
                };
                let bits = frame.to_bits() ^ check_mask(true);
                let [low, high] = bits.to_le_bytes();
                vec![protocol, low, high]
            }
            Self::Pulse(width_ns) => [&[PULSE], width_ns.to_le_bytes().as_slice()].concat(),
        })
    }
}

/// A reply on the throttle wire.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reply {
    /// Its levels.
    pub(crate) bits: u32,
    /// From the frame's end to its first edge, ns.
    pub(crate) after_ns: u32,
}

/// What is seen and heard of the ESC.
pub(crate) struct Heard {
    /// The sender: the ESC.
    pub(crate) from: Address,
    /// The MAVLink frames: time of completion, id and payload.
    pub(crate) frames: Vec<(u64, u32, Vec<u8>)>,
    pub(crate) replies: Vec<Reply>,
    /// Hash of all edges of gates and wire, frames and replies so far.
    pub(crate) hash: DefaultHasher,
    /// The throttle wire's levels, the gates and the motor, if a test looks at them.
    pub(crate) scope: Option<Scope>,
}

/// What a probe on the board has seen.
#[derive(Debug, Default)]
pub(crate) struct Scope {
    /// The throttle wire's edges: time, ns, and the level after each.
    pub(crate) line: Vec<(u64, bool)>,
    /// Gate changes: time, ns, the leg, and its gates from then on.
    pub(crate) gates: Vec<(u64, usize, Gate)>,
    /// The motor and the supply at the start of each PWM period: time, ns.
    pub(crate) motor: Vec<(u64, Motion)>,
}

impl Default for Heard {
    fn default() -> Self {
        Self {
            from: Address {
                system: 0,
                component: 0,
            },
            frames: Vec::new(),
            replies: Vec::new(),
            hash: DefaultHasher::new(),
            scope: None,
        }
    }
}

impl Heard {
    /// Returns the messages of a kind, with their times.
    pub(crate) fn messages<D: MessageData>(&self) -> Vec<(u64, D)> {
        let frames = self.frames.iter().filter(|(_, id, _)| *id == D::ID);
        let read = |payload: &[u8]| D::deser(MavlinkVersion::V2, payload).expect("its payload");
        frames
            .map(|(at, _, payload)| (*at, read(payload)))
            .collect()
    }

    /// Returns its text messages.
    pub(crate) fn texts(&self) -> Vec<String> {
        let texts = self.messages::<STATUSTEXT_DATA>();
        let text = |text: STATUSTEXT_DATA| text.text.to_str().unwrap_or_default().to_owned();
        texts.into_iter().map(|(_, data)| text(data)).collect()
    }

    pub(crate) fn heartbeats(&self) -> Vec<u64> {
        let beats = self.messages::<HEARTBEAT_DATA>();
        beats.into_iter().map(|(at, _)| at).collect()
    }
}

impl Onlooker for Heard {
    fn period(&mut self, _: f64, _: &Period, _: &Rig) {}

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        let motion = &passage.motion;
        let [a, b, c] = motion.currents_a.map(f64::to_bits);
        (t_s.to_bits(), a, b, c, motion.speed_rad_s.to_bits()).hash(&mut self.hash);
        if let Some(scope) = &mut self.scope {
            scope.motor.push(((t_s * 1e9) as u64, *motion));
        }
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        (time_ns, leg, gate.high, gate.low).hash(&mut self.hash);
        if let Some(scope) = &mut self.scope {
            scope.gates.push((time_ns, leg, gate));
        }
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        (time_ns, level).hash(&mut self.hash);
        if let Some(scope) = &mut self.scope {
            scope.line.push((time_ns, level));
        }
    }

    fn answer(&mut self, _: u64, datagram: &[u8]) {
        datagram.hash(&mut self.hash);
        if let [BIDIRECTIONAL_300..=BIDIRECTIONAL_1200, rest @ ..] = datagram
            && let Some((bits, after)) = rest.split_first_chunk()
        {
            self.replies.push(Reply {
                bits: u32::from_le_bytes(*bits),
                after_ns: u32::from_le_bytes(after.try_into().expect("four bytes")),
            });
        }
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        (time_ns, frame).hash(&mut self.hash);
        let mut receiver = Receiver::new();
        receiver.push(0, frame, |frame| {
            self.from = frame.from;
            self.frames
                .push((time_ns, frame.id, frame.payload.to_vec()));
        });
    }
}

/// The board.
pub(crate) struct Board {
    pub(crate) board: VirtualBoard,
    pub(crate) heard: Heard,
    pub(crate) throttle: Throttle,
    /// Protocol of the DShot frames.
    pub(crate) protocol: u8,
    /// Frames played on the throttle wire.
    pub(crate) played: usize,
    /// When the next one comes.
    due_ns: u64,
    sequence: u8,
    /// The number of the last request to its file server.
    asked: u16,
}

impl Board {
    /// Creates it at power-up, with these parameters stored and everything else at factory values.
    pub(crate) fn new(image: &Image, overrides: &[(ParamId, f32)]) -> Self {
        let start = Start {
            overrides: overrides.to_vec(),
            ..Start::default()
        };
        let (board, warning) = VirtualBoard::new(image, start).expect("a board");
        assert_eq!(warning, None);
        Self {
            board,
            heard: Heard::default(),
            throttle: Throttle::Silent,
            protocol: BIDIRECTIONAL_600,
            played: 0,
            due_ns: 0,
            sequence: 0,
            asked: 0,
        }
    }

    /// Creates one whose motor turns at half throttle.
    pub(crate) fn turning(image: &Image) -> Self {
        let mut board = Self::new(image, &[(ParamId::InpArmMs, 50.0)]);
        board.spin_up();
        board
    }

    /// Arms it and turns the motor at half throttle.
    pub(crate) fn spin_up(&mut self) {
        self.throttle = Throttle::Dshot(0);
        self.run(400 * MS);
        self.throttle = Throttle::Dshot(1000);
        let fast = self.run_until(10 * MS, 4000 * MS, |board| board.rpm() > 1500.0);
        assert!(
            fast.is_some(),
            "it turns at {} rpm: {:?}",
            self.rpm(),
            self.heard.texts()
        );
        assert!(!self.world().bridge().is_off());
    }

    pub(crate) fn world(&mut self) -> &mut World {
        self.board.world()
    }

    pub(crate) fn now_ns(&self) -> u64 {
        self.board.now_ns()
    }

    pub(crate) fn rpm(&mut self) -> f64 {
        self.world().bench().plant().speed_rad_s() * 60.0 / std::f64::consts::TAU
    }

    /// Runs for a time, with frames on the throttle wire.
    pub(crate) fn run(&mut self, for_ns: u64) {
        let until_ns = self.now_ns() + for_ns;
        while self.now_ns() < until_ns {
            let now_ns = self.now_ns();
            if now_ns >= self.due_ns {
                if let Some(datagram) = self.throttle.datagram(self.protocol) {
                    self.board.wire(0).play(now_ns, &datagram).expect("a frame");
                    self.played += 1;
                }
                self.due_ns = now_ns + self.throttle.period_ns();
            }
            self.advance(until_ns.min(self.due_ns));
        }
    }

    /// Runs until a time with nothing new on the throttle wire.
    pub(crate) fn advance(&mut self, until_ns: u64) {
        let ran = self
            .board
            .advance(until_ns, &mut self.heard, &mut |_: &[u8]| {});
        if let Err(stopped) = ran {
            let processor = self.board.processor();
            let [pc, lr] = [Register::Pc, Register::Lr].map(|name| processor.register(name));
            panic!("{stopped}; pc {pc:#010x}, lr {lr:#010x}");
        }
    }

    /// Runs until a condition holds, checked every `step_ns`; returns how long it took.
    pub(crate) fn run_until(
        &mut self,
        step_ns: u64,
        within_ns: u64,
        mut is_so: impl FnMut(&mut Self) -> bool,
    ) -> Option<u64> {
        let began_ns = self.now_ns();
        while self.now_ns() - began_ns < within_ns {
            if is_so(self) {
                return Some(self.now_ns() - began_ns);
            }
            self.run(step_ns);
        }
        is_so(self).then(|| self.now_ns() - began_ns)
    }

    /// Runs until it has sent a text with these words; panics with all texts if it does not.
    pub(crate) fn hear(&mut self, words: &str, within_ns: u64) {
        let said = self.run_until(5 * MS, within_ns, |board| {
            board.heard.texts().iter().any(|text| text.contains(words))
        });
        assert!(said.is_some(), "not '{words}': {:?}", self.heard.texts());
    }

    /// Sends a ground station's message.
    pub(crate) fn send(&mut self, data: &impl MessageData) {
        let mut frame = MAVLinkV2MessageRaw::new();
        let header = MavHeader {
            system_id: 255,
            component_id: 190,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        frame.serialize_message_data(header, data);
        self.world().serial(frame.raw_bytes());
    }

    /// Requests a parameter; returns its value, and how long that took.
    pub(crate) fn param(&mut self, id: &str, within_ns: u64) -> Option<(f32, u64)> {
        self.heard.frames.clear();
        self.send(&PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: self.heard.from.system,
            target_component: self.heard.from.component,
            param_id: id.into(),
        });
        let mut value = None;
        let took_ns = self.run_until(MS, within_ns, |board| {
            let values = board.heard.messages::<PARAM_VALUE_DATA>();
            let mut values = values.into_iter();
            value = values.find(|(_, data)| data.param_id.to_str() == Ok(id));
            value.is_some()
        })?;
        value.map(|(_, data)| (data.param_value, took_ns))
    }

    pub(crate) fn set_param(&mut self, id: &str, value: f32) {
        self.send(&PARAM_SET_DATA {
            param_value: value,
            target_system: self.heard.from.system,
            target_component: self.heard.from.component,
            param_id: id.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        });
    }

    /// Sends it a command.
    pub(crate) fn command(&mut self, command: MavCmd, param1: f32) {
        self.send(&COMMAND_LONG_DATA {
            param1,
            command,
            target_system: self.heard.from.system,
            target_component: self.heard.from.component,
            ..COMMAND_LONG_DATA::default()
        });
    }

    /// Reads one of the files that it serves.
    pub(crate) fn file(&mut self, path: &str) -> Vec<u8> {
        const OPEN_TO_READ: u8 = 4;
        const READ: u8 = 5;
        let (_, opened) = self.ask_server(OPEN_TO_READ, 0, path.as_bytes());
        assert!(opened, "{path} does not open");
        let mut file = Vec::new();
        while let (piece, true) = self.ask_server(READ, file.len() as u32, &[]) {
            file.extend(piece);
        }
        file
    }

    /// Sends its file server a request about its first session; returns the answer's bytes, and whether it is an
    /// acknowledgement.
    fn ask_server(&mut self, opcode: u8, offset: u32, bytes: &[u8]) -> (Vec<u8>, bool) {
        const HEAD: usize = 12;
        const MOST: u8 = 239;
        const ACKNOWLEDGED: u8 = 128;
        let mut payload = [0; 251];
        let size = if bytes.is_empty() {
            MOST
        } else {
            bytes.len() as u8
        };
        self.asked = self.asked.wrapping_add(2);
        payload[..2].copy_from_slice(&self.asked.to_le_bytes());
        (payload[3], payload[4]) = (opcode, size);
        payload[8..HEAD].copy_from_slice(&offset.to_le_bytes());
        payload[HEAD..HEAD + bytes.len()].copy_from_slice(bytes);
        self.heard.frames.clear();
        self.send(&FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: self.heard.from.system,
            target_component: self.heard.from.component,
            payload,
        });
        let mut answer = None;
        self.run_until(MS, 1_000 * MS, |board| {
            let answers = board.heard.messages::<FILE_TRANSFER_PROTOCOL_DATA>();
            answer = answers.into_iter().next().map(|(_, data)| data.payload);
            answer.is_some()
        });
        let answer = answer.expect("an answer of the file server");
        let size = usize::from(answer[4]);
        (
            answer[HEAD..HEAD + size].to_vec(),
            answer[3] == ACKNOWLEDGED,
        )
    }

    pub(crate) fn register(&mut self, register: Register) -> u32 {
        self.board.processor().register(register)
    }

    pub(crate) fn set_register(&mut self, register: Register, value: u32) {
        self.board.processor().set_register(register, value);
    }

    /// Returns the exception being handled; 0 in the tasks.
    pub(crate) fn exception(&mut self) -> u32 {
        self.register(Register::Xpsr) & 0x1ff
    }

    /// Stops in an exception's handler, or for 0 in the tasks, with a gate on.
    pub(crate) fn stop_in(&mut self, exception: u32) {
        let found = self.run_until(US / 2, 5 * MS, |board| {
            board.exception() == exception && !board.world().bridge().is_off()
        });
        assert!(found.is_some(), "exception {exception} does not come");
    }

    /// Returns the time in cycles.
    pub(crate) fn now(&mut self) -> Cycles {
        Surroundings::now(self.world())
    }

    /// Reads a register of the chip, as a debugger does.
    pub(crate) fn peek(&mut self, address: u32) -> u32 {
        Surroundings::read(self.world(), address, Width::Word).expect("it is modelled")
    }

    /// Writes one likewise.
    pub(crate) fn poke(&mut self, address: u32, value: u32) {
        let written = Surroundings::write(self.world(), address, Width::Word, value);
        written.expect("it is modelled");
    }

    /// Runs until all gates are off for good, for longer than a dead time of all three legs; returns the
    /// cycles from now until then.
    pub(crate) fn until_off(&mut self, within_ns: u64) -> Cycles {
        let began = self.now();
        let mut off = None;
        self.run_until(US, within_ns, |board| {
            off = board.world().bridge().off_since();
            let now = board.now();
            off.is_some_and(|since| now > since + 2 * PWM_PERIOD)
        });
        let off = off.unwrap_or_else(|| panic!("the bridge is on after {within_ns} ns"));
        off.checked_sub(began).expect("it was on before")
    }

    /// Resets the chip, or cuts its power for a moment.
    pub(crate) fn reset(&mut self, cause: Cause) {
        self.board.reset(cause);
    }
}

/// Converts cycles to µs.
pub(crate) fn us(cycles: Cycles) -> f64 {
    ns(cycles) as f64 / 1e3
}

/// Returns where in the image a halfword is the permanently undefined instruction `udf`, whatever it is there for.
pub(crate) fn undefined(image: &Image) -> u32 {
    const UDF: u8 = 0xde;
    let mut halfwords = image.segments.iter().flat_map(|segment| {
        let addresses = (segment.address..).step_by(2);
        addresses.zip(segment.bytes.chunks_exact(2))
    });
    let found = halfwords.find(|(_, halfword)| halfword[1] == UDF);
    found.expect("one halfword in 256 is").0
}

/// Puts a jump to itself into free SRAM: after everything in the image, below the end of the chip's 22 KB.
pub(crate) fn endless_loop(board: &mut Board) -> u32 {
    const AT: u32 = 0x2000_57f0;
    let mut memories = board.world().memories().iter();
    let memory = memories.find(|memory| memory.holds(AT, 2)).expect("SRAM");
    memory.write(AT, 2, 0xe7fe);
    AT
}
