//! The image on either engine: what it does is the same, and when, within what their clocks differ by.

use siskin_control::mavlink::Receiver;
use siskin_emulator::device::Start;
use siskin_emulator::flash::FileFlash;
use siskin_emulator::machine::{Machine, Onlooker};
use siskin_emulator::rig::{Bench, Period, Rig};
use siskin_emulator::wire::Wire;
use siskin_vboard::machine::VirtualBoard;
use siskin_vboard::processor::Processor;
use siskin_vboard::processor::interpreter::Interpreter;
use siskin_vboard::processor::unicorn::Translator;
use siskin_vboard::world::World;

use crate::common::{MS, image};

/// STATUSTEXT and HEARTBEAT, which tell no time.
const TIMELESS: [u32; 2] = [253, 0];

/// Simulated, ms: the start, the currents' zeros, the throttle's signal found out.
const RUN_MS: u64 = 150;

/// A bidirectional DShot600 frame of zero throttle: its number, and its bits with the inverted check sum.
const REST: [u8; 3] = [22, 0x0f, 0x00];

/// What an image has done.
#[derive(Debug)]
struct Done {
    /// Frames of the serial line that tell no time.
    frames: Vec<Vec<u8>>,
    periods: u64,
    edges: u64,
    violations: u64,
    instructions: u64,
}

struct Nobody;

impl Onlooker for Nobody {
    fn period(&mut self, _: f64, _: &Period, _: &Rig) {}
}

fn board<P: Processor<World>>() -> VirtualBoard<P> {
    let start = Start {
        bench: Bench::default(),
        wire: Wire::detached(),
        flash: FileFlash::in_memory(),
        overrides: Vec::new(),
        faults: Vec::new(),
        link_bytes_per_s: 11_520,
    };
    let (board, _) = VirtualBoard::new(&image(), start).expect("a board");
    board
}

fn run<P: Processor<World>>() -> Done {
    let mut board = board::<P>();
    let mut frames = Vec::new();
    for at_ms in 0..RUN_MS {
        board.wire().play(at_ms * MS, &REST).expect("room");
        let advanced = board.advance((at_ms + 1) * MS, &mut Nobody, &mut |frame| {
            Receiver::new().push(0, frame, |frame| {
                if TIMELESS.contains(&frame.id) {
                    frames.push(frame.payload.to_vec());
                }
            });
        });
        advanced.expect("it goes on");
    }
    let figures = board.figures().expect("the control runs");
    let instructions = board.processor().instructions();
    let bridge = board.world().bridge();
    Done {
        frames,
        periods: figures.interrupts,
        edges: bridge.edges(),
        violations: bridge.violations(),
        instructions,
    }
}

/// ES0431: the first write to a memory after a reset may be lost, unless it has been read.
#[test]
fn no_memory_is_written_before_it_is_read() {
    let mut board = board::<Interpreter<World>>();
    let advanced = board.advance(2 * MS, &mut Nobody, &mut |_: &[u8]| {});
    advanced.expect("it goes on");
    assert!(board.processor().instructions() > 10_000);
    assert_eq!(board.processor().written_first(), 0);
}

#[test]
fn both_engines_run_the_image_alike() {
    let translated = run::<Translator<World>>();
    let interpreted = run::<Interpreter<World>>();
    println!("translated {translated:?}\ninterpreted {interpreted:?}");
    assert!(!translated.frames.is_empty());
    assert_eq!(translated.frames, interpreted.frames);
    assert_eq!(translated.violations, 0);
    assert_eq!(interpreted.violations, 0);
    // The PWM's clock is the same; the start takes as long as each engine's instructions do.
    let periods = translated.periods.abs_diff(interpreted.periods);
    assert!(periods < 24 * 10, "10 ms of start: {periods}");
    let edges = translated.edges.abs_diff(interpreted.edges);
    assert!(edges < 6 * 2 * 24 * 10, "{edges}");
    // What is waited for is counted in instructions as well.
    let share = interpreted.instructions as f64 / translated.instructions as f64;
    assert!((0.8..1.25).contains(&share), "{share}");
}
