//! The parameter table as stored on a chip, in two thirds of the flash: each number once, the names end to end, and
//! rows of bytes.

use super::table::{Kind, ParamId, Parameter, TABLE};

/// A row of [`TABLE`].
struct Row {
    /// End of its name in [`NAMES`]; it begins where the previous one ends.
    name_end: u16,
    key: u8,
    kind: Kind,
    live: bool,
    /// Indices into [`NUMBERS`].
    min: u8,
    max: u8,
    default: u8,
}

static ROWS: [Row; TABLE.len()] = rows();

/// The bits of every distinct number in the table; as integers, they are copied without saving floating-point
/// registers.
static NUMBERS: [u32; DISTINCT.1] = {
    let mut numbers = [0; DISTINCT.1];
    let mut i = 0;
    while i < numbers.len() {
        numbers[i] = DISTINCT.0[i].to_bits();
        i += 1;
    }
    numbers
};

/// All names, end to end.
static NAMES: &str = {
    const LENGTH: usize = names_before(TABLE.len());
    const BYTES: [u8; LENGTH] = {
        let mut bytes = [0; LENGTH];
        let (mut row, mut at) = (0, 0);
        while row < TABLE.len() {
            let name = TABLE[row].name.as_bytes();
            let mut i = 0;
            while i < name.len() {
                bytes[at] = name[i];
                (i, at) = (i + 1, at + 1);
            }
            row += 1;
        }
        bytes
    };
    match core::str::from_utf8(&BYTES) {
        Ok(names) => names,
        Err(_) => panic!(),
    }
};

impl ParamId {
    /// Returns this parameter's row of the table.
    #[inline(never)] // unpacking is long, and many call it
    pub fn entry(self) -> Parameter {
        let at = self as usize;
        let row = &ROWS[at];
        let begin = match at.checked_sub(1) {
            Some(before) => ROWS[before].name_end,
            None => 0,
        };
        let name = NAMES.get(usize::from(begin)..usize::from(row.name_end));
        Parameter {
            key: u16::from(row.key),
            name: name.unwrap_or_default(),
            kind: row.kind,
            min: number(row.min),
            max: number(row.max),
            default: number(row.default),
            live: row.live,
        }
    }

    /// Clamps the value to the table's range.
    pub(super) fn held(self, value: f32) -> f32 {
        let row = &ROWS[self as usize];
        value.max(number(row.min)).min(number(row.max))
    }

    /// Returns the table's default.
    pub(super) fn default_value(self) -> f32 {
        number(ROWS[self as usize].default)
    }
}

/// Inlined: a look-up is no longer than a call.
#[inline(always)]
fn number(place: u8) -> f32 {
    // Every index is valid, so the 0 is never used.
    f32::from_bits(NUMBERS.get(usize::from(place)).copied().unwrap_or(0))
}

const fn rows() -> [Row; TABLE.len()] {
    let mut rows = [const {
        Row {
            name_end: 0,
            key: 0,
            kind: Kind::Real,
            live: false,
            min: 0,
            max: 0,
            default: 0,
        }
    }; TABLE.len()];
    let mut i = 0;
    while i < rows.len() {
        let entry = &TABLE[i];
        assert!(entry.key <= u8::MAX as u16);
        rows[i] = Row {
            name_end: names_before(i + 1) as u16,
            key: entry.key as u8,
            kind: entry.kind,
            live: entry.live,
            min: place(entry.min),
            max: place(entry.max),
            default: place(entry.default),
        };
        i += 1;
    }
    rows
}

/// Returns the total length of the names of the first `rows` rows.
const fn names_before(rows: usize) -> usize {
    let (mut letters, mut i) = (0, 0);
    while i < rows {
        letters += TABLE[i].name.len();
        i += 1;
    }
    letters
}

/// The table's distinct numbers, and their count.
const DISTINCT: ([f32; 3 * TABLE.len()], usize) = {
    let mut numbers = [0.0; 3 * TABLE.len()];
    let (mut count, mut i) = (0, 0);
    while i < numbers.len() {
        let entry = &TABLE[i / 3];
        let value = [entry.min, entry.max, entry.default][i % 3];
        if find(&numbers, count, value) == count {
            numbers[count] = value;
            count += 1;
        }
        i += 1;
    }
    assert!(count <= 1 << u8::BITS);
    (numbers, count)
};

/// Returns the index of a value among the first `count` numbers, or `count`.
const fn find(numbers: &[f32], count: usize, value: f32) -> usize {
    let mut i = 0;
    while i < count && numbers[i].to_bits() != value.to_bits() {
        i += 1;
    }
    i
}

const fn place(value: f32) -> u8 {
    find(&DISTINCT.0, DISTINCT.1, value) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_that_of_the_table() {
        for (id, row) in ParamId::ALL.into_iter().zip(TABLE) {
            assert_eq!(id.entry(), *row);
            assert_eq!(id.default_value(), row.default);
            assert_eq!(id.held(f32::MIN), row.min);
            assert_eq!(id.held(f32::MAX), row.max);
        }
    }
}
