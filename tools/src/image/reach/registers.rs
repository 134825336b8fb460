//! Tracks which registers hold an address known from an instruction: enough of Thumb-2 (Armv7-M manual, chapter
//! A7.7) to know where a call through a register leads.
//!
//! Instructions are taken in the order in which they stand, whatever the control flow: compilers load an
//! address shortly before the call.

/// Where each register's value comes from: the place of the word or the `movt` whose address was last loaded
/// into it; `None` for any other value.
#[derive(Debug, Default)]
pub(super) struct Registers([Option<u32>; 16]);

/// The registers that the procedure call standard lets a callee overwrite: r0 to r3, and r12.
const SCRATCH: u16 = 0x100F;

impl Registers {
    pub(super) fn get(&self, register: u16) -> Option<u32> {
        self.0[usize::from(register & 15)]
    }

    /// Notes that a function has been called.
    pub(super) fn called(&mut self) {
        self.forget_all(SCRATCH);
    }

    /// Takes a 16-bit instruction; `here` is its address plus 4.
    pub(super) fn narrow(&mut self, here: u32, code: u16) {
        let (low, high) = (code & 7, code >> 8 & 7);
        match code {
            // Shifts, sums, extensions and reversals, with the result register in the lowest bits.
            0x0000..=0x1FFF | 0xB200..=0xB2FF | 0xBA00..=0xBAFF => self.forget(low),
            // mov, add and sub with an immediate, but not cmp.
            0x2000..=0x27FF | 0x3000..=0x3FFF => self.forget(high),
            // Register operations; tst, cmp and cmn change none.
            0x4000..=0x43FF if !matches!(code >> 6 & 15, 8 | 10 | 11) => self.forget(low),
            0x4400..=0x44FF => self.forget(code >> 4 & 8 | low),
            0x4600..=0x46FF => self.set(code >> 4 & 8 | low, self.get(code >> 3)),
            // PC-relative ldr.
            0x4800..=0x4FFF => {
                self.set(high, Some((here & !3) + 4 * u32::from(code & 0xFF)));
            }
            // Loads.
            0x5600..=0x5FFF | 0x6800..=0x6FFF | 0x7800..=0x7FFF | 0x8800..=0x8FFF => {
                self.forget(low);
            }
            // SP-relative ldr, and PC- and SP-relative addresses.
            0x9800..=0xAFFF => self.forget(high),
            // pop, ldm.
            0xBC00..=0xBDFF | 0xC800..=0xCFFF => self.forget_all(code & 0xFF),
            _ => {}
        }
    }

    /// Takes a 32-bit instruction.
    pub(super) fn wide(&mut self, here: u32, first: u16, second: u16) {
        let (target, result) = (second >> 12, second >> 8 & 15);
        if first & 0xFF7F == 0xF85F {
            // PC-relative ldr, forwards or backwards.
            let (base, offset) = (here & !3, u32::from(second & 0xFFF));
            let ahead = first & 0x80 != 0;
            let place = base.wrapping_add(if ahead { offset } else { offset.wrapping_neg() });
            self.set(target, Some(place));
        } else if first & 0xFBF0 == 0xF2C0 && second & 0x8000 == 0 {
            // movt.
            self.set(result, Some(here - 4));
        } else if first & 0xFE50 == 0xE810 {
            // ldm.
            self.forget_all(second);
        } else if first & 0xFE00 == 0xF800 {
            // Loads; a store changes nothing.
            if first & 0x10 != 0 {
                self.forget(target);
            }
        } else if first & 0xFF10 == 0xEE10 {
            // vmov.
            self.forget(target);
        } else if first & 0xFFF0 == 0xEC50 {
            self.forget(target);
            self.forget(first);
        } else {
            // Loads of two registers, and arithmetic, including that with two results. A branch has none.
            let is_branch = first & 0xF800 == 0xF000 && second & 0x8000 != 0;
            let is_store = first & 0xFE50 == 0xE840 || first & 0xFE50 == 0xE800;
            let is_float = first & 0xEC00 == 0xEC00;
            if !is_branch && !is_store && !is_float {
                self.forget(result);
                if first & 0xFE50 == 0xE850 || first & 0xFF80 == 0xFB80 {
                    self.forget(target);
                }
            }
        }
    }

    fn set(&mut self, register: u16, place: Option<u32>) {
        self.0[usize::from(register & 15)] = place;
    }

    fn forget(&mut self, register: u16) {
        self.set(register, None);
    }

    fn forget_all(&mut self, list: u16) {
        for register in (0..16).filter(|register| list >> register & 1 != 0) {
            self.forget(register);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns r3 after the instructions, which begin at 0x1000.
    fn r3(code: &[&[u16]]) -> Option<u32> {
        let mut registers = Registers::default();
        let mut here = 0x1004;
        for halves in code {
            match **halves {
                [code] => registers.narrow(here, code),
                [first, second] => registers.wide(here, first, second),
                _ => panic!("an instruction has one or two"),
            }
            here += 2 * halves.len() as u32;
        }
        registers.get(3)
    }

    #[test]
    fn an_address_is_known_until_its_register_is_written() {
        let literal: &[u16] = &[0x4B01]; // ldr r3, [pc, #4]
        let other: &[u16] = &[0x4C01]; // ldr r4, [pc, #4]
        assert_eq!(r3(&[literal]), Some(0x1008));
        assert_eq!(r3(&[&[0xF8DF, 0x3010]]), Some(0x1014)); // ldr.w r3, [pc, #16]
        assert_eq!(r3(&[&[0xF85F, 0x3010]]), Some(0x0FF4)); // ldr.w r3, [pc, #-16]
        assert_eq!(r3(&[&[0xF241, 0x2334], &[0xF2C0, 0x0308]]), Some(0x1004)); // movw, movt r3
        assert_eq!(r3(&[other, &[0x4623]]), Some(0x1008)); // mov r3, r4
        // As assembled by GNU as.
        let writes: [&[u16]; 15] = [
            &[0x6803],         // ldr r3, [r0]
            &[0x5883],         // ldr r3, [r0, r2]
            &[0x9B02],         // ldr r3, [sp, #8]
            &[0x7803],         // ldrb r3, [r0]
            &[0x2300],         // movs r3, #0
            &[0x3301],         // adds r3, #1
            &[0x1883],         // adds r3, r0, r2
            &[0x4003],         // ands r3, r0
            &[0x4403],         // add r3, r0
            &[0x460B],         // mov r3, r1
            &[0xBC08],         // pop {r3}
            &[0xF8D0, 0x3010], // ldr.w r3, [r0, #16]
            &[0xE9D0, 0x3400], // ldrd r3, r4, [r0]
            &[0xE9D0, 0x4300], // ldrd r4, r3, [r0]
            &[0xEB00, 0x0382], // add.w r3, r0, r2, lsl #2
        ];
        for write in writes {
            assert_eq!(r3(&[literal, write]), None, "{write:x?}");
        }
        let leaves: [&[u16]; 7] = [
            &[0x2B00],         // cmp r3, #0
            &[0x4283],         // cmp r3, r0
            &[0x6003],         // str r3, [r0]
            &[0x9302],         // str r3, [sp, #8]
            &[0xF8C0, 0x3010], // str.w r3, [r0, #16]
            &[0xE9C0, 0x3400], // strd r3, r4, [r0]
            &[0xEE00, 0x3A10], // vmov s0, r3
        ];
        for leave in leaves {
            assert_eq!(r3(&[literal, leave]), Some(0x1008), "{leave:x?}");
        }
    }

    #[test]
    fn a_call_leaves_what_it_must() {
        let mut registers = Registers::default();
        registers.narrow(0x1004, 0x4B01);
        registers.narrow(0x1006, 0x4C01);
        registers.called();
        assert_eq!((registers.get(3), registers.get(4)), (None, Some(0x1008)));
    }
}
