//! Start-up before memory is initialised: copies the control code to where flash erases cannot stall it, and
//! clears its state.

use core::arch::global_asm;

// The addresses are multiples of four. Uses no memory but what it copies and clears.
global_asm!(
    // Copies from r2 to [r0, r1); a part that runs where it is loaded needs no copy.
    ".macro copy_part part",
    "ldr r0, =\\part",
    "ldr r1, =\\part\\()_end",
    "ldr r2, =\\part\\()_load",
    "cmp r0, r2",
    "beq 1f",
    "0: cmp r0, r1",
    "beq 1f",
    "ldm r2!, {{r3}}",
    "stm r0!, {{r3}}",
    "b 0b",
    "1:",
    ".endm",
    ".section .Reset, \"ax\"",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    // The first write to a memory after a reset may be lost unless it has been read (ES0431): SRAM1, SRAM2 and
    // CCM SRAM of the G431. The F405 has memory there too.
    "ldr r0, =0x20000000",
    "ldr r1, [r0]",
    "ldr r0, =0x20004000",
    "ldr r1, [r0]",
    "ldr r0, =0x10000000",
    "ldr r1, [r0]",
    "copy_part __control",
    "copy_part __control_more",
    "copy_part __control_rest",
    "ldr r0, =__control_state",
    "ldr r1, =__control_state_end",
    "movs r2, #0",
    "2: cmp r0, r1",
    "beq 3f",
    "stm r0!, {{r2}}",
    "b 2b",
    "3: bx lr",
    ".ltorg",
);
