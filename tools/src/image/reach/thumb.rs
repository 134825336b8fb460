//! Where instructions lead: the Thumb-2 branches and calls (Armv7-M manual, chapter A7.7).

use super::registers::Registers;

/// Where execution continues after an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Branch {
    /// At this address.
    To(u32),
    /// Wherever a register or memory says; returns excepted. With the place of the word or `movt` from which
    /// the register was loaded, if known.
    Computed(Option<u32>),
}

const LINK: u16 = 14;
const STACK: u16 = 13;

/// Returns the branches among the instructions that begin at an address, in order.
pub(super) fn branches(begin: u32, code: &[u8]) -> Vec<Branch> {
    let halves: Vec<u16> = code
        .chunks_exact(2)
        .map(|half| u16::from_le_bytes([half[0], half[1]]))
        .collect();
    let (mut found, mut at, mut registers) = (Vec::new(), 0, Registers::default());
    while let Some(&first) = halves.get(at) {
        // The PC value that offsets count from.
        let here = begin + 2 * at as u32 + 4;
        let second = halves.get(at + 1).copied().unwrap_or(0);
        let is_wide = first >> 11 > 0b11100;
        found.extend(if is_wide {
            registers.wide(here, first, second);
            wide(here, first, second)
        } else {
            registers.narrow(here, first);
            narrow(here, first, &registers)
        });
        if is_call(is_wide, first, second) {
            registers.called();
        }
        at += 1 + usize::from(is_wide);
    }
    found
}

/// bl, or blx with a register.
fn is_call(is_wide: bool, first: u16, second: u16) -> bool {
    if is_wide {
        first & 0xF800 == 0xF000 && second & 0xD000 == 0xD000
    } else {
        first & 0xFF80 == 0x4780
    }
}

fn narrow(here: u32, code: u16, registers: &Registers) -> Option<Branch> {
    match code {
        // Conditional b; the last two of the 16 conditions encode other instructions.
        0xD000..=0xDDFF => Some(Branch::To(moved(here, code, 8))),
        0xE000..=0xE7FF => Some(Branch::To(moved(here, code, 11))),
        // bx, blx.
        0x4700..=0x47FF => {
            let register = code >> 3 & 15;
            (register != LINK).then(|| Branch::Computed(registers.get(register)))
        }
        // mov pc.
        _ if code & 0xFF87 == 0x4687 => Some(Branch::Computed(registers.get(code >> 3))),
        _ => None,
    }
}

fn wide(here: u32, first: u16, second: u16) -> Option<Branch> {
    // ldr pc; from the stack it is a return.
    if first & 0xFF70 == 0xF850 && second >> 12 == 15 {
        return (first & 15 != STACK).then_some(Branch::Computed(None));
    }
    if first & 0xF800 != 0xF000 || second & 0x8000 == 0 {
        return None;
    }
    let bit = |half: u16, number: u32| u32::from(half >> number & 1);
    let (sign, j1, j2) = (bit(first, 10), bit(second, 13), bit(second, 11));
    let low = u32::from(second & 0x7FF) << 1;
    match second & 0x5000 {
        // Conditional b, which the other instructions of this form are not.
        0 if first >> 7 & 7 != 7 => {
            let offset = sign << 20 | j2 << 19 | j1 << 18 | u32::from(first & 0x3F) << 12 | low;
            Some(Branch::To(here.wrapping_add(signed(offset, 21))))
        }
        // b, bl.
        0x1000 | 0x5000 => {
            let [i1, i2] = [j1, j2].map(|j| 1 ^ j ^ sign);
            let offset = sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3FF) << 12 | low;
            Some(Branch::To(here.wrapping_add(signed(offset, 25))))
        }
        _ => None,
    }
}

/// Adds the offset in an instruction's lowest bits, which counts half-words.
fn moved(here: u32, code: u16, bits: u32) -> u32 {
    here.wrapping_add(signed(u32::from(code) << 1, bits + 1))
}

/// Sign-extends the lowest `bits` of a number.
fn signed(value: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    ((value << unused) as i32 >> unused) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branches_are_found_among_other_instructions() {
        // As assembled by GNU as, at 0x1000.
        let code: [(&[u16], Option<Branch>); 17] = [
            (&[0xB510], None),                                 // push {r4, lr}
            (&[0xF000, 0xF87D], Some(Branch::To(0x1100))),     // bl 0x1100
            (&[0xF7FF, 0xFF7B], Some(Branch::To(0x0F00))),     // bl 0x0f00
            (&[0xF000, 0xB879], Some(Branch::To(0x1100))),     // b.w 0x1100
            (&[0xF000, 0x8077], Some(Branch::To(0x1100))),     // beq.w 0x1100
            (&[0xF3EF, 0x8009], None),                         // mrs r0, psp
            (&[0xD0FE], Some(Branch::To(0x1016))),             // beq .
            (&[0xE7FE], Some(Branch::To(0x1018))),             // b .
            (&[0xDE00], None),                                 // udf #0
            (&[0xDF00], None),                                 // svc 0
            (&[0x4798], Some(Branch::Computed(None))),         // blx r3
            (&[0x4718], Some(Branch::Computed(None))),         // bx r3
            (&[0x4770], None),                                 // bx lr
            (&[0x469F], Some(Branch::Computed(None))),         // mov pc, r3
            (&[0xF8D3, 0xF004], Some(Branch::Computed(None))), // ldr.w pc, [r3, #4]
            (&[0xF85D, 0xFB04], None),                         // ldr pc, [sp], #4
            (&[0xBD10], None),                                 // pop {r4, pc}
        ];
        let halves = code.iter().flat_map(|(halves, _)| halves.iter());
        let bytes: Vec<u8> = halves.flat_map(|half| half.to_le_bytes()).collect();
        let wanted: Vec<Branch> = code.iter().filter_map(|(_, branch)| *branch).collect();
        assert_eq!(branches(0x1000, &bytes), wanted);
    }
}
