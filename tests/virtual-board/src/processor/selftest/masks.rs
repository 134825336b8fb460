//! What the masks hold back (B1.4.3).

use super::marks;

/// Enables interrupts 1 to 3 with their priorities, and provides their handlers.
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
    b body
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

fn told(body: &str) -> Vec<u32> {
    marks(&format!("{LEVELS}\nbody: {body}"))
}

#[test]
fn primask_holds_interrupts() {
    let body = "cpsid i
        raise #2
        sync
        mark #9
        mrs r0, primask
        str r0, [r10]
        cpsie i
        sync
        mrs r0, primask
        str r0, [r10]
        b stop
    ";
    assert_eq!(told(body), [9, 1, 1, 0]);
}

#[test]
// The engine keeps the four bits that the chip does not have.
#[should_panic = "assertion `left == right` failed"]
fn basepri_holds_its_priority_and_lower() {
    let body = "mov r1, #0x2f
        msr basepri, r1
        raise #0xe
        sync
        mrs r0, basepri
        str r0, [r10]
        mov r1, #0
        msr basepri, r1
        sync
        mark #9
        b stop
    ";
    assert_eq!(told(body), [3, 0x20, 2, 1, 9]);
}

#[test]
fn basepri_max_only_rises() {
    let body = "mov r1, #0x30
        msr basepri_max, r1
        mov r1, #0x20
        msr basepri_max, r1
        mov r1, #0x30
        msr basepri_max, r1
        mov r1, #0
        msr basepri_max, r1
        mrs r0, basepri
        str r0, [r10]
        b stop
    ";
    assert_eq!(told(body), [0x20]);
}

#[test]
fn faultmask_holds_until_the_return() {
    let handler = "
        main: mov32 r0, 0xe000e100
        mov r1, #0xffff
        str r1, [r0]
        mov32 r0, 0xe000e400
        mov r1, #0x30
        strb r1, [r0, #1]
        raise #2
        sync
        mrs r0, faultmask
        str r0, [r10]
        b stop
        exception_17: lower #2
        cpsid f
        raise #8                ; more urgent
        sync
        mrs r0, faultmask
        str r0, [r10]
        mark #1
        bx lr
        exception_19: lower #8
        mark #3
        bx lr
    ";
    assert_eq!(marks(handler), [1, 1, 3, 0]);
}

#[test]
fn a_masked_call_to_the_supervisor_is_a_hard_fault() {
    let body = "cpsid i
        svc 0
        mark #9
        b stop
        exception_11: mark #11
        bx lr
        exception_3: mrs r0, ipsr
        str r0, [r10]
        mov32 r0, 0xe000ed2c
        ldr r1, [r0]
        str r1, [r10]
        b stop
    ";
    assert_eq!(told(body), [3, 0x4000_0000]);
}
