//! SysTick and the cycle counter (B3.3, C1.8), and the time that flash takes.

use super::{LATER, marks};
use crate::time::Cycles;

#[test]
fn systick_tells_once_that_it_counted_down() {
    let program = "
        main: mov32 r6, 0xe000e010
        mov r1, #300
        str r1, [r6, #4]
        str r1, [r6, #8]
        mov r1, #5              ; without its interrupt
        str r1, [r6]
        mov32 r5, 0x10000
        wait: ldr r0, [r6]
        cmp r0, #5
        beq wait
        str r0, [r10]
        ldr r0, [r6]
        str r0, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0x1_0005, 5]);
}

#[test]
fn systick_interrupts_at_its_period() {
    let program = "
        main: mov32 r0, 0xe000edfc
        mov32 r1, 0x01000000
        str r1, [r0]
        mov32 r7, 0xe0001000
        ldr r1, [r7]
        mov r2, #1
        orrs r1, r2
        str r1, [r7]
        mov32 r6, 0xe000e010
        mov r1, #999
        str r1, [r6, #4]
        str r1, [r6, #8]
        mov r4, #0
        mov r1, #7
        str r1, [r6]
        wait: b wait
        exception_15: ldr r0, [r7, #4]
        str r0, [r10]
        adds r4, #1
        cmp r4, #9
        beq stop
        bx lr
    ";
    let marks = marks(program);
    let (first, last) = (marks[0], marks[8]);
    assert_eq!(marks.len(), 9);
    // The entry may be an instruction or two early or late.
    let eight = last.wrapping_sub(first);
    assert!(eight.abs_diff(8_000) < 40, "{eight}");
}

#[test]
fn systick_counts_down_from_its_reload() {
    let program = "
        main: mov32 r6, 0xe000e010
        mov32 r1, 0x12345678
        str r1, [r6, #4]
        str r1, [r6, #8]        ; any write clears it
        ldr r0, [r6, #8]
        str r0, [r10]
        ldr r0, [r6, #4]
        str r0, [r10]
        mov r1, #5
        str r1, [r6]
        sync
        ldr r0, [r6, #8]
        str r0, [r10]
        ldr r0, [r6, #8]
        str r0, [r10]
        b stop
    ";
    let marks = marks(program);
    assert_eq!(marks[..2], [0, 0x34_5678]);
    assert!((0x34_5600..=0x34_5678).contains(&marks[2]), "{marks:x?}");
    assert!(marks[3] < marks[2], "{marks:x?}");
}

#[test]
fn systick_stops() {
    let program = "
        main: mov32 r6, 0xe000e010
        mov r1, #5000
        str r1, [r6, #4]
        str r1, [r6, #8]
        mov r1, #5
        str r1, [r6]
        sync
        mov r1, #4
        str r1, [r6]
        ldr r0, [r6, #8]
        str r0, [r10]
        sync
        ldr r0, [r6, #8]
        str r0, [r10]
        b stop
    ";
    let marks = marks(program);
    assert_eq!(marks[0], marks[1]);
    assert!(marks[0] > 0);
}

#[test]
fn the_cycle_counter_counts_while_enabled() {
    let program = "
        main: mov32 r7, 0xe0001000
        mov32 r0, 0xe000edfc
        mov32 r1, 0x01000000
        str r1, [r0]            ; TRCENA
        mov r1, #100
        str r1, [r7, #4]
        sync
        ldr r0, [r7, #4]
        str r0, [r10]           ; not enabled yet
        ldr r1, [r7]
        mov r2, #1
        orrs r1, r2
        str r1, [r7]
        mov r0, #200
        count: subs r0, #1
        bne count
        ldr r0, [r7, #4]
        str r0, [r10]
        mov r1, #0
        str r1, [r7, #4]
        ldr r0, [r7, #4]
        str r0, [r10]
        b stop
    ";
    let marks = marks(program);
    assert_eq!(marks[0], 100);
    // 200 turns of two instructions, at two to five cycles.
    assert!((500..=1_200).contains(&marks[1]), "{marks:?}");
    assert!(marks[2] < 20, "{marks:?}");
}

#[test]
fn code_in_flash_waits_while_that_is_busy() {
    let program = "
        main: mov32 r7, 0xe0001000
        mov32 r0, 0xe000edfc
        mov32 r1, 0x01000000
        str r1, [r0]
        ldr r1, [r7]
        mov r2, #1
        orrs r1, r2
        str r1, [r7]
        mov32 r0, routine
        mov32 r1, 0x20000100
        mov r2, #32
        copy: ldr r3, [r0]
        str r3, [r1]
        adds r0, #4
        adds r1, #4
        subs r2, #4
        bne copy
        mov32 r4, 0x20000101
        ldr r0, [r7, #4]
        str r0, [r10]
        blx r4
        ldr r0, [r7, #4]
        str r0, [r10]
        b stop
        routine: str r0, [r10, #24]
        sync
        ldr r0, [r7, #4]
        str r0, [r10]
        bx lr
    ";
    let marks = marks(program);
    let (in_memory, in_flash) = (marks[1] - marks[0], marks[2] - marks[0]);
    assert!(in_memory < 100, "{in_memory}");
    assert!(Cycles::from(in_flash).abs_diff(LATER) < 100, "{in_flash}");
}
