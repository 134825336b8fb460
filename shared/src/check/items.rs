//! The lines of the self-test: names, units, bounds.
//!
//! | name | unit | bounds | what it shows |
//! |---|---|---|---|
//! | `supply` | V | `LIM_BUS_V_MIN` to `LIM_BUS_V_MAX` | the supply, as its divider shows it |
//! | `temperature` | degC | −20 to `LIM_TEMP_C` | the thermistor |
//! | `option_bytes` | 1 | 1 | 1 if the chip starts from its flash whatever its BOOT0 pin says |
//! | `comparator_a`.. | A | ± 0.4 of the range | where the comparator trips without current: its level is searched between 0, which must trip, and full scale, which must not |
//! | `zero_a`.. | A | ± 0.1 of the range | mean of the current's readings without current: the drive takes no greater one for sound |
//! | `noise_a`.. | A | 0.1 counts to 0.01 of the range | standard deviation of the same; readings that never change are no readings |
//! | `rest_a`.. | % | −1 to 10 | the terminal with all switches off |
//! | `high_a`.. | % | 90 to 110 | the terminal with its high side on |
//! | `motor_a`.. | % | 90 to 110 | the terminal with the high side of another phase on |
//! | `low_a`.. | A | −1 to −0.1 of `LIM_PHASE_A` | the current that comes back through the low side, as its shunt shows it |
//! | `off_a`.. | A | ± 0.1 of `LIM_PHASE_A` | the current through a phase that is off, while another is pulled up |
//!
//! Percents are of the supply or, where the divider ends below it, of the most that it shows: of 18.3 V on
//! the B-G431B-ESC1, above which a reading is clamped and shows no more than that.

use core::ops::Range;

use crate::params::{ParamId, Params};

/// A kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The supply's voltage, V.
    Supply,
    /// Temperature of the board, °C.
    Temperature,
    /// 1 if the chip is set to start from its flash, else 0.
    OptionBytes,
    /// Current at which a phase's comparator would trip with its level moved to where it does, A.
    Comparator,
    /// Mean of a phase's readings without current, A.
    Zero,
    /// Their standard deviation, A.
    Noise,
    /// A terminal with all switches off, percent of the supply.
    Rest,
    /// A terminal with its high side on, percent of the supply.
    High,
    /// A terminal with another's high side on, percent of the supply.
    Motor,
    /// Current out of the motor through a low side, A, negative as all that flows out.
    Low,
    /// Current into a phase that is off, A.
    Off,
}

/// Kinds of which there is one; of the others there is one for each phase.
const SINGLE: usize = Kind::Comparator as usize;

const ROWS_LEN: usize = Kind::Off as usize + 1;

/// The basis of bounds.
#[derive(Clone, Copy)]
enum Basis {
    /// The item's unit.
    One,
    /// The board's range.
    Range,
    /// `LIM_PHASE_A`.
    Limit,
}

/// A kind's row: name, unit, bounds. Some bounds are parameters instead.
struct Row {
    name: &'static str,
    unit: &'static str,
    low: f32,
    high: f32,
    of: Basis,
}

const fn row(name: &'static str, unit: &'static str, (low, high): (f32, f32), of: Basis) -> Row {
    Row {
        name,
        unit,
        low,
        high,
        of,
    }
}

/// In the order of [`Kind`].
static ROWS: [Row; ROWS_LEN] = [
    row("supply", "V", (0.0, 0.0), Basis::One),
    row("temperature", "degC", (-20.0, 0.0), Basis::One),
    row("option_bytes", "1", (1.0, 1.0), Basis::One),
    row("comparator", "A", (-0.4, 0.4), Basis::Range),
    row("zero", "A", (-0.1, 0.1), Basis::Range),
    row("noise", "A", (0.0, 0.01), Basis::Range),
    row("rest", "%", (-1.0, 10.0), Basis::One),
    row("high", "%", (90.0, 110.0), Basis::One),
    row("motor", "%", (90.0, 110.0), Basis::One),
    row("low", "A", (-1.0, -0.1), Basis::Limit),
    row("off", "A", (-0.1, 0.1), Basis::Limit),
];

const ITEMS: usize = SINGLE + 3 * (ROWS_LEN - SINGLE);

/// One line's subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// The kind of measurement.
    pub kind: Kind,
    /// Of which phase, 0, 1, 2 for a, b, c; 0 if there is only one.
    pub phase: u8,
}

impl Item {
    /// Those that only the board can measure.
    pub const OWN: [Self; 4] = [
        Self::of(Kind::OptionBytes, 0),
        Self::of(Kind::Comparator, 0),
        Self::of(Kind::Comparator, 1),
        Self::of(Kind::Comparator, 2),
    ];

    const fn of(kind: Kind, phase: u8) -> Self {
        Self { kind, phase }
    }

    const fn place(self) -> usize {
        let kind = self.kind as usize;
        if kind < SINGLE {
            kind
        } else {
            SINGLE + 3 * (kind - SINGLE) + self.phase as usize
        }
    }
}

/// The results of a self-test.
#[derive(Clone, Debug)]
pub struct Report {
    /// Not a number if nothing was measured.
    values: [f32; ITEMS],
    /// The greatest current that the board can show, and a count of it, A.
    scale_a: (f32, f32),
}

/// A line of a self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its name, in two pieces.
    pub name: [&'static str; 2],
    /// The value measured.
    pub value: f32,
    /// In this unit; 1 is none.
    pub unit: &'static str,
    /// The least value that is well.
    pub low: f32,
    /// The greatest.
    pub high: f32,
}

impl Line {
    /// Returns true if the value is within its bounds; a value that is no number is not.
    pub fn ok(&self) -> bool {
        (self.low..=self.high).contains(&self.value)
    }
}

impl Report {
    /// One without a line, of a board whose converter shows currents up to `range_a` in steps of
    /// `count_a`, A.
    pub const fn new(range_a: f32, count_a: f32) -> Self {
        Self {
            values: [f32::NAN; ITEMS],
            scale_a: (range_a, count_a),
        }
    }

    /// Forgets all results but those that bar the motor, which hold until measured again.
    pub(super) fn clear(&mut self) {
        let first = Item::of(Kind::Comparator, 0).place();
        for (place, value) in self.values.iter_mut().enumerate() {
            if !(first..first + 3).contains(&place) {
                *value = f32::NAN;
            }
        }
    }

    /// The value measured, or NaN.
    pub(super) fn get(&self, kind: Kind, phase: u8) -> f32 {
        self.values[Item::of(kind, phase).place()]
    }

    pub(crate) fn set(&mut self, kind: Kind, phase: u8, value: f32) {
        // A sensor without a reading has been read: its line must not be missing.
        let value = if value.is_nan() { f32::INFINITY } else { value };
        self.values[Item::of(kind, phase).place()] = value;
    }

    /// The lines of the items measured, with the bounds from these parameters.
    pub fn tell(&self, params: &Params, mut tell: impl FnMut(&Line)) {
        for place in 0..self.values.len() {
            if let Some(line) = self.line(place, params) {
                tell(&line);
            }
        }
    }

    /// Returns true if all values measured are within their bounds.
    pub(super) fn fits(&self, params: &Params) -> bool {
        self.fit(0..self.values.len(), params)
    }

    /// Returns true if the motor may turn. Comparators that do not trip where they should protect
    /// nothing, and those of revisions Z and Y of the STM32G431 are not fully tested in production
    /// (ES0431).
    pub fn may_turn(&self, params: &Params) -> bool {
        self.holds(Kind::Comparator, params)
    }

    /// Returns true if the values of a kind that each phase has are within their bounds.
    pub(super) fn holds(&self, kind: Kind, params: &Params) -> bool {
        let first = Item::of(kind, 0).place();
        self.fit(first..first + 3, params)
    }

    // Never inlined: it would be there for all places, and again for a kind.
    #[inline(never)]
    fn fit(&self, places: Range<usize>, params: &Params) -> bool {
        let mut lines = places.map(|place| self.line(place, params));
        lines.all(|line| line.is_none_or(|line| line.ok()))
    }

    fn line(&self, place: usize, params: &Params) -> Option<Line> {
        let value = *self.values.get(place).filter(|value| !value.is_nan())?;
        let (kind, phase) = if place < SINGLE {
            (place, "")
        } else {
            let phase = (place - SINGLE) % 3;
            (SINGLE + (place - SINGLE) / 3, ["_a", "_b", "_c"][phase])
        };
        let (range_a, count_a) = self.scale_a;
        let row = &ROWS[kind];
        let base = match row.of {
            Basis::One => 1.0,
            Basis::Range => range_a,
            Basis::Limit => params.get(ParamId::LimPhaseA),
        };
        let mut line = Line {
            name: [row.name, phase],
            value,
            unit: row.unit,
            low: row.low * base,
            high: row.high * base,
        };
        if kind == Kind::Supply as usize {
            line.low = params.get(ParamId::LimBusVMin);
            line.high = params.get(ParamId::LimBusVMax);
        } else if kind == Kind::Temperature as usize {
            line.high = params.get(ParamId::LimTempC);
        } else if kind == Kind::Noise as usize {
            line.low = 0.1 * count_a;
        }
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    #[test]
    fn the_builders_guide_has_every_line() {
        let guide = include_str!("../../../firmware/README.md");
        let (_, section) = guide
            .split_once("\n## Self-test\n")
            .expect("it has a part on this");
        let section = section.split("\n## ").next().unwrap_or_default();
        for (kind, row) in ROWS.iter().enumerate() {
            let of_phases = if kind < SINGLE { "" } else { "_*" };
            let name = format!("`{}{of_phases}`", row.name);
            assert!(section.contains(&name), "{name}");
        }
    }
}
