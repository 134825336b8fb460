//! What sleeps and what wakes it (B1.5.18, B1.5.19).

use super::{END, LATER, marks, run};

/// Enables interrupts 1 and 2, the second more urgent, with their handlers.
const LINES: &str = "
    main: mov32 r0, 0xe000e100
    mov r1, #6
    str r1, [r0]
    mov32 r0, 0xe000e400
    mov r1, #0x30
    strb r1, [r0, #1]
    mov r1, #0x20
    strb r1, [r0, #2]
    mov r1, #1
    mov r2, #2
    mov r3, #3
    b body
    exception_17: lower #2
    mark #1
    bx lr
    exception_18: lower #4
    mark #2
    bx lr
";

fn told(body: &str) -> Vec<u32> {
    marks(&format!("{LINES}\nbody: {body}"))
}

/// Runs a program that sleeps forever; returns its marks.
fn slept(body: &str) -> Vec<u32> {
    let mut ran = run(&format!("{LINES}\nbody: {body}"));
    let bed = ran.processor.surroundings();
    assert!(bed.now >= END, "woke: {:x?}", bed.marks);
    bed.marks.clone()
}

#[test]
fn an_interrupt_wakes_and_is_taken() {
    let body = "str r1, [r10, #16]
        wfi
        mark #9
        b stop
    ";
    assert_eq!(told(body), [1, 9]);
}

#[test]
fn a_masked_interrupt_wakes_and_waits() {
    let body = "cpsid i
        str r1, [r10, #16]
        wfi
        mark #9
        cpsie i
        sync
        b stop
    ";
    assert_eq!(told(body), [9, 1]);
}

#[test]
fn one_below_basepri_does_not_wake() {
    let body = "mov r4, #0x30
        msr basepri, r4
        raise #2
        str r2, [r10, #16]
        wfi
        mark #9
        b stop
    ";
    assert_eq!(told(body), [2, 9]);
}

#[test]
fn one_that_is_not_enabled_does_not_wake() {
    let body = "raise #8
        wfi
        mark #9
        b stop
    ";
    assert!(slept(body).is_empty());
}

#[test]
fn an_event_that_was_is_not_slept_over() {
    let body = "sev
        wfe
        mark #9
        str r1, [r10, #16]
        wfe
        mark #0x99
        b stop
    ";
    assert_eq!(told(body), [9, 1, 0x99]);
}

#[test]
fn the_return_from_an_exception_is_an_event() {
    let body = "svc 0
        wfe
        mark #9
        wfe
        mark #0x99
        b stop
        exception_11: bx lr
    ";
    assert_eq!(slept(body), [9]);
}

#[test]
fn a_masked_interrupt_is_no_event() {
    let body = "cpsid i
        str r1, [r10, #16]
        wfe
        mark #9
        b stop
    ";
    assert!(slept(body).is_empty());
}

#[test]
fn a_masked_interrupt_can_be_made_an_event() {
    let body = "mov32 r0, 0xe000ed10
        mov r4, #0x10
        str r4, [r0]            ; SEVONPEND
        cpsid i
        str r3, [r10, #16]      ; not even enabled
        wfe
        mark #9
        b stop
    ";
    assert_eq!(told(body), [9]);
}

#[test]
fn sleep_lasts_until_the_line_rises() {
    let body = "str r1, [r10, #16]
        wfi
        b stop
    ";
    let mut ran = run(&format!("{LINES}\nbody: {body}"));
    let instructions = ran.processor.instructions();
    let bed = ran.processor.surroundings();
    assert_eq!(bed.marks, [1]);
    assert!((LATER..LATER + 500).contains(&bed.now), "{}", bed.now);
    assert!(instructions < 60, "{instructions}");
}

#[test]
fn systick_wakes() {
    let body = "mov32 r0, 0xe000e010
        mov r4, #2000
        str r4, [r0, #4]
        str r4, [r0, #8]
        mov r4, #7
        str r4, [r0]
        wfi
        mark #9
        b stop
        exception_15: mark #15
        bx lr
    ";
    assert_eq!(told(body), [15, 9]);
}
