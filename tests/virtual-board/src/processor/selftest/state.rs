//! What the processor shows of its state, and that it continues where it was.

use std::iter::repeat_n;

use super::super::{Access, Register};
use super::{RAM, STACK, Stop, assemble, load, marks, run};

#[test]
fn its_registers_can_be_read() {
    let program = "
        main: mov32 r0, 0x20000800
        msr psp, r0
        mov r0, #0x60
        msr basepri, r0
        cpsid i
        mov r0, #0x100
        mov r8, #0x108
        mov r12, #0x10c
        mov32 lr, 0x1010f
        push {r0, r1}
        mov32 r1, 0x60000000
        msr apsr, r1
        b stop
    ";
    let ran = run(program);
    let wanted = [
        (Register::R(0), 0x100),
        (Register::R(8), 0x108),
        (Register::R(10), super::BED),
        (Register::R(12), 0x10c),
        (Register::Sp, STACK - 8),
        (Register::Lr, 0x1010f),
        (Register::Pc, ran.code.labels["halt"]),
        (Register::Xpsr, 0x6100_0000),
        (Register::Msp, STACK - 8),
        (Register::Psp, RAM + 0x800),
        (Register::Primask, 1),
        (Register::Basepri, 0x60),
        (Register::Control, 0),
    ];
    for (register, value) in wanted {
        let found = ran.processor.register(register);
        assert_eq!(found, value, "{register:?}: {found:#x}");
    }
}

#[test]
fn instructions_are_counted() {
    let count = |program: &str| run(program).processor.instructions();
    let straight: String = repeat_n("nop\n", 300).collect();
    let base = count("main: mov r0, #0\nb stop");
    assert_eq!(
        count(&format!("main: mov r0, #0\n{straight}b stop")),
        base + 300
    );
    // 100 turns of a loop; instructions that a condition holds back count too.
    let turns = "
        main: mov r0, #100
        turn: subs r0, #1
        ite eq
        mov r1, #1
        mov r1, #2
        cmp r0, #0
        bne turn
        b stop
    ";
    assert_eq!(count(turns), base + 600);
}

#[test]
fn it_goes_on_where_it_was() {
    let program = "
        main: mark #1
        str r0, [r10, #4]
        sync
        mark #2
        b stop
    ";
    let mut ran = run(program);
    assert_eq!(ran.stop, Stop::Asked);
    assert_eq!(ran.processor.surroundings().marks, [1]);
    ran.processor.surroundings().stopped = false;
    assert_eq!(ran.processor.run(), Stop::Asked);
    assert_eq!(ran.processor.surroundings().marks, [1, 2]);
}

#[test]
fn code_that_the_program_writes_is_executed() {
    let program = "
        main: mov32 r4, 0x20000101
        mov32 r5, 0x20000100
        mov32 r0, 0x47703001    ; adds r0, #1; bx lr
        str r0, [r5]
        dsb
        isb
        mov r0, #0x10
        blx r4
        str r0, [r10]
        mov32 r0, 0x47703801    ; subs r0, #1; bx lr
        str r0, [r5]
        dsb
        isb
        mov r0, #0x10
        blx r4
        str r0, [r10]
        b stop
    ";
    assert_eq!(marks(program), [0x11, 0xf]);
}

#[test]
fn code_that_is_changed_from_outside_is_executed() {
    let program = "
        main: mov32 r4, 0x20000101
        mov32 r5, 0x20000100
        mov32 r0, 0x47703001    ; adds r0, #1; bx lr
        str r0, [r5]
        dsb
        isb
        turn: mov r0, #0x10
        blx r4
        str r0, [r10]
        str r0, [r10, #4]
        b turn
    ";
    let mut ran = run(program);
    assert_eq!(ran.processor.surroundings().marks, [0x11]);
    let code = assemble("subs r0, #2\nbx lr", 0).bytes;
    ran.ram.load(RAM + 0x100, &code);
    ran.processor.forget_code(RAM + 0x100..RAM + 0x104);
    ran.processor.surroundings().stopped = false;
    assert_eq!(ran.processor.run(), Stop::Asked);
    assert_eq!(ran.processor.surroundings().marks, [0x11, 0xe]);
}

#[test]
fn what_is_done_first_with_a_memory_is_told() {
    let ran = watched("str r0, [r4]\nldr r0, [r4]\nldrb r0, [r5]\nstr r0, [r5]");
    assert_eq!(ran, [Some(Access::Write), Some(Access::Read), None]);
}

/// Returns the first access to the words at r4, r5 and r6.
fn watched(body: &str) -> Vec<Option<Access>> {
    let program = format!("main: mov32 r4, 0x20000010\nmov32 r5, 0x20000020\n{body}\nb stop");
    let mut ran = load(&program);
    ran.processor
        .watch(&[0x10, 0x20, 0x30].map(|at| RAM + at..RAM + at + 4));
    assert_eq!(ran.processor.run(), Stop::Asked);
    ran.processor.first_accesses().to_vec()
}
