//! Exception entry and return (B1.5.6 to B1.5.8).

use super::{RAM, STACK, Stop, marks, run};

/// Fills registers, takes interrupt 5 in a loop, and reports the registers afterwards. Its handler reports
/// the frame and moves the return address past the loop.
const INTERRUPTED: &str = "
    interrupted: mov32 r0, 0xe000e100
    mov r1, #0x20
    str r1, [r0]
    mov32 r0, 0xa0000000
    msr apsr, r0
    mov r0, #0x100
    mov r1, #0x101
    mov r2, #0x102
    mov r3, #0x103
    mov r12, #0x10c
    mov32 lr, 0x1010e
    mov r4, #0x20
    str r4, [r10, #8]
    loop: b loop
    str r0, [r10]
    str r1, [r10]
    str r2, [r10]
    str r3, [r10]
    str r12, [r10]
    str lr, [r10]
    mrs r4, xpsr
    str r4, [r10]
    mov r4, sp
    str r4, [r10]
    b stop
    tell_frame: ldr r0, [r4]
    str r0, [r10]
    ldr r0, [r4, #4]
    str r0, [r10]
    ldr r0, [r4, #8]
    str r0, [r10]
    ldr r0, [r4, #12]
    str r0, [r10]
    ldr r0, [r4, #16]
    str r0, [r10]
    ldr r0, [r4, #20]
    str r0, [r10]
    ldr r0, [r4, #24]
    str r0, [r10]
    adds r0, #2
    str r0, [r4, #24]
    ldr r0, [r4, #28]
    str r0, [r10]
    str r4, [r10]
    str lr, [r10]
    mrs r0, xpsr
    str r0, [r10]
    mov r1, #0xeee
    mov r2, #0xeee
    mov r3, #0xeee
    mov r12, #0xeee
    lower #0x20
    bx lr
";

/// Checks what the program reports: the frame, its address, LR and xPSR in the handler; then the registers
/// again.
fn told(program: &str, frame: u32, aligned: bool, lr: u32, sp: u32) {
    let mut ran = run(&format!("{program}\n{INTERRUPTED}"));
    assert_eq!(ran.stop, Stop::Asked);
    let pc = ran.code.labels["loop"];
    let status = 0xa100_0000 | u32::from(aligned) << 9;
    let registers = [0x100, 0x101, 0x102, 0x103, 0x10c, 0x1010e];
    let mut wanted = registers.to_vec();
    wanted.extend([pc, status, frame, lr]);
    let marks = &ran.processor.surroundings().marks;
    assert_eq!(marks[..10], wanted, "{marks:x?}");
    assert_eq!(marks[10] & 0x1ff, 16 + 5, "IPSR in the handler");
    assert_eq!(marks[11..17], registers, "{marks:x?}");
    // MRS reads EPSR as zero.
    assert_eq!(marks[17..], [0xa000_0000, sp]);
}

#[test]
fn the_frame_has_what_was_interrupted() {
    let program = "
        main: b interrupted
        exception_21: mov r4, sp
        b tell_frame
    ";
    told(program, STACK - 32, false, 0xffff_fff9, STACK);
}

#[test]
fn a_stack_that_is_not_aligned_is_aligned() {
    let program = "
        main: mov32 r0, 0x20000ffc
        mov sp, r0
        b interrupted
        exception_21: mov r4, sp
        b tell_frame
    ";
    told(program, STACK - 40, true, 0xffff_fff9, STACK - 4);
}

#[test]
fn a_return_goes_to_the_process_stack() {
    let program = "
        main: mov32 r0, 0x20000800
        msr psp, r0
        mov r0, #2
        msr control, r0
        isb
        b interrupted
        exception_21: mrs r4, psp
        b tell_frame
    ";
    told(program, RAM + 0x800 - 32, false, 0xffff_fffd, RAM + 0x800);
}

#[test]
fn a_call_to_the_supervisor_returns_behind_it() {
    let program = "
        main: mark #1
        svc 7
        mark #3
        b stop
        exception_11: mark #2
        bx lr
    ";
    assert_eq!(marks(program), [1, 2, 3]);
}

#[test]
fn a_handler_can_be_returned_to() {
    let program = "
        main: mov32 r0, 0xe000e100
        mov r1, #1
        str r1, [r0]
        mov32 r0, 0xe000ed1c
        mov r1, #0x80
        strb r1, [r0, #3]       ; SVCall below the interrupt
        svc 0
        b stop
        exception_11: push {r4, lr}
        raise #1
        sync
        mark #2
        pop {r4, pc}
        exception_16: lower #1
        str lr, [r10]
        bx lr
    ";
    assert_eq!(marks(program), [0xffff_fff1, 2]);
}

#[test]
fn a_block_of_conditions_goes_on_after_an_interrupt() {
    let program = "
        main: mov32 r0, 0xe000e100
        mov r1, #1
        str r1, [r0]
        mov r5, #0
        mov r0, #0
        cmp r0, #0
        ite eq
        str r1, [r10, #8]       ; equal: raises the line
        mov r5, #1              ; not equal
        sync
        str r5, [r10]
        b stop
        exception_16: lower #1
        mark #9
        bx lr
    ";
    assert_eq!(marks(program), [9, 0]);
}

#[test]
fn a_block_of_conditions_ends() {
    let program = "
        main: mov32 r4, =routine
        mov r6, #0
        blx r4
        mov r6, #5
        str r6, [r10]
        b stop
        routine: mov r0, #0
        cmp r0, #0
        it eq
        ldr r1, [r10]           ; not from memory
        cmp r0, #1
        bx lr
    ";
    assert_eq!(marks(program), [5]);
}

#[test]
// The engine leaves its exclusive monitor alone.
#[should_panic = "assertion `left == right` failed"]
fn an_exception_ends_an_exclusive_access() {
    let program = "
        main: mov32 r4, 0x20000010
        mov r2, #5
        ldrex r0, [r4]
        strex r1, r2, [r4]
        str r1, [r10]
        mov r2, #6
        ldrex r0, [r4]
        svc 0
        strex r1, r2, [r4]
        str r1, [r10]
        ldr r0, [r4]
        str r0, [r10]
        b stop
        exception_11: bx lr
    ";
    assert_eq!(marks(program), [0, 1, 5]);
}

#[test]
fn entries_and_returns_are_told() {
    let program = "
        main: svc 0
        svc 0
        b stop
        exception_11: bx lr
    ";
    let mut ran = run(program);
    let told = &ran.processor.surroundings().exceptions;
    assert_eq!(*told, [(11, true), (11, false), (11, true), (11, false)]);
}
