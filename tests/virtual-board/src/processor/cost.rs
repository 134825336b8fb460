//! What code costs: an estimate of a Cortex-M4's cycles at 170 MHz, by
//! [the processor's table](super#what-code-costs).

use std::ops::Range;

use super::flash_cache::{Cache, WAIT_STATES, WORD_BYTES};

/// Cycles from a request to the first instruction of the handler, including stacking.
pub const ENTRY: u64 = 12;
/// Cycles to return.
pub(super) const RETURN: u64 = 10;
/// Cycles from one handler to the next.
pub(super) const TAIL_CHAIN: u64 = 6;

/// Pipeline refill.
const REFILL: u16 = 2;

/// Where the chip's code may lie, by cost.
const FLASH: Range<u32> = 0x0800_0000..0x0802_0000;
const CCM: Range<u32> = 0x1000_0000..0x1000_2800;
const SRAM: Range<u32> = 0x2000_0000..0x2000_8000;

/// A stretch of code that ends with a branch.
#[derive(Clone, Debug)]
pub(super) struct Block {
    bytes: u32,
    /// Instructions.
    pub(super) instructions: u32,
    /// Cycles without flash wait states.
    cycles: u32,
    /// Cycles before each of its half-words.
    before: Box<[u16]>,
    /// Constants in flash that it loads PC-relative.
    constants: Box<[u32]>,
    /// Whether it contains a SEV.
    pub(super) sends_event: bool,
}

/// The blocks seen so far, and the caches.
pub(super) struct Costs {
    blocks: Vec<Block>,
    /// Number plus one of the block that begins at each half-word of flash, CCM and SRAM; 0 is none.
    index: [Vec<u32>; 3],
    instructions: Cache<32>,
    constants: Cache<8>,
    /// Where the latest block ended.
    end: u32,
}

impl Costs {
    pub(super) fn new() -> Self {
        let index = [FLASH, CCM, SRAM].map(|range| vec![0; range.len() / 2]);
        Self {
            blocks: Vec::new(),
            index,
            instructions: Cache::new(),
            constants: Cache::new(),
            end: 0,
        }
    }

    /// Forgets what it knows about the code.
    pub(super) fn forget(&mut self) {
        self.blocks.clear();
        for index in &mut self.index {
            index.fill(0);
        }
    }

    /// Returns the number of the block of `bytes` bytes at this address, and its current cost.
    pub(super) fn enter(
        &mut self,
        address: u32,
        bytes: u32,
        prefetches: bool,
        code: impl FnOnce() -> Vec<u8>,
    ) -> (usize, u32) {
        let (region, origin) = match address {
            _ if FLASH.contains(&address) => (0, FLASH.start),
            _ if CCM.contains(&address) => (1, CCM.start),
            _ => (2, SRAM.start),
        };
        let at = (address.wrapping_sub(origin) / 2) as usize;
        let known = self.index[region].get(at).copied().unwrap_or(0) as usize;
        let number = if known != 0 && self.blocks[known - 1].bytes == bytes {
            known - 1
        } else {
            self.blocks.push(Block::of(address, &code()));
            if let Some(entry) = self.index[region].get_mut(at) {
                *entry = self.blocks.len() as u32;
            }
            self.blocks.len() - 1
        };
        let block = &self.blocks[number];
        let waits = match region {
            0 => {
                let misses = self.instructions.fetch(address, address + bytes);
                let goes_on = self.end == address;
                if prefetches {
                    block.waits_behind_prefetch(misses, goes_on)
                } else {
                    misses * WAIT_STATES
                }
            }
            1 => 0,
            _ => bytes.div_ceil(4),
        };
        self.end = address + bytes;
        let mut cycles = block.cycles + waits;
        for constant in &block.constants {
            cycles += self.constants.fetch(*constant, constant + 4) * WAIT_STATES;
        }
        (number, cycles)
    }

    pub(super) fn block(&self, number: usize) -> &Block {
        &self.blocks[number]
    }
}

impl Block {
    fn of(address: u32, code: &[u8]) -> Self {
        let half = |at: usize| match code.get(at..at + 2) {
            Some(bytes) => u16::from_le_bytes([bytes[0], bytes[1]]),
            None => 0,
        };
        let mut block = Self {
            bytes: code.len() as u32,
            instructions: 0,
            cycles: 0,
            before: Box::default(),
            constants: Box::default(),
            sends_event: false,
        };
        let mut before = Vec::with_capacity(code.len() / 2);
        let mut constants = Vec::new();
        let mut at = 0;
        while at < code.len() {
            let first = half(at);
            before.push(block.cycles as u16);
            let cost = if is_wide(first) {
                before.push(block.cycles as u16);
                wide(first, half(at + 2))
            } else {
                narrow(first)
            };
            block.instructions += 1;
            block.cycles += u32::from(cost);
            block.sends_event |= first == 0xbf40;
            let pc = address + at as u32;
            constants.extend(constant(pc, first, half(at + 2)));
            at += if is_wide(first) { 4 } else { 2 };
        }
        constants.retain(|constant| FLASH.contains(constant));
        block.before = before.into();
        block.constants = constants.into();
        block
    }

    /// Returns the cycles that it waits for `misses` double words not in the cache, with the prefetch: a
    /// full read for the first, unless execution continues from the code before, and for each of the others
    /// what is left of a read when the previous double word has been executed.
    fn waits_behind_prefetch(&self, misses: u32, goes_on: bool) -> u32 {
        let words = self.bytes.div_ceil(WORD_BYTES).max(1);
        let left = (WAIT_STATES + 1).saturating_sub(self.cycles / words);
        let asked = u32::from(misses > 0 && !goes_on);
        asked * WAIT_STATES + (misses - asked) * left.min(WAIT_STATES)
    }

    /// Returns the block's cycles before the instruction at this offset.
    pub(super) fn before(&self, offset: u32) -> u32 {
        let before = self.before.get(offset as usize / 2);
        before.map_or(self.cycles, |cycles| u32::from(*cycles))
    }
}

/// Returns whether an instruction has a second half.
fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Returns the cycles of a 16-bit instruction.
fn narrow(code: u16) -> u16 {
    match code >> 12 {
        // PC-relative LDR; BX and BLX.
        0b0100 if code & 0x0800 != 0 => 2,
        0b0100 if code & 0x0700 == 0x0700 => 1 + REFILL,
        // By register: STR, STRH, STRB, LDRSB; LDR, LDRH, LDRB, LDRSH.
        0b0101 if code & 0x0e00 >= 0x0600 => 2,
        0b0110..=0b1001 if code & 0x0800 != 0 => 2,
        0b1011 => match code & 0x0f00 {
            // CBZ and CBNZ.
            0x0100 | 0x0300 | 0x0900 | 0x0b00 => 1 + REFILL,
            // PUSH, POP and POP with PC.
            0x0400 | 0x0500 | 0x0c00 => 1 + (code & 0x1ff).count_ones() as u16,
            0x0d00 if code & 0x100 != 0 => 1 + (code & 0x1ff).count_ones() as u16 + REFILL,
            0x0d00 => 1 + (code & 0xff).count_ones() as u16,
            _ => 1,
        },
        // STM and LDM.
        0b1100 => 1 + (code & 0xff).count_ones() as u16,
        // B, conditional or not.
        0b1101 | 0b1110 => 1 + REFILL,
        _ => 1,
    }
}

/// Returns the cycles of a 32-bit instruction.
fn wide(first: u16, second: u16) -> u16 {
    let several = |registers: u16| 1 + registers.count_ones() as u16;
    match first >> 9 & 0x3f {
        // LDM and STM; LDRD, STRD, the exclusives, TBB.
        _ if first & 0xfe40 == 0xe800 => {
            let to_pc = first & 0x10 != 0 && second & 0x8000 != 0;
            several(second) + if to_pc { REFILL } else { 0 }
        }
        _ if first & 0xfff0 == 0xe8d0 && second & 0xffe0 == 0xf000 => 2 + REFILL,
        _ if first & 0xfe40 == 0xe840 => {
            let exclusive = first & 0x0120 == 0 || first & 0xffe0 == 0xe8c0;
            if exclusive { 2 } else { 3 }
        }
        // Branches, special registers, barriers.
        _ if first & 0xf800 == 0xf000 && second & 0x8000 != 0 => {
            let special = second & 0xd000 == 0x8000 && first & 0x0380 == 0x0380;
            if special { 2 } else { 1 + REFILL }
        }
        // Single loads and stores.
        _ if first & 0xfe10 == 0xf810 => 2,
        // Divisions.
        _ if first & 0xffd0 == 0xfb90 && second & 0xf0 == 0xf0 => 7,
        // Floating point: several registers, one, arithmetic.
        _ if first & 0xee00 == 0xec00 && second & 0x0e00 == 0x0a00 => {
            if first & 0x0f00 == 0x0d00 {
                if first & 0x10 != 0 { 2 } else { 1 }
            } else {
                1 + (second & 0xff)
            }
        }
        _ if first & 0xef00 == 0xee00 && second & 0x0e10 == 0x0a00 => float(first, second),
        _ => 1,
    }
}

/// Returns the cycles of a floating-point arithmetic instruction.
fn float(first: u16, second: u16) -> u16 {
    match first & 0xb0 {
        0x80 => 14,
        0xb0 if first & 0xf == 1 && second & 0xc0 == 0xc0 => 14,
        // Multiply and add or subtract, with one or two roundings.
        0x00 | 0x10 | 0x90 | 0xa0 => 3,
        _ => 1,
    }
}

/// Returns the address of the constant that an instruction loads PC-relative.
fn constant(pc: u32, first: u16, second: u16) -> Option<u32> {
    let base = (pc + 4) & !3;
    if first & 0xf800 == 0x4800 {
        return Some(base + 4 * u32::from(first & 0xff));
    }
    // 32-bit LDR and VLDR.
    let (offset, matches) = match first {
        0xf85f | 0xf8df => (u32::from(second & 0xfff), true),
        _ => (
            4 * u32::from(second & 0xff),
            first & 0xff3f == 0xed1f && second & 0x0f00 == 0x0a00,
        ),
    };
    let up = first & 0x80 != 0;
    matches.then(|| if up { base + offset } else { base - offset })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(code: &[u16]) -> u32 {
        let bytes: Vec<_> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let block = Block::of(CCM.start, &bytes);
        assert_eq!(block.instructions, 1, "{code:04x?}");
        block.cycles
    }

    /// By the manual's table (DDI 0439), with this module's figures where it gives a range.
    #[test]
    fn instructions_cost_what_the_manual_says() {
        for (code, cycles, what) in [
            (&[0x1840][..], 1, "adds r0, r0, r1"),
            (&[0x4348], 1, "muls r0, r1"),
            (&[0x6801], 2, "ldr r1, [r0]"),
            (&[0x6001], 1, "str r1, [r0]"),
            (&[0x5842], 2, "ldr r2, [r0, r1]"),
            (&[0x5042], 1, "str r2, [r0, r1]"),
            (&[0x5642], 2, "ldrsb r2, [r0, r1]"),
            (&[0x4801], 2, "ldr r0, [pc, #4]"),
            (&[0xb5f0], 6, "push {r4-r7, lr}"),
            (&[0xbdf0], 8, "pop {r4-r7, pc}"),
            (&[0xb110], 3, "cbz r0, ."),
            (&[0x4770], 3, "bx lr"),
            (&[0xd0fe], 3, "beq ."),
            (&[0xc807], 4, "ldm r0!, {r0-r2}"),
            (&[0xe8bd, 0x81f0], 9, "pop.w {r4-r8, pc}"),
            (&[0xe9d0, 0x1200], 3, "ldrd r1, r2, [r0]"),
            (&[0xe9c0, 0x1200], 3, "strd r1, r2, [r0]"),
            (&[0xe850, 0x1f00], 2, "ldrex r1, [r0]"),
            (&[0xf000, 0xf800], 3, "bl ."),
            (&[0xf3ef, 0x8010], 2, "mrs r0, primask"),
            (&[0xf3bf, 0x8f4f], 2, "dsb"),
            (&[0xf8d0, 0x1004], 2, "ldr.w r1, [r0, #4]"),
            (&[0xf8c0, 0x1004], 1, "str.w r1, [r0, #4]"),
            (&[0xfb90, 0xf0f1], 7, "sdiv r0, r0, r1"),
            (&[0xfb80, 0x2301], 1, "smull r2, r3, r0, r1"),
            (&[0xee30, 0x0a20], 1, "vadd.f32 s0, s0, s1"),
            (&[0xee80, 0x0a20], 14, "vdiv.f32 s0, s0, s1"),
            (&[0xeeb1, 0x0ac0], 14, "vsqrt.f32 s0, s0"),
            (&[0xeea0, 0x0a20], 3, "vfma.f32 s0, s0, s1"),
            (&[0xed90, 0x0a00], 2, "vldr s0, [r0]"),
            (&[0xec90, 0x0a04], 5, "vldmia r0, {s0-s3}"),
        ] {
            assert_eq!(cost(code), cycles, "{what}");
        }
    }

    #[test]
    fn code_in_flash_waits_for_itself_and_for_its_constants() {
        let code: Vec<u8> = [0x4801_u16, 0x4770, 0, 0, 0, 0]
            .iter()
            .flat_map(|half| half.to_le_bytes())
            .collect();
        let mut costs = Costs::new();
        let mut enter = |address| costs.enter(address, 4, false, || code[..4].to_vec()).1;
        // 2 and 3, plus two double words: the code's, and the constant's at 8.
        assert_eq!(enter(0x0800_0000), 5 + 4 + 4);
        assert_eq!(enter(0x0800_0000), 5);
        assert_eq!(enter(0x1000_0000), 5);
        assert_eq!(enter(0x2000_0000), 5 + 1);
    }
}
