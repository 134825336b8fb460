//! The control flow of a linked image: its functions, and the addresses that they hold. The linker keeps
//! the latter with `--emit-relocs`.

use std::collections::BTreeMap;
use std::ops::Range;

use object::elf::{
    R_ARM_ABS32, R_ARM_NONE, R_ARM_PREL31, R_ARM_THM_JUMP24, R_ARM_THM_MOVT_ABS,
    R_ARM_THM_MOVW_ABS_NC, R_ARM_THM_PC22, SHF_ALLOC,
};
use object::read::elf::ElfFile32;
use object::{
    LittleEndian, Object, ObjectSection, ObjectSymbol, RelocationFlags, RelocationTarget,
    SectionFlags, SymbolKind,
};
use rustc_demangle::demangle;

use super::thumb::{Branch, branches};

/// A function; addresses are without the Thumb bit.
#[derive(Debug)]
pub(super) struct Function {
    /// As in the source, and independent of the compiler's mangling.
    pub(super) name: String,
    pub(super) place: Range<u32>,
    /// Whether it is a linker veneer to a function too far away for a branch. Callers name that function
    /// itself.
    pub(super) is_jump: bool,
}

/// The image.
pub(super) struct Program<'a> {
    sections: Vec<(Range<u32>, &'a [u8])>,
    functions: BTreeMap<u32, Function>,
    symbols: BTreeMap<String, u32>,
    /// Which words hold an address, and which instructions call one.
    held: BTreeMap<u32, u32>,
    called: BTreeMap<u32, u32>,
    /// Where code (true) and data begin.
    kinds: BTreeMap<u32, bool>,
}

impl<'a> Program<'a> {
    /// Parses an ELF file.
    ///
    /// # Errors
    /// What it lacks.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, String> {
        let file = ElfFile32::<LittleEndian>::parse(bytes).map_err(|e| e.to_string())?;
        let mut program = Self {
            sections: Vec::new(),
            functions: BTreeMap::new(),
            symbols: BTreeMap::new(),
            held: BTreeMap::new(),
            called: BTreeMap::new(),
            kinds: BTreeMap::new(),
        };
        let mut relocations = Vec::new();
        for section in file.sections() {
            let is_loaded = matches!(
                section.flags(), SectionFlags::Elf { sh_flags, .. } if sh_flags.contains(SHF_ALLOC)
            );
            if !is_loaded || section.size() == 0 {
                continue;
            }
            let place = section.address() as u32..(section.address() + section.size()) as u32;
            let data = section.data().map_err(|e| e.to_string())?;
            program.sections.push((place, data));
            relocations.extend(section.relocations());
        }
        program.read_symbols(&file);
        if relocations.is_empty() {
            return Err("it has no relocations; link it with --emit-relocs".to_owned());
        }
        let mut low = BTreeMap::new();
        for (place, relocation) in relocations {
            let place = place as u32;
            let (RelocationFlags::Elf { r_type }, RelocationTarget::Symbol(symbol)) =
                (relocation.flags(), relocation.target())
            else {
                continue;
            };
            let symbol_at = file.symbol_by_index(symbol).map_err(|e| e.to_string())?;
            match r_type {
                R_ARM_ABS32 => {
                    let held = program.word(place)?;
                    program.held.insert(place, held);
                }
                R_ARM_THM_PC22 | R_ARM_THM_JUMP24 => {
                    program.called.insert(place, symbol_at.address() as u32);
                }
                R_ARM_THM_MOVW_ABS_NC => {
                    let code = program.word(place)?;
                    low.insert((symbol.0, register(code)), immediate(code));
                }
                R_ARM_THM_MOVT_ABS => {
                    let code = program.word(place)?;
                    let low = low.get(&(symbol.0, register(code)));
                    let low = low.copied().ok_or_else(|| {
                        format!("the upper half of an address at {place:#010x} has no lower half")
                    })?;
                    program.held.insert(place, immediate(code) << 16 | low);
                }
                R_ARM_NONE | R_ARM_PREL31 => {}
                other => return Err(format!("relocation type {other} is not supported")),
            }
        }
        Ok(program)
    }

    fn read_symbols(&mut self, file: &ElfFile32<'_, LittleEndian>) {
        for symbol in file.symbols() {
            let (Ok(name), at) = (symbol.name(), symbol.address() as u32) else {
                continue;
            };
            if name.starts_with("$t") || name.starts_with("$d") {
                self.kinds.insert(at, name.starts_with("$t"));
                continue;
            }
            self.symbols.insert(name.to_owned(), at);
            if symbol.kind() == SymbolKind::Text && symbol.is_definition() {
                let (begin, end) = (at & !1, (at & !1) + symbol.size() as u32);
                // Of several names for a function, prefer one with its size.
                if self
                    .functions
                    .get(&begin)
                    .is_none_or(|f| f.place.is_empty())
                {
                    self.functions.insert(begin, function(name, begin..end));
                }
            }
        }
        // An assembly function may not state its size: it ends where the next one begins, or with its
        // section.
        let begins: Vec<u32> = self.functions.keys().copied().collect();
        for (index, begin) in begins.iter().enumerate() {
            let section = self.section(*begin).map_or(*begin, |(place, _)| place.end);
            if let Some(function) = self.functions.get_mut(begin)
                && function.place.is_empty()
            {
                let next = begins.get(index + 1).copied().unwrap_or(section);
                function.place.end = next.min(section);
            }
        }
    }

    /// Returns the value of a symbol.
    pub(super) fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Returns the function that begins at an address.
    pub(super) fn function(&self, address: u32) -> Option<&Function> {
        self.functions.get(&(address & !1))
    }

    /// Returns the function that contains an address.
    fn function_around(&self, address: u32) -> Option<&Function> {
        let (_, function) = self.functions.range(..=address & !1).next_back()?;
        function.place.contains(&(address & !1)).then_some(function)
    }

    /// Returns the addresses that a function calls or holds, and whether it goes where none of them says.
    pub(super) fn leads(&self, function: &Function) -> (Vec<u32>, bool) {
        if function.is_jump {
            return (Vec::new(), false);
        }
        let place = function.place.clone();
        let of = |table: &BTreeMap<u32, u32>| -> Vec<u32> {
            table.range(place.clone()).map(|(_, to)| *to).collect()
        };
        let held = of(&self.held);
        let mut computed = false;
        let mut addresses = [held, of(&self.called)].concat();
        for (begin, code) in self.code(&place) {
            for branch in branches(begin, code) {
                match branch {
                    // Branches within a function, or to its neighbour in assembly, need no relocation.
                    Branch::To(to) if place.contains(&to) => {}
                    Branch::To(to) => {
                        let function = self.function_around(to);
                        addresses.push(function.map_or(to, |function| function.place.start));
                    }
                    // Code built for size calls through a register; the target's address is among those
                    // held.
                    Branch::Computed(by) => {
                        let to = by.and_then(|by| self.held.get(&by));
                        computed |= to.is_none_or(|to| self.function(*to).is_none());
                    }
                }
            }
        }
        (addresses, computed)
    }

    /// Returns the parts of a function that are instructions rather than data.
    fn code(&self, place: &Range<u32>) -> Vec<(u32, &'a [u8])> {
        let Some((section, bytes)) = self.section(place.start) else {
            return Vec::new();
        };
        let before = self.kinds.range(..=place.start).next_back();
        let mut begins = vec![(place.start, before.is_none_or(|(_, is_code)| *is_code))];
        let within = self.kinds.range(place.start + 1..place.end);
        begins.extend(within.map(|(at, is_code)| (*at, *is_code)));
        let ends = begins.iter().skip(1).map(|(at, _)| *at).chain([place.end]);
        let pieces = begins.iter().zip(ends).filter(|((_, is_code), _)| *is_code);
        pieces
            .filter_map(|((begin, _), end)| {
                let piece = (begin - section.start) as usize..(end - section.start) as usize;
                Some((*begin, bytes.get(piece)?))
            })
            .collect()
    }

    /// Returns place and value of the words that hold an address, in the section around `address` and
    /// outside functions.
    pub(super) fn data_beside(&self, address: u32) -> Vec<(u32, u32)> {
        let Some((section, _)) = self.section(address) else {
            return Vec::new();
        };
        let held = self.held.range(section.clone());
        held.filter(|(place, _)| self.function_around(**place).is_none())
            .map(|(place, to)| (*place, *to))
            .collect()
    }

    fn section(&self, address: u32) -> Option<&(Range<u32>, &'a [u8])> {
        let mut sections = self.sections.iter();
        sections.find(|(place, _)| place.contains(&address))
    }

    fn word(&self, address: u32) -> Result<u32, String> {
        let word = self.section(address).and_then(|(place, bytes)| {
            let bytes = bytes.get((address - place.start) as usize..)?;
            bytes.first_chunk().map(|word| u32::from_le_bytes(*word))
        });
        word.ok_or_else(|| format!("{address:#010x}, which should hold an address, is empty"))
    }
}

fn function(symbol: &str, place: Range<u32>) -> Function {
    let thunk = symbol.strip_prefix("__Thumbv7");
    let target = thunk.and_then(|rest| Some(rest.split_once("Thunk_")?.1));
    Function {
        // v0 mangling puts a method's type in angle brackets.
        name: format!("{:#}", demangle(target.unwrap_or(symbol))).replace(['<', '>'], ""),
        place,
        is_jump: target.is_some(),
    }
}

/// Returns the register of a movw or movt.
fn register(code: u32) -> u32 {
    code >> 24 & 0xF
}

/// Returns the 16-bit immediate of a movw or movt.
fn immediate(code: u32) -> u32 {
    let (first, second) = (code & 0xFFFF, code >> 16);
    (first & 0xF) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF
}
