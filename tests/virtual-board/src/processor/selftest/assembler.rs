//! A small assembler for the instructions that the self-tests use (DDI 0403, A7.7).
//!
//! Loads, stores and moves of constants always use their 32-bit encoding.

use std::collections::BTreeMap;

/// Assembled code and the addresses of its labels.
pub(super) struct Code {
    pub(super) bytes: Vec<u8>,
    pub(super) labels: BTreeMap<String, u32>,
}

/// Conditions by number.
const CONDITIONS: [&str; 14] = [
    "eq", "ne", "cs", "cc", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le",
];

/// Instructions without operands.
const PLAIN: [(&str, u32); 15] = [
    ("nop", 0xbf00),
    // A branch to the next instruction: there, at the latest, an engine takes what is pending.
    ("sync", 0xe7ff),
    ("wfe", 0xbf20),
    ("wfi", 0xbf30),
    ("sev", 0xbf40),
    ("cpsie i", 0xb662),
    ("cpsid i", 0xb672),
    ("cpsie f", 0xb661),
    ("cpsid f", 0xb671),
    ("dsb", 0xf3bf_8f4f),
    ("isb", 0xf3bf_8f6f),
    ("ldrex r0, [r4]", 0xe854_0f00),
    ("strex r1, r2, [r4]", 0xe844_2100),
    ("vadd.f32 s0, s0, s1", 0xee30_0a20),
    ("vmov.f32 s1, s0", 0xeef0_0a40),
];

/// Loads and stores with a 12-bit offset: their first half-word without the base.
const TRANSFERS: [(&str, u32); 6] = [
    ("str", 0xf8c0),
    ("ldr", 0xf8d0),
    ("strh", 0xf8a0),
    ("ldrh", 0xf8b0),
    ("strb", 0xf880),
    ("ldrb", 0xf890),
];

/// Special registers by number (B5.2.2).
const SPECIAL: [(&str, u32); 10] = [
    ("apsr", 0),
    ("xpsr", 3),
    ("ipsr", 5),
    ("msp", 8),
    ("psp", 9),
    ("primask", 16),
    ("basepri", 17),
    ("basepri_max", 18),
    ("faultmask", 19),
    ("control", 20),
];

/// Assembles a program to lie at this address. A line has a label, an instruction, both or neither; a `;`
/// begins a comment.
pub(super) fn assemble(source: &str, origin: u32) -> Code {
    let mut labels = BTreeMap::new();
    // The first pass finds the labels, the second uses them.
    let mut bytes = Vec::new();
    for last in [false, true] {
        bytes.clear();
        for line in source.lines() {
            let mut text = line.split(';').next().unwrap_or_default().trim();
            if let Some((label, rest)) = text.split_once(':') {
                let at = origin + bytes.len() as u32;
                let before = labels.insert(label.to_string(), at);
                assert!(last || before.is_none(), "{label} twice");
                text = rest.trim();
            }
            if !text.is_empty() {
                let at = origin + bytes.len() as u32;
                let line = Line {
                    text,
                    at,
                    last,
                    labels: &labels,
                };
                bytes.extend(line.encode());
            }
        }
    }
    Code { bytes, labels }
}

struct Line<'a> {
    text: &'a str,
    at: u32,
    /// Whether all labels are known.
    last: bool,
    labels: &'a BTreeMap<String, u32>,
}

impl Line<'_> {
    fn encode(&self) -> Vec<u8> {
        if let Some((_, code)) = PLAIN.iter().find(|(text, _)| *text == self.text) {
            return halves(*code);
        }
        let (name, rest) = self.text.split_once(' ').unwrap_or((self.text, ""));
        let operands: Vec<&str> = rest
            .split([',', '[', ']', ' '])
            .filter(|part| !part.is_empty())
            .collect();
        let register = |index: usize| self.register(operands[index]);
        let value = |index: usize| self.value(operands[index]);
        let byte = |index: usize| {
            let value = value(index);
            assert!(value < 1 << 8, "{}", self.text);
            value
        };
        if let Some((_, first)) = TRANSFERS.iter().find(|(text, _)| *text == name) {
            let offset = operands.get(2).map_or(0, |text| self.value(text));
            assert!(offset < 1 << 12, "{}", self.text);
            return halves((first | register(1)) << 16 | register(0) << 12 | offset);
        }
        match name {
            "mov" if operands[1].starts_with('#') => self.wide(0xf240, register(0), value(1)),
            "mov32" => {
                let mut code = self.wide(0xf240, register(0), value(1) & 0xffff);
                code.extend(self.wide(0xf2c0, register(0), value(1) >> 16));
                code
            }
            "mov" => {
                let to = register(0);
                halves(0x4600 | to >> 3 << 7 | register(1) << 3 | to & 7)
            }
            "adds" => halves(0x3000 | register(0) << 8 | byte(1)),
            "subs" => halves(0x3800 | register(0) << 8 | byte(1)),
            "cmp" => halves(0x2800 | register(0) << 8 | byte(1)),
            "orrs" => halves(0x4300 | register(1) << 3 | register(0)),
            "bx" => halves(0x4700 | register(0) << 3),
            "blx" => halves(0x4780 | register(0) << 3),
            "push" => halves(0xb400 | self.list(14)),
            "pop" => halves(0xbc00 | self.list(15)),
            "svc" => halves(0xdf00 | byte(0)),
            "udf" => halves(0xde00 | byte(0)),
            "mrs" => halves(0xf3ef_8000 | register(0) << 8 | self.special(operands[1])),
            "msr" => {
                let first = 0xf380_8000 | register(1) << 16;
                // Only the flags in APSR.
                let mask = 0b1000 << 8;
                halves(first | mask | self.special(operands[0]))
            }
            "vmov" if operands[0].starts_with('s') && operands[0] != "sp" => {
                self.float(0xee00_0a10, operands[0], operands[1])
            }
            "vmov" => self.float(0xee10_0a10, operands[1], operands[0]),
            "vmsr" => halves(0xeee1_0a10 | register(1) << 12),
            "vmrs" => halves(0xeef1_0a10 | register(0) << 12),
            "mark" => self.tell(0),
            "raise" => self.tell(8),
            "lower" => self.tell(12),
            "b" => halves(0xe000 | self.distance(operands[0], 12) >> 1 & 0x7ff),
            _ => self.conditional(name, &operands),
        }
    }

    fn conditional(&self, name: &str, operands: &[&str]) -> Vec<u8> {
        let number = |text| CONDITIONS.iter().position(|name| *name == text);
        if let Some(condition) = name.strip_prefix('b').and_then(number) {
            let distance = self.distance(operands[0], 9);
            return halves(0xd000 | (condition as u32) << 8 | distance >> 1 & 0xff);
        }
        if let Some(more) = name
            .strip_prefix('i')
            .and_then(|rest| rest.strip_prefix('t'))
        {
            let condition = number(operands[0]).expect("a condition") as u32;
            // A bit for each that follows, for the condition or its opposite, then a 1.
            let mut mask = 0b1000 >> more.len();
            for (index, letter) in more.chars().enumerate() {
                let same = u32::from(letter == 't');
                mask |= (condition & 1 ^ same ^ 1) << (3 - index);
            }
            return halves(0xbf00 | condition << 4 | mask);
        }
        panic!("no such instruction: {}", self.text);
    }

    /// Two instructions: a constant through r12 to the bed's register at this offset from r10.
    fn tell(&self, offset: u32) -> Vec<u8> {
        let value = self.text.split_once('#').expect("a constant").1;
        let mut code = self.wide(0xf240, 12, self.value(value));
        code.extend(halves(0xf8ca_c000 | offset));
        code
    }

    /// MOVW or MOVT.
    fn wide(&self, first: u32, register: u32, value: u32) -> Vec<u8> {
        assert!(value < 1 << 16, "{}", self.text);
        let first = first | value >> 12 | (value >> 11 & 1) << 10;
        halves(first << 16 | (value >> 8 & 7) << 12 | register << 8 | value & 0xff)
    }

    /// A move between a core and a floating-point register.
    fn float(&self, code: u32, single: &str, register: &str) -> Vec<u8> {
        let single: u32 = single[1..].parse().expect("a number");
        let register = self.register(register);
        halves(code | single >> 1 << 16 | (single & 1) << 7 | register << 12)
    }

    fn register(&self, text: &str) -> u32 {
        match text {
            "sp" => 13,
            "lr" => 14,
            "pc" => 15,
            _ => {
                let number = text.strip_prefix('r').and_then(|text| text.parse().ok());
                number.unwrap_or_else(|| panic!("no register: {}", self.text))
            }
        }
    }

    /// A set of low registers, and lr or pc.
    fn list(&self, high: u32) -> u32 {
        let (_, names) = self.text.split_once('{').expect("a list");
        let names = names.trim_end_matches('}').split(',');
        names.fold(0, |set, name| match self.register(name.trim()) {
            low @ 0..8 => set | 1 << low,
            register if register == high => set | 1 << 8,
            _ => panic!("not in a list: {}", self.text),
        })
    }

    fn special(&self, text: &str) -> u32 {
        let found = SPECIAL.iter().find(|(name, _)| *name == text);
        found
            .unwrap_or_else(|| panic!("no special register: {}", self.text))
            .1
    }

    /// A number or a label; for code, `=` before the label makes it a branch target.
    fn value(&self, text: &str) -> u32 {
        let text = text.trim_start_matches('#');
        if let Some(label) = text.strip_prefix('=') {
            return self.label(label) | 1;
        }
        let number = match text.strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16),
            None => text.parse(),
        };
        number.unwrap_or_else(|_| self.label(text))
    }

    fn label(&self, name: &str) -> u32 {
        match self.labels.get(name) {
            Some(address) => *address,
            None if self.last => panic!("no label: {}", self.text),
            None => self.at,
        }
    }

    /// How far a branch goes, as a signed number of `bits` bits.
    fn distance(&self, label: &str, bits: u32) -> u32 {
        let distance = self.label(label).wrapping_sub(self.at + 4);
        let limit = 1 << (bits - 1);
        let far = distance.wrapping_add(limit) >= limit << 1;
        assert!(!far || !self.last, "too far: {}", self.text);
        distance
    }
}

/// One or two half-words, the first one in the upper half.
fn halves(code: u32) -> Vec<u8> {
    let lower = (code as u16).to_le_bytes();
    match (code >> 16) as u16 {
        0 => lower.to_vec(),
        upper => [upper.to_le_bytes(), lower].concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As assembled by GNU as 2.40, at 0x0800_0000.
    const KNOWN: &[(&str, &[u16])] = &[
        ("mov r3, #0xabcd", &[0xf64a, 0x33cd]),
        ("mov r12, #0x8f1", &[0xf640, 0x0cf1]),
        ("mov32 r10, 0x40001234", &[0xf241, 0x2a34, 0xf2c4, 0x0a00]),
        ("mov r10, r1", &[0x468a]),
        ("mov r1, r12", &[0x4661]),
        ("mov sp, r4", &[0x46a5]),
        ("adds r2, #255", &[0x32ff]),
        ("subs r7, #1", &[0x3f01]),
        ("cmp r5, #9", &[0x2d09]),
        ("bx lr", &[0x4770]),
        ("bx r3", &[0x4718]),
        ("blx r4", &[0x47a0]),
        ("push {r0, r7, lr}", &[0xb581]),
        ("pop {r4, pc}", &[0xbd10]),
        ("svc 7", &[0xdf07]),
        ("udf 1", &[0xde01]),
        ("mrs r3, primask", &[0xf3ef, 0x8310]),
        ("mrs r12, ipsr", &[0xf3ef, 0x8c05]),
        ("mrs r2, xpsr", &[0xf3ef, 0x8203]),
        ("msr basepri, r9", &[0xf389, 0x8811]),
        ("msr basepri_max, r1", &[0xf381, 0x8812]),
        ("msr control, r0", &[0xf380, 0x8814]),
        ("msr psp, r1", &[0xf381, 0x8809]),
        ("msr apsr, r2", &[0xf382, 0x8800]),
        ("msr faultmask, r3", &[0xf383, 0x8813]),
        ("vmov s0, r1", &[0xee00, 0x1a10]),
        ("vmov s15, r12", &[0xee07, 0xca90]),
        ("vmov s31, r2", &[0xee0f, 0x2a90]),
        ("vmov r3, s30", &[0xee1f, 0x3a10]),
        ("vmov r4, s1", &[0xee10, 0x4a90]),
        ("vmsr fpscr, r5", &[0xeee1, 0x5a10]),
        ("vmrs r6, fpscr", &[0xeef1, 0x6a10]),
        ("vadd.f32 s0, s0, s1", &[0xee30, 0x0a20]),
        ("vmov.f32 s1, s0", &[0xeef0, 0x0a40]),
        ("str r0, [r10, #4]", &[0xf8ca, 0x0004]),
        ("ldr r12, [r7]", &[0xf8d7, 0xc000]),
        ("strb r1, [r2, #0xfff]", &[0xf882, 0x1fff]),
        ("ldrb r11, [sp, #28]", &[0xf89d, 0xb01c]),
        ("strh r3, [r4, #2]", &[0xf8a4, 0x3002]),
        ("ldrh r5, [lr, #6]", &[0xf8be, 0x5006]),
        ("wfi", &[0xbf30]),
        ("wfe", &[0xbf20]),
        ("sev", &[0xbf40]),
        ("nop", &[0xbf00]),
        ("cpsid i", &[0xb672]),
        ("cpsie i", &[0xb662]),
        ("cpsid f", &[0xb671]),
        ("cpsie f", &[0xb661]),
        ("dsb", &[0xf3bf, 0x8f4f]),
        ("isb", &[0xf3bf, 0x8f6f]),
        ("a: b a", &[0xe7fe]),
        ("a: nop\nbne a", &[0xbf00, 0xd1fd]),
        ("b c\nnop\nc: nop", &[0xe000, 0xbf00, 0xbf00]),
        ("beq c\nnop\nnop\nc: nop", &[0xd001, 0xbf00, 0xbf00, 0xbf00]),
        ("it eq", &[0xbf08]),
        ("itt ne", &[0xbf1c]),
        ("ite ne", &[0xbf14]),
        ("itt eq", &[0xbf04]),
        ("ite eq", &[0xbf0c]),
    ];

    #[test]
    fn it_assembles_as_another_assembler_does() {
        for (source, halfwords) in KNOWN {
            let bytes = assemble(source, 0x0800_0000).bytes;
            let wanted: Vec<u8> = halfwords
                .iter()
                .flat_map(|half| half.to_le_bytes())
                .collect();
            assert_eq!(bytes, wanted, "{source}");
        }
    }
}
