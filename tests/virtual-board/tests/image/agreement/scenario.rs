//! The throttle that both tests play, and the board that takes it.

use siskin_emulator::device::Start;
use siskin_emulator::machine::{Machine, Onlooker};
use siskin_emulator::plant::{Fidelity, Sensing};
use siskin_emulator::rig::Bench;
use siskin_firmware::circuit::b_g431b_esc1::BOARD;
use siskin_params::ParamId;
use siskin_throttle::dshot::{Frame, Rate, check_mask};
use siskin_throttle::signal::Signal;
use siskin_vboard::image::Image;
use siskin_vboard::machine::VirtualBoard;

/// Frame interval, ns.
const FRAME_NS: u64 = 1_000_000;

/// The throttle wire.
const SIGNAL: Signal = Signal::Dshot {
    rate: Rate::Dshot600,
    bidirectional: true,
};

/// The first throttle value, and how many steps follow it.
const FIRST: f64 = 48.0;
const SPAN: f64 = 1999.0;

/// What is on the throttle wire until a time.
pub(crate) struct Step {
    /// Until then, ms.
    pub(crate) until_ms: u64,
    /// The frames' value; `None` for silence.
    pub(crate) value: Option<u16>,
}

impl Step {
    /// Sends nothing.
    pub(crate) const fn silence(until_ms: u64) -> Self {
        Self {
            until_ms,
            value: None,
        }
    }

    /// Sends zero throttle, or a command.
    pub(crate) const fn command(until_ms: u64, value: u16) -> Self {
        Self {
            until_ms,
            value: Some(value),
        }
    }

    /// Sends a share of full throttle.
    pub(crate) const fn throttle(until_ms: u64, share: f64) -> Self {
        Self::command(until_ms, (FIRST + share * SPAN + 0.5) as u16)
    }

    /// Returns the share of full throttle, if it is throttle.
    pub(crate) fn share(&self) -> Option<f64> {
        let value = f64::from(self.value?);
        (value >= FIRST).then(|| (value - FIRST) / SPAN)
    }
}

/// Zero until armed, a start, up in steps and back, and to rest. The first step is long enough for the speed
/// to settle before it is measured, even if a start takes 15 ms more than its 0.8 s.
pub(crate) const STEPS: [Step; 6] = [
    Step::command(500, 0),
    Step::throttle(2300, 0.25),
    Step::throttle(2900, 0.5),
    Step::throttle(3500, 0.75),
    Step::throttle(4300, 0.25),
    Step::command(5100, 0),
];

/// Returns the default bench with the board's sensors, switch by switch.
pub(crate) fn start() -> Start {
    let range_a = f64::from(BOARD.current_a_per_count) * 2048.0;
    Start {
        bench: Bench {
            plant: Fidelity::Switching,
            sensing: Sensing {
                range_a,
                ..Sensing::default()
            },
            ..Bench::default()
        },
        // As short as the board allows, for the emulator too.
        overrides: vec![(ParamId::PwmDeadtimeNs, BOARD.least_dead_time.ns)],
        ..Start::default()
    }
}

/// Creates a virtual board with the image, on a bench.
pub(crate) fn board(image: &Image, start: Start) -> VirtualBoard {
    let (board, warning) = VirtualBoard::new(image, start).expect("it starts");
    assert_eq!(warning, None);
    board
}

/// Plays steps from where the machine is, a whole number of frames from its start.
pub(crate) fn play(machine: &mut impl Machine, steps: &[Step], onlooker: &mut impl Onlooker) {
    // The emulator's control periods do not divide them evenly.
    let mut frame = (machine.now_ns() + FRAME_NS / 2) / FRAME_NS;
    for step in steps {
        while frame < step.until_ms {
            if let Some(value) = step.value {
                let played = machine.wire(0).play(frame * FRAME_NS, &datagram(value));
                played.expect("a frame");
            }
            frame += 1;
            let advanced = machine.advance(frame * FRAME_NS, onlooker, &mut |_| {});
            advanced.unwrap_or_else(|stopped| panic!("at {frame} ms: {stopped}"));
        }
    }
}

fn datagram(value: u16) -> Vec<u8> {
    let telemetry = false;
    let bits = Frame { value, telemetry }.to_bits() ^ check_mask(true);
    let mut datagram = vec![SIGNAL.number()];
    datagram.extend(bits.to_le_bytes());
    datagram
}
