//! Checks that the PWM interrupt needs nothing from the flash while that is being written: an erase stalls
//! any access to it for 22 ms and more, with the bridge left as it was.
//!
//! The interrupt has two paths. While the flash is being written it only holds the bridge, which is at rest
//! then; in any other period it controls, and may run from flash what does not fit into RAM. A function
//! reaches every function whose address it holds, called or not.

mod program;
mod registers;
mod thumb;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;

use program::{Function, Program};

use super::Board;

/// What the interrupt does not call while the flash is being written, by its name in the firmware.
const CONTROLS: &str = "siskin_firmware::interrupt::period::Interrupt::control";

/// The flash of these chips, including the part with the parameters.
const FLASH: Range<u32> = 0x0800_0000..0x1000_0000;

/// What the reader can do about it.
const REMEDY: &str = "give it a place in RAM in firmware/link/sections.x, or keep it out of \
                      Interrupt::hold in firmware/src/interrupt/period.rs";

/// How much the interrupt reaches.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Reach {
    /// While the flash is being written: functions and their bytes.
    writing: (usize, u32),
    /// In any other period: functions, their bytes, and how many of those are in flash.
    running: (usize, u32, u32),
}

impl fmt::Display for Reach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (held, held_bytes) = self.writing;
        let (all, all_bytes, flash_bytes) = self.running;
        write!(
            f,
            "{held} functions, {held_bytes} bytes while the flash is written, none of them in it; in any \
             other period {all}, {all_bytes} bytes, {flash_bytes} of them in the flash"
        )
    }
}

/// Follows a board's PWM interrupt through an ELF file.
///
/// # Errors
/// The first things that it needs from the flash, and by which calls; or why that cannot be determined.
pub(super) fn judge(bytes: &[u8], board: Board) -> Result<Reach, String> {
    let program = Program::parse(bytes)?;
    let name = board.pwm_interrupt();
    let vector = program.symbol(name).and_then(|at| program.function(at));
    let vector = vector.ok_or_else(|| format!("it has no PWM interrupt ({name})"))?;
    let vectors = program.symbol("__ram_vectors");
    if vectors.is_none_or(|at| FLASH.contains(&at)) {
        return Err("its vector table stays in the flash".to_owned());
    }
    let writing = Callers::of(&program, vector, Some(CONTROLS));
    let needs = writing.needs_from_flash();
    if let Some(first) = needs.first() {
        let more = match needs.len() - 1 {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        return Err(format!(
            "while the flash is being written, the PWM interrupt needs from it {first}{more}; {REMEDY}"
        ));
    }
    let running = Callers::of(&program, vector, None);
    let bytes = |callers: &Callers<'_>, range: &Range<u32>| {
        let places = callers.functions().map(|function| &function.place);
        let within = places.filter(|place| range.contains(&place.start));
        within.map(|place| place.len() as u32).sum()
    };
    let anywhere = 0..u32::MAX;
    Ok(Reach {
        writing: (writing.callers.len(), bytes(&writing, &anywhere)),
        running: (
            running.callers.len(),
            bytes(&running, &anywhere),
            bytes(&running, &FLASH),
        ),
    })
}

/// Every function reachable from one, itself included, each with a function that leads to it.
struct Callers<'a> {
    program: &'a Program<'a>,
    callers: BTreeMap<u32, Option<u32>>,
}

impl<'a> Callers<'a> {
    /// Leaves out the function named `without`, and what only it leads to.
    fn of(program: &'a Program<'a>, first: &Function, without: Option<&str>) -> Self {
        let mut callers = BTreeMap::from([(first.place.start, None)]);
        let mut waiting = vec![first];
        while let Some(caller) = waiting.pop() {
            for address in program.leads(caller).0 {
                if let Some(callee) = program.function(address)
                    && without.is_none_or(|without| callee.name != without)
                    && !callers.contains_key(&callee.place.start)
                {
                    callers.insert(callee.place.start, Some(caller.place.start));
                    waiting.push(callee);
                }
            }
        }
        Self { program, callers }
    }

    fn functions(&self) -> impl Iterator<Item = &'a Function> {
        let program = self.program;
        let begins = self.callers.keys();
        begins.filter_map(move |begin| program.function(*begin))
    }

    /// Lists each function and datum in flash, and each call whose target is unknown.
    fn needs_from_flash(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut beside = BTreeSet::new();
        for function in self.functions() {
            let way = self.way(function);
            if FLASH.contains(&function.place.start) {
                found.push(format!("{} ({way})", function.name));
            } else {
                beside.extend(self.program.data_beside(function.place.start));
            }
            let (addresses, computed) = self.program.leads(function);
            let data = addresses.iter().filter(|address| {
                FLASH.contains(*address) && self.program.function(**address).is_none()
            });
            found.extend(
                data.map(|at| format!("what {} reads at {at:#010x} ({way})", function.name)),
            );
            if computed {
                found.push(format!(
                    "perhaps what {} calls by a pointer ({way})",
                    function.name
                ));
            }
        }
        // Data beside the code, which may lead further.
        let leading = beside.iter().filter(|(_, to)| FLASH.contains(to));
        found.extend(
            leading.map(|(at, to)| format!("{to:#010x}, to which the word at {at:#010x} leads")),
        );
        found
    }

    /// Returns the call path from the interrupt to a function.
    fn way(&self, function: &Function) -> String {
        let mut names: Vec<&str> = Vec::new();
        let mut at = Some(function.place.start);
        while let Some(function) = at.and_then(|at| self.program.function(at)) {
            // The linker's veneers are named after their targets.
            if names.last() != Some(&function.name.as_str()) {
                names.push(&function.name);
            }
            at = self.callers[&function.place.start];
        }
        names.reverse();
        names.join(" -> ")
    }
}
