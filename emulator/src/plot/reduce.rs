//! Fewer points than periods: each column of the picture keeps the range of its periods.

/// The samples within a column of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    pub(super) min: f64,
    pub(super) max: f64,
    sum: f64,
    count: u32,
}

impl Cell {
    pub(super) fn mean(&self) -> f64 {
        self.sum / f64::from(self.count)
    }
}

/// One quantity over the columns of the picture; a column without a sample is `None`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trace {
    cells: Vec<Option<Cell>>,
}

impl Trace {
    pub(super) fn new(columns: usize) -> Self {
        Self {
            cells: vec![None; columns],
        }
    }

    /// Adds a sample; non-finite ones cannot be drawn.
    pub(super) fn add(&mut self, column: usize, value: f32) {
        let value = f64::from(value);
        if !value.is_finite() {
            return;
        }
        let cell = self.cells[column].get_or_insert(Cell {
            min: value,
            max: value,
            sum: 0.0,
            count: 0,
        });
        cell.min = cell.min.min(value);
        cell.max = cell.max.max(value);
        cell.sum += value;
        cell.count += 1;
    }

    /// Returns the least `low` and greatest `high` of the columns, except for this share of them at
    /// either end.
    pub(super) fn range(
        &self,
        outliers: f64,
        low: fn(&Cell) -> f64,
        high: fn(&Cell) -> f64,
    ) -> Option<(f64, f64)> {
        let sorted = |value: fn(&Cell) -> f64| {
            let mut values: Vec<_> = self.cells.iter().flatten().map(value).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (lows, highs) = (sorted(low), sorted(high));
        let cut = (lows.len() as f64 * outliers) as usize;
        Some((*lows.get(cut)?, *highs.iter().rev().nth(cut)?))
    }

    /// Returns the columns.
    pub(super) fn cells(&self) -> &[Option<Cell>] {
        &self.cells
    }
}
