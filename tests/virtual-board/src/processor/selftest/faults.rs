//! Faults, what they escalate to, and what ends a run (B1.5.14, B1.5.15).

use super::{RAM, Ran, Stop, UNKNOWN, marks, run};

/// A hard fault handler that reports the fault registers and the frame's return address.
const TELLING: &str = "
    exception_3: mov32 r0, 0xe000ed28
    ldr r1, [r0]
    str r1, [r10]
    ldr r1, [r0, #4]
    str r1, [r10]
    ldr r1, [r0, #16]
    str r1, [r10]
    ldr r1, [sp, #24]
    str r1, [r10]
    b stop
";

fn told(program: &str) -> (Vec<u32>, Ran) {
    let mut ran = run(&format!("{program}\n{TELLING}"));
    assert_eq!(ran.stop, Stop::Asked);
    (ran.processor.surroundings().marks.clone(), ran)
}

/// HFSR.FORCED: the fault has no handler of its own.
const FORCED: u32 = 1 << 30;

#[test]
fn an_undefined_instruction_is_a_hard_fault() {
    let (marks, ran) = told("main: nop\nat: udf 3");
    assert_eq!(marks[..2], [1 << 16, FORCED]);
    assert_eq!(marks[3], ran.code.labels["at"]);
}

#[test]
fn an_enabled_fault_has_its_own_handler() {
    let program = "
        main: mov32 r0, 0xe000ed24
        mov32 r1, 0x00070000
        str r1, [r0]
        mov32 r4, 0x60000000
        ldr r0, [r4]
        udf 0
        b stop
        exception_5: mark #5
        ldr r0, [sp, #24]
        adds r0, #4
        str r0, [sp, #24]
        bx lr
        exception_6: mark #6
        ldr r0, [sp, #24]
        adds r0, #2
        str r0, [sp, #24]
        bx lr
    ";
    assert_eq!(marks(program), [5, 6]);
}

#[test]
fn an_access_to_nothing_is_a_bus_fault() {
    let (marks, ran) = told("main: mov32 r4, 0x60000000\nat: ldr r0, [r4, #8]");
    assert_eq!(marks[..3], [0x8200, FORCED, 0x6000_0008]);
    assert_eq!(marks[3], ran.code.labels["at"]);
    // The write buffer may lose whose it was.
    let (marks, _) = told("main: mov32 r4, 0x60000000\nstrb r0, [r4, #8]\nwait: b wait");
    assert!([0x8200, 0x400].contains(&marks[0]), "{marks:x?}");
    assert_eq!(marks[1], FORCED);
}

#[test]
fn nothing_executes_outside_memory() {
    let (marks, _) = told("main: mov32 r4, 0x60000001\nbx r4");
    assert_eq!(marks[..2], [0x100, FORCED]);
    assert_eq!(marks[3], 0x6000_0000);
}

#[test]
// The engine goes on in ARM state.
#[should_panic = "assertion `left == right` failed"]
fn there_is_no_arm_state() {
    let (marks, _) = told("main: mov32 r4, 0x08000100\nbx r4");
    assert_eq!(marks[..2], [1 << 17, FORCED]);
}

#[test]
fn a_fault_in_the_hard_fault_handler_locks_up() {
    let program = "
        main: udf 0
        exception_3: mark #3
        udf 1
        mark #9
    ";
    let mut ran = run(program);
    assert_eq!(ran.stop, Stop::LockedUp);
    assert_eq!(ran.processor.surroundings().marks, [3]);
}

#[test]
fn a_call_to_the_supervisor_in_the_hard_fault_handler_locks_up() {
    let program = "
        main: udf 0
        exception_3: mark #3
        svc 1
        mark #9
        b stop
    ";
    let mut ran = run(program);
    assert_eq!(ran.stop, Stop::LockedUp);
    assert_eq!(ran.processor.surroundings().marks, [3]);
}

#[test]
fn a_push_below_memory_is_a_hard_fault() {
    let program = "
        main: mov32 r4, 0x20000004
        mov sp, r4
        push {r0, r1, r2}
        sync
        mark #9
        b stop
        exception_3: mark #3
        mov32 r0, 0xe000ed2c
        ldr r1, [r0]
        str r1, [r10]
        b stop
    ";
    assert_eq!(marks(program), [3, FORCED]);
}

#[test]
fn an_entry_below_memory_is_a_hard_fault() {
    let program = "
        main: mov32 r0, 0xe000e100
        mov r1, #1
        str r1, [r0]
        mov32 r4, 0x20000008
        mov sp, r4
        raise #1
        sync
        mark #9
        b stop
        exception_16: mark #16
        b stop
        exception_3: mov32 r0, 0xe000ed28
        ldr r1, [r0]
        str r1, [r10]
        ldr r1, [r0, #4]
        str r1, [r10]
        b stop
    ";
    // STKERR.
    assert_eq!(marks(program), [0x1000, FORCED]);
}

#[test]
fn a_request_resets() {
    let program = "
        main: mark #1
        mov32 r0, 0xe000ed0c
        mov32 r1, 0x05fa0004
        str r1, [r0]
        dsb
        wait: b wait
    ";
    let mut ran = run(program);
    assert_eq!(ran.stop, Stop::Reset);
    assert_eq!(ran.processor.surroundings().marks, [1]);
    // After the reset it runs again, with what it wrote to memory still there.
    ran.ram.write(RAM, 4, 7);
    ran.processor.reset(super::FLASH);
    assert_eq!(ran.processor.run(), Stop::Reset);
    assert_eq!(ran.processor.surroundings().marks, [1, 1]);
    assert_eq!(ran.ram.read(RAM, 4), 7);
}

#[test]
fn a_request_without_its_key_does_not() {
    let program = "
        main: mov32 r0, 0xe000ed0c
        mov r1, #4
        str r1, [r0]
        dsb
        ldr r1, [r0]
        str r1, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0xfa05_0000]);
}

#[test]
fn an_unknown_register_is_named() {
    let cases = [
        ("ldrh r0, [r10, #256]", None),
        ("str r5, [r10, #256]", Some(0x55)),
    ];
    for (access, written) in cases {
        let ran = run(&format!("main: mov r5, #0x55\nat: {access}\nb stop"));
        let wanted = Stop::Unmodelled {
            address: UNKNOWN,
            pc: ran.code.labels["at"],
            written,
        };
        assert_eq!(ran.stop, wanted);
    }
}
