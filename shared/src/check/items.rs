//! Items of the self-test: names, units, bounds.
//!
//! | name | unit | bounds | what it shows |
//! |---|---|---|---|
//! | `supply` | V | `LIM_BUS_V_MIN` to `LIM_BUS_V_MAX` | the supply, through its divider |
//! | `temperature` | degC | −20 to `LIM_TEMP_C` | the thermistor |
//! | `option_bytes` | 1 | 1 | 1 if the chip boots from flash whatever its BOOT0 pin |
//! | `comparator_a`.. | A | ± 0.4 of the range | where the comparator trips without current, searched between 0, which must trip, and full scale, which must not |
//! | `zero_a`.. | A | ± 0.1 of the range | mean of the zero-current readings; the drive accepts no larger offset |
//! | `noise_a`.. | A | 0.1 counts to 0.01 of the range | standard deviation of the same readings; ones that never change are not real |
//! | `rest_a`.. | % | −1 to 10 | terminal with all switches off |
//! | `high_a`.. | % | 90 to 110 | terminal with its own high side on |
//! | `motor_a`.. | % | 90 to 110 | terminal with another phase's high side on |
//! | `low_a`.. | A | −1 to −0.1 of `LIM_PHASE_A` | current returning through the low side, as its shunt shows it |
//! | `off_a`.. | A | ± 0.1 of `LIM_PHASE_A` | current through a phase that is off while another is pulled up |
//!
//! Percentages are of the supply, or of the divider's full scale where that is lower: 18.3 V on the
//! B-G431B-ESC1, where readings clamp.

use core::ops::Range;

use siskin_params::{ParamId, Params};

/// A kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Supply voltage, V.
    Supply,
    /// Board temperature, °C.
    Temperature,
    /// 1 if the option bytes make the chip boot from flash, 0 otherwise.
    OptionBytes,
    /// A phase current at which its comparator would trip, with the level shifted to where it does trip, A.
    Comparator,
    /// Mean of a phase's zero-current readings, A.
    Zero,
    /// Standard deviation of the same readings, A.
    Noise,
    /// Terminal with all switches off, percent of the supply.
    Rest,
    /// Terminal with its own high side on, percent of the supply.
    High,
    /// Terminal with another phase's high side on, percent of the supply.
    Motor,
    /// Current out of the motor through a low side, A; negative, as any outflow.
    Low,
    /// Current into a phase that is off, A.
    Off,
}

/// The number of kinds with one item; each later kind has one per phase.
const SINGLE: usize = Kind::Comparator as usize;

const ROWS_LEN: usize = Kind::Off as usize + 1;

/// What bounds are relative to.
#[derive(Clone, Copy)]
enum Basis {
    /// The item's unit.
    One,
    /// The board's current range.
    Range,
    /// `LIM_PHASE_A`.
    Limit,
}

/// A row of the table: name, unit, bounds. Parameters replace some bounds.
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

/// Indexed by [`Kind`].
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

/// What a line is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// The kind of measurement.
    pub kind: Kind,
    /// The phase: 0, 1, 2 for a, b, c; 0 if there is only one item.
    pub phase: u8,
}

impl Item {
    /// The items that only the board can measure.
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
    /// NaN where nothing was measured.
    values: [f32; ITEMS],
    /// Full-scale current of the board and one count of it, A.
    scale_a: (f32, f32),
}

/// A line of the report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Name, in two pieces.
    pub name: [&'static str; 2],
    /// Measured value.
    pub value: f32,
    /// Unit; "1" is none.
    pub unit: &'static str,
    /// Lower bound.
    pub low: f32,
    /// Upper bound.
    pub high: f32,
}

impl Line {
    /// Returns true if the value is within its bounds; NaN never is.
    pub fn ok(&self) -> bool {
        (self.low..=self.high).contains(&self.value)
    }
}

impl Report {
    /// Creates an empty report for a board that measures currents up to `range_a` in steps of `count_a`, A.
    pub const fn new(range_a: f32, count_a: f32) -> Self {
        Self {
            values: [f32::NAN; ITEMS],
            scale_a: (range_a, count_a),
        }
    }

    /// Clears all results except those that bar the motor, which stay until measured again.
    pub(super) fn clear(&mut self) {
        let first = Item::of(Kind::Comparator, 0).place();
        for (place, value) in self.values.iter_mut().enumerate() {
            if !(first..first + 3).contains(&place) {
                *value = f32::NAN;
            }
        }
    }

    /// Returns the measured value, or NaN.
    pub(super) fn get(&self, kind: Kind, phase: u8) -> f32 {
        self.values[Item::of(kind, phase).place()]
    }

    pub(crate) fn set(&mut self, kind: Kind, phase: u8, value: f32) {
        // A NaN here is a sensor without a reading: store infinity so that its line appears, and fails.
        let value = if value.is_nan() { f32::INFINITY } else { value };
        self.values[Item::of(kind, phase).place()] = value;
    }

    /// Calls `act` with each measured item's line, bounded by these parameters.
    pub fn for_each_line(&self, params: &Params, mut act: impl FnMut(&Line)) {
        for place in 0..self.values.len() {
            if let Some(line) = self.line(place, params) {
                act(&line);
            }
        }
    }

    /// Returns true if all measured values are within their bounds.
    pub(super) fn fits(&self, params: &Params) -> bool {
        self.fit(0..self.values.len(), params)
    }

    /// Returns true if the motor may turn. Comparators that do not trip where they should give no protection,
    /// and production tests do not fully cover those of STM32G431 revisions Z and Y (ES0431).
    pub fn may_turn(&self, params: &Params) -> bool {
        self.holds(Kind::Comparator, params)
    }

    /// Returns true if the three phases' values of a kind are within their bounds.
    pub(super) fn holds(&self, kind: Kind, params: &Params) -> bool {
        let first = Item::of(kind, 0).place();
        self.fit(first..first + 3, params)
    }

    // Never inlined: that would duplicate it, for all items and for one kind.
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
