//! The registers of the interrupt controller and the system (B3.2, B3.4).

use super::marks;

#[test]
fn enables_are_set_and_cleared_by_bits() {
    let program = "
        main: mov32 r0, 0xe000e100
        mov r1, #0xf0
        str r1, [r0]
        mov r1, #0x0f
        str r1, [r0]
        ldr r1, [r0]
        str r1, [r10]
        mov r1, #0x3c
        str r1, [r0, #128]
        ldr r1, [r0]
        str r1, [r10]
        ldr r1, [r0, #128]
        str r1, [r10]
        mov r1, #8
        str r1, [r0, #4]
        ldr r1, [r0, #4]
        str r1, [r10]
        ldr r1, [r0, #8]
        str r1, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0xff, 0xc3, 0xc3, 8, 0]);
}

#[test]
fn pending_is_set_and_cleared_by_bits() {
    let program = "
        main: mov32 r0, 0xe000e200
        mov r1, #6
        str r1, [r0]            ; not enabled
        ldr r1, [r0]
        str r1, [r10]
        mov r1, #2
        str r1, [r0, #128]
        ldr r1, [r0]
        str r1, [r10]
        ldr r1, [r0, #128]
        str r1, [r10]
        mov32 r2, 0xe000e100
        mov r1, #6
        str r1, [r2]
        sync
        mark #9
        b stop
        exception_17: mark #1
        bx lr
        exception_18: mark #2
        bx lr
    ";
    assert_eq!(marks(program), [6, 4, 4, 2, 9]);
}

#[test]
fn a_priority_is_a_byte_of_four_bits() {
    let program = "
        main: mov32 r0, 0xe000e400
        mov r1, #0xff
        strb r1, [r0, #5]
        mov r1, #0x5a
        strb r1, [r0, #6]
        ldr r1, [r0, #4]
        str r1, [r10]
        ldrb r1, [r0, #6]
        str r1, [r10]
        mov32 r1, 0x10203040
        str r1, [r0, #8]
        ldrh r1, [r0, #10]
        str r1, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0x0050_f000, 0x50, 0x1020]);
}

#[test]
fn a_system_priority_is_a_byte() {
    let program = "
        main: mov32 r0, 0xe000ed18
        mov r1, #0xff
        strb r1, [r0, #10]      ; PendSV
        mov r1, #0x21
        strb r1, [r0, #11]      ; SysTick
        mov r1, #0x80
        strb r1, [r0, #7]       ; SVCall
        ldr r1, [r0, #8]
        str r1, [r10]
        ldr r1, [r0, #4]
        str r1, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0x20f0_0000, 0x8000_0000]);
}

#[test]
fn it_tells_what_is_pending() {
    let program = "
        main: mov32 r6, 0xe000ed00
        cpsid i
        ldr r0, [r6, #4]
        str r0, [r10]
        mov32 r0, 0xe000e100
        mov r1, #0x20
        str r1, [r0]
        raise #0x30             ; 4 is not enabled
        sync
        ldr r0, [r6, #4]
        str r0, [r10]
        b stop
    ";
    // RETTOBASE has no meaning in a thread.
    let told: Vec<u32> = marks(program)
        .iter()
        .map(|mark| mark & !(1 << 11))
        .collect();
    assert_eq!(told, [0, 1 << 22 | 21 << 12]);
}

/// Interrupts 1 and 2, the second more urgent, nest; both report ICSR and which are active.
const NESTED: &str = "
    main: mov32 r0, 0xe000e100
    mov r1, #6
    str r1, [r0]
    mov32 r0, 0xe000e400
    mov r1, #0x30
    strb r1, [r0, #1]
    mov32 r6, 0xe000ed00
    mov32 r7, 0xe000e300
    raise #2
    sync
    b stop
    exception_17: push {r4, lr}
    lower #2
    ldr r0, [r6, #4]
    str r0, [r10]
    ldr r0, [r7]
    str r0, [r10]
    raise #4
    sync
    pop {r4, pc}
    exception_18: lower #4
    ldr r0, [r6, #4]
    str r0, [r10]
    ldr r0, [r7]
    str r0, [r10]
    bx lr
";

#[test]
fn it_tells_what_is_active() {
    let marks = marks(NESTED);
    assert_eq!([marks[1], marks[3]], [2, 6]);
    // RETTOBASE.
    assert_eq!([marks[0] >> 11 & 1, marks[2] >> 11 & 1], [1, 0]);
}

#[test]
fn it_tells_which_exception_is_active() {
    let marks = marks(NESTED);
    assert_eq!([marks[0] & 0x1ff, marks[2] & 0x1ff], [17, 18]);
}

#[test]
fn pendsv_is_set_and_cleared() {
    let program = "
        main: mov32 r6, 0xe000ed00
        cpsid i
        mov32 r0, 0x14000000    ; PendSV and SysTick
        str r0, [r6, #4]
        ldr r0, [r6, #4]
        str r0, [r10]
        mov32 r0, 0x0a000000
        str r0, [r6, #4]
        ldr r0, [r6, #4]
        str r0, [r10]
        cpsie i
        sync
        mov32 r0, 0x10000000
        str r0, [r6, #4]
        sync
        mark #9
        b stop
        exception_14: mark #14
        bx lr
    ";
    let marks = marks(program);
    let pending = 1 << 28 | 1 << 26;
    assert_eq!([marks[0] & pending, marks[1] & pending], [pending, 0]);
    assert_eq!(marks[0] >> 12 & 0x1ff, 14, "VECTPENDING");
    assert_eq!(marks[2..], [14, 9]);
}

#[test]
fn the_trigger_register_pends() {
    let program = "
        main: mov32 r0, 0xe000e100
        mov r1, #4
        str r1, [r0]
        mov32 r0, 0xe000ef00
        mov r1, #2
        str r1, [r0]
        sync
        mark #9
        b stop
        exception_18: mark #2
        bx lr
    ";
    assert_eq!(marks(program), [2, 9]);
}

#[test]
fn the_vector_table_moves_to_memory() {
    let program = "
        main: mov32 r0, 0x20000200
        mov32 r1, =moved
        str r1, [r0, #68]       ; interrupt 1
        mov32 r6, 0xe000ed00
        str r0, [r6, #8]
        ldr r1, [r6, #8]
        str r1, [r10]
        mov32 r0, 0xe000e100
        mov r1, #2
        str r1, [r0]
        dsb
        raise #2
        sync
        mark #9
        b stop
        exception_17: mark #1
        b stop
        moved: lower #2
        mark #2
        bx lr
    ";
    assert_eq!(marks(program), [0x2000_0200, 2, 9]);
}

#[test]
fn it_is_a_cortex_m4() {
    let program = "
        main: mov32 r6, 0xe000ed00
        ldr r0, [r6]
        str r0, [r10]
        b stop
    ";
    assert_eq!(marks(program)[0], 0x410f_c241);
}
