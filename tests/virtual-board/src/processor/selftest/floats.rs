//! The floating-point unit's state through exceptions (B1.5.7).

use super::{STACK, Stop, marks, run};

/// Enables it, and interrupts 0 and 1, the second more urgent.
const ENABLED: &str = "
    main: mov32 r0, 0xe000ed88
    mov32 r1, 0x00f00000
    str r1, [r0]
    dsb
    isb
    mov32 r0, 0xe000e100
    mov r1, #3
    str r1, [r0]
    mov32 r0, 0xe000e400
    mov r1, #0x20
    strb r1, [r0]
";

#[test]
// The engine ignores CPACR.
#[should_panic = "assertion `left == right` failed"]
fn without_leave_it_faults() {
    let program = "
        main: vmov r0, s0
        mark #9
        b stop
        exception_3: mov32 r0, 0xe000ed28
        ldr r1, [r0]
        str r1, [r10]
        b stop
    ";
    // NOCP.
    assert_eq!(marks(program), [1 << 19]);
}

#[test]
fn a_frame_is_short_while_it_is_not_used() {
    let program = "
        mrs r0, control
        str r0, [r10]
        raise #1
        sync
        b stop
        exception_16: lower #1
        str lr, [r10]
        mov r0, sp
        str r0, [r10]
        bx lr
    ";
    let program = format!("{ENABLED}\n{program}");
    assert_eq!(marks(&program), [0, 0xffff_fff9, STACK - 32]);
}

/// Fills s0 to s15 and FPSCR, takes an interrupt, and reports them, CONTROL and the stack pointer.
fn interrupted(handler: &str) -> Vec<u32> {
    let mut program = format!("{ENABLED}\n");
    for single in 0..16 {
        let value = 0x100 + single;
        program += &format!("mov r1, #{value}\nvmov s{single}, r1\n");
    }
    program += "
        mov32 r1, 0x90400000    ; N, V, rounding up
        vmsr fpscr, r1
        raise #1
        sync
    ";
    for single in 0..16 {
        program += &format!("vmov r1, s{single}\nstr r1, [r10]\n");
    }
    program += "
        vmrs r1, fpscr
        str r1, [r10]
        mrs r1, control
        str r1, [r10]
        mov r1, sp
        str r1, [r10]
        b stop
        exception_16: lower #1
        str lr, [r10]
        mov r0, sp
        str r0, [r10]
    ";
    let mut ran = run(&(program + handler));
    assert_eq!(ran.stop, Stop::Asked);
    ran.processor.surroundings().marks.clone()
}

/// What all of them report at the end.
fn kept() -> Vec<u32> {
    let mut values: Vec<u32> = (0x100..0x110).collect();
    values.extend([0x9040_0000, 4, STACK]);
    values
}

/// EXC_RETURN to a thread on the main stack, with the long frame.
const LONG: u32 = 0xffff_ffe9;

#[test]
fn an_interrupt_that_uses_it_keeps_its_state() {
    let handler = "
        vmrs r0, fpscr
        str r0, [r10]
        mov32 r0, 0x3f800000
        vmov s0, r0
        vmov s15, r0
        vmov.f32 s1, s0
        vadd.f32 s0, s0, s1
        vmov r0, s0
        str r0, [r10]
        mov r0, #0
        vmsr fpscr, r0
        ldr r0, [sp, #32]       ; s0
        str r0, [r10]
        ldr r0, [sp, #92]       ; s15
        str r0, [r10]
        ldr r0, [sp, #96]       ; FPSCR
        str r0, [r10]
        bx lr
    ";
    let mut marks = interrupted(handler);
    // In the handler its modes are FPDSCR's, its flags unknown; 1 + 1 = 2; the frame has 26 words.
    marks[2] &= 0x07c0_0000;
    let wanted = [LONG, STACK - 104, 0, 0x4000_0000, 0x100, 0x10f, 0x9040_0000];
    assert_eq!(marks[..7], wanted, "{marks:x?}");
    assert_eq!(marks[7..], kept(), "{marks:x?}");
}

#[test]
fn an_interrupt_that_does_not_use_it_keeps_its_state() {
    let marks = interrupted("bx lr");
    assert_eq!(marks[..2], [LONG, STACK - 104], "{marks:x?}");
    assert_eq!(marks[2..], kept(), "{marks:x?}");
}

#[test]
fn a_handler_begins_without_a_context() {
    let handler = "
        push {r4, lr}
        mrs r0, control
        str r0, [r10]
        raise #2                ; from a handler that has not used it
        sync
        vmov s0, r0
        mrs r0, control
        str r0, [r10]
        raise #2                ; and from one that has
        sync
        pop {r4, pc}
        exception_17: lower #2
        str lr, [r10]
        bx lr
    ";
    let marks = interrupted(handler);
    let wanted = [LONG, STACK - 104, 0, 0xffff_fff1, 4, 0xffff_ffe1];
    assert_eq!(marks[..6], wanted, "{marks:x?}");
    assert_eq!(marks[6..], kept(), "{marks:x?}");
}

#[test]
fn a_frame_can_be_filled_at_once() {
    let program = "
        mov32 r0, 0xe000ef34
        mov32 r1, 0x80000000    ; FPCCR: ASPEN without LSPEN
        str r1, [r0]
        mov r1, #0x123
        vmov s3, r1
        raise #1
        sync
        vmov r1, s3
        str r1, [r10]
        b stop
        exception_16: lower #1
        str lr, [r10]
        ldr r0, [sp, #44]       ; s3
        str r0, [r10]
        mov r0, #0x77
        str r0, [sp, #44]
        bx lr
    ";
    // What is unstacked is what the frame holds.
    let marks = marks(&format!("{ENABLED}\n{program}"));
    assert_eq!(marks, [LONG, 0x123, 0x77]);
}
