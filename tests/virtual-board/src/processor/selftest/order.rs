//! Which exception comes when (B1.5.4, B1.5.9).

use super::{marks, run};

/// Enables interrupts 0 to 15 and sets the priorities of 1 to 3: the higher the number, the more urgent.
const LEVELS: &str = "
    main: mov32 r0, 0xe000e100
    mov r1, #0xffff
    str r1, [r0]
    mov32 r0, 0xe000e400
    mov r1, #0x30
    strb r1, [r0, #1]
    mov r1, #0x20
    strb r1, [r0, #2]
    mov r1, #0x10
    strb r1, [r0, #3]
";

/// Handlers of interrupts 1 to 3 that leave their number.
const HANDLERS: &str = "
    exception_17: lower #2
    mark #1
    bx lr
    exception_18: lower #4
    mark #2
    bx lr
    exception_19: lower #8
    mark #3
    bx lr
";

fn leveled(parts: &[&str]) -> Vec<u32> {
    marks(&format!("{LEVELS}\n{}", parts.join("\n")))
}

#[test]
fn three_levels_nest() {
    let program = "
        raise #2
        sync
        mark #0x99
        b stop
        exception_17: push {r4, lr}
        lower #2
        mark #1
        raise #4
        sync
        mark #0x11
        pop {r4, pc}
        exception_18: push {r4, lr}
        lower #4
        mark #2
        raise #8
        sync
        mark #0x22
        pop {r4, pc}
        exception_19: lower #8
        mark #3
        mov r0, sp
        str r0, [r10]
        bx lr
    ";
    // Three frames of 32 bytes plus what two handlers have pushed.
    let sp = super::STACK - 3 * 32 - 2 * 8;
    assert_eq!(leveled(&[program]), [1, 2, 3, sp, 0x22, 0x11, 0x99]);
}

#[test]
fn the_most_urgent_goes_first() {
    let program = "
        cpsid i
        raise #0xe
        cpsie i
        sync
        mark #9
        b stop
    ";
    assert_eq!(leveled(&[program, HANDLERS]), [3, 2, 1, 9]);
}

#[test]
fn equals_go_by_their_number() {
    let program = "
        mov r1, #0x20
        strb r1, [r0, #1]
        strb r1, [r0, #3]
        cpsid i
        raise #0xe
        cpsie i
        sync
        mark #9
        b stop
    ";
    assert_eq!(leveled(&[program, HANDLERS]), [1, 2, 3, 9]);
}

#[test]
fn an_equal_does_not_preempt() {
    let program = "
        raise #0x20
        sync
        mark #9
        b stop
        exception_21: lower #0x20
        raise #0x10
        sync
        mark #5
        bx lr
        exception_20: lower #0x10
        mark #4
        bx lr
    ";
    assert_eq!(leveled(&[program]), [5, 4, 9]);
}

#[test]
fn a_handler_follows_without_unstacking() {
    let program = "
        mov r1, #0x100
        cpsid i
        raise #6
        cpsie i
        sync
        str r1, [r10]
        b stop
        exception_18: lower #4
        mov r1, #0x222
        mov r0, sp
        str r0, [r10]
        bx lr
        exception_17: lower #2
        str r1, [r10]
        mov r0, sp
        str r0, [r10]
        str lr, [r10]
        bx lr
    ";
    let mut ran = run(&format!("{LEVELS}\n{program}"));
    let bed = ran.processor.surroundings();
    let frame = super::STACK - 32;
    assert_eq!(bed.marks, [frame, 0x222, frame, 0xffff_fff9, 0x100]);
    let told = [(18, true), (18, false), (17, true), (17, false)];
    assert_eq!(bed.exceptions, told);
}

#[test]
fn a_line_that_stays_up_comes_again() {
    let program = "
        mov r4, #0
        raise #2
        sync
        mark #9
        b stop
        exception_17: adds r4, #1
        str r4, [r10]
        cmp r4, #3
        bne again
        lower #2
        again: bx lr
    ";
    let mut ran = run(&format!("{LEVELS}\n{program}"));
    let bed = ran.processor.surroundings();
    assert_eq!(bed.marks, [1, 2, 3, 9]);
    assert_eq!(bed.exceptions, [(17, true), (17, false)].repeat(3));
}

#[test]
fn a_line_that_rises_in_its_handler_comes_again() {
    let program = "
        mov r4, #0
        raise #2
        sync
        mark #9
        b stop
        exception_17: lower #2
        adds r4, #1
        str r4, [r10]
        cmp r4, #2
        beq done
        raise #2
        sync
        lower #2
        sync
        done: bx lr
    ";
    assert_eq!(leveled(&[program]), [1, 2, 9]);
}

#[test]
fn a_line_that_was_up_for_a_moment_is_taken_once() {
    let program = "
        cpsid i
        raise #2
        sync
        lower #2
        cpsie i
        sync
        mark #9
        b stop
    ";
    assert_eq!(leveled(&[program, HANDLERS]), [1, 9]);
}

#[test]
fn the_lowest_comes_last() {
    let program = "
        mov32 r6, 0xe000ed00
        mov r1, #0xf0
        strb r1, [r6, #0x22]    ; PendSV's priority
        raise #2
        sync
        mark #9
        b stop
        exception_17: lower #2
        mov32 r0, 0x10000000
        str r0, [r6, #4]        ; pends PendSV
        sync
        mark #1
        bx lr
        exception_14: mark #14
        bx lr
    ";
    assert_eq!(leveled(&[program]), [1, 14, 9]);
}

#[test]
fn a_level_between_does_not_wait_for_the_lowest() {
    let program = "
        mov32 r6, 0xe000ed00
        mov r1, #0xf0
        strb r1, [r6, #0x22]
        mov32 r0, 0x10000000
        str r0, [r6, #4]
        sync
        mark #9
        b stop
        exception_14: mark #14
        raise #2
        sync
        mark #0x14
        bx lr
    ";
    assert_eq!(leveled(&[program, HANDLERS]), [14, 1, 0x14, 9]);
}

#[test]
fn the_non_maskable_one_is_above_all() {
    let program = "
        main: mov r1, #1
        mov r2, #0
        cpsid i
        cpsid f
        str r1, [r10, #20]
        sync
        mark #1
        udf 0                   ; the fault escalates to one that FAULTMASK holds: locked up
        exception_2: str r2, [r10, #20]
        mark #2
        bx lr
    ";
    let mut ran = run(program);
    assert_eq!(ran.processor.surroundings().marks, [2, 1]);
    assert_eq!(ran.stop, super::Stop::LockedUp);
    let program = "
        main: mov r1, #1
        mov r2, #0
        udf 0
        exception_3: mark #3
        str r1, [r10, #20]
        sync
        mark #0x33
        b stop
        exception_2: str r2, [r10, #20]
        mark #2
        bx lr
    ";
    assert_eq!(marks(program), [3, 2, 0x33]);
}

#[test]
fn the_non_maskable_line_comes_once_a_time() {
    let program = "
        main: mov r1, #1
        mov r2, #0
        str r1, [r10, #20]
        sync
        mark #9
        b stop
        exception_2: mark #2
        sync
        str r2, [r10, #20]
        bx lr
    ";
    assert_eq!(marks(program), [2, 9]);
}
