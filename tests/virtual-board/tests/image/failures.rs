//! Fatal failures turn the bridge off while the motor turns, and are reported after the restart. Run with
//! `--release`.

use crate::common::{Board, MS, PWM_PERIOD, Throttle, US, endless_loop, image, undefined, us};
use siskin_vboard::image::Image;
use siskin_vboard::processor::{Register, Surroundings};
use siskin_vboard::time::{CLOCK_HZ, Cycles};

/// The contexts into which a failure is put: the tasks' thread, and the PWM interrupt.
const THREAD: u32 = 0;
const PWM_INTERRUPT: u32 = 16 + 18;

/// ADC1's interrupt enable and TIM1's control, which the tests use.
const ADC1_IER: u32 = 0x5000_0004;
const TIM1_CR1: u32 = 0x4001_2c00;

/// Start of SRAM, where the stack ends.
const STACK_END: u32 = 0x2000_0000;

/// Returns the entry of all panics.
fn panic_entry(image: &Image) -> u32 {
    let symbol = image.symbol(&["rust_begin_unwind"]);
    let (address, _) = symbol.expect("the image has a panic");
    address & !1
}

/// Returns where the control period begins: it pushes nine registers.
fn step_entry(image: &Image) -> u32 {
    let symbol = image.symbol(&["9interrupt6period", "9Interrupt7control"]);
    let (address, _) = symbol.expect("the image has a control period");
    address & !1
}

/// Sets registers in both contexts; asserts that the bridge is off within a period, and that the next start
/// reports these words.
fn fails(name: &str, registers: &[(Register, u32)], words: &str) {
    let image = image();
    let mut board = Board::turning(&image);
    for context in [THREAD, PWM_INTERRUPT] {
        board.stop_in(context);
        for (register, value) in registers {
            board.set_register(*register, *value);
        }
        let took = board.until_off(MS);
        println!(
            "{name} in {context}: off after {took} cycles, {:.2} us",
            us(took)
        );
        assert!(took < PWM_PERIOD, "{took} cycles");
        board.heard.frames.clear();
        board.throttle = Throttle::Silent;
        board.hear(words, 500 * MS);
        println!("{:?}", board.heard.texts());
        assert!(board.world().bridge().is_off());
        assert_eq!(board.world().bridge().violations(), 0);
        if context == THREAD {
            board.spin_up();
        }
    }
}

#[test]
fn a_panic() {
    let entry = panic_entry(&image());
    fails("panic", &[(Register::Pc, entry)], "Restart: panic");
}

#[test]
fn an_instruction_that_is_none() {
    // The undefined instruction's bit in CFSR.
    let at = undefined(&image());
    let words = format!("Restart: hard fault at {at:x}, status 10000");
    fails("undefined instruction", &[(Register::Pc, at)], &words);
}

#[test]
fn a_stack_that_leaves_its_memory() {
    // A call, with room for two more words.
    let entry = step_entry(&image());
    let registers = [(Register::Sp, STACK_END + 8), (Register::Pc, entry)];
    fails("stack", &registers, "Restart: stack overflow");
}

/// Stops the control; asserts that the supervisor, which checks every 50 ms, turns the bridge off.
fn stands_still(name: &str, stop: impl Fn(&mut Board)) {
    let mut board = Board::turning(&image());
    board.stop_in(THREAD);
    stop(&mut board);
    let took = board.until_off(200 * MS);
    println!("{name}: off after {:.0} us", us(took));
    // One more period may pass between two checks, and the task runs every millisecond.
    assert!(took <= 102 * CLOCK_HZ / 1000, "{took} cycles");
    board.heard.frames.clear();
    board.throttle = Throttle::Silent;
    board.hear("Restart: the control stood still", 500 * MS);
}

#[test]
fn an_interrupt_that_does_not_come() {
    stands_still("ADC interrupt off", |board| board.poke(ADC1_IER, 0));
}

#[test]
fn a_timer_that_stands() {
    stands_still("TIM1 stopped", |board| {
        let control = board.peek(TIM1_CR1);
        board.poke(TIM1_CR1, control & !1);
    });
}

#[test]
fn tasks_that_stand_still() {
    let image = image();
    let mut board = Board::turning(&image);
    board.stop_in(THREAD);
    let pc = endless_loop(&mut board);
    board.set_register(Register::Pc, pc);
    let took = board.until_off(2_200 * MS);
    println!("watchdog: off after {:.1} ms", us(took) / 1e3);
    let ms = |ms: u64| ms * CLOCK_HZ / 1000;
    // 1.6 s after the last feed, which came at most 50 ms and a millisecond before.
    let range = ms(1_545)..=ms(1_601);
    assert!(range.contains(&took), "{took} cycles");
    board.heard.frames.clear();
    board.throttle = Throttle::Silent;
    board.hear("Restart: the watchdog was not fed", 500 * MS);
}

/// With the processor stopped, the duties stay and the current rises until a comparator trips.
#[test]
fn too_much_current_while_the_processor_stands() {
    let mut board = Board::turning(&image());
    board.stop_in(THREAD);
    let before = board.board.processor().instructions();
    let from = board.now();
    let world = board.world();
    while !world.bridge().is_off() && Surroundings::now(world) < from + CLOCK_HZ / 10 {
        let until = Surroundings::now(world) + PWM_PERIOD / 10;
        world.idle(until);
    }
    let tripped = world.tripped().expect("a comparator has tripped");
    let off = world.bridge().off_since().expect("the break has acted");
    let filter: Cycles = off - tripped;
    println!(
        "tripped {:.1} us after the processor stood, off {filter} cycles later, {:.3} us",
        us(tripped - from),
        us(filter)
    );
    // Six samples at a sixteenth of the clock, the first of which is up to a sample late.
    assert!((5 * 16..=7 * 16 + 8).contains(&filter), "{filter} cycles");
    // Nothing turns it on again by itself.
    let until = Surroundings::now(world) + 5 * PWM_PERIOD;
    world.idle(until);
    assert_eq!(world.bridge().off_since(), Some(off));
    assert_eq!(board.board.processor().instructions(), before);
    board.hear("Fault: over-current", 200 * MS);
    assert_eq!(board.world().bridge().violations(), 0);
}

/// A breakpoint: the program stops running.
#[test]
fn a_debugger_that_halts_the_processor() {
    let mut board = Board::turning(&image());
    board.stop_in(THREAD);
    let world = board.world();
    world.halt();
    assert!(world.bridge().is_off(), "at once");
    let until = Surroundings::now(world) + 10 * PWM_PERIOD;
    world.idle(until);
    assert!(world.bridge().is_off(), "and so it stays");
}

/// A fault in the hard fault handler, before its first instruction: the processor does nothing any more,
/// and the timer's break acts.
#[test]
fn a_processor_that_locks_up() {
    let image = image();
    let at = undefined(&image);
    let mut board = Board::turning(&image);
    board.stop_in(THREAD);
    board.set_register(Register::Pc, at);
    let faults = board.run_until(1, US, |board| board.exception() == 3);
    assert!(faults.is_some());
    assert!(
        !board.world().bridge().is_off(),
        "the handler has not begun"
    );
    board.set_register(Register::Pc, at);
    let took = board.until_off(MS);
    println!("lock-up: off {took} cycles after it");
    assert!(took < PWM_PERIOD, "{took} cycles");
    board.heard.frames.clear();
    board.throttle = Throttle::Silent;
    board.run(1_590 * MS);
    board.hear("Restart: the watchdog was not fed", 500 * MS);
}
