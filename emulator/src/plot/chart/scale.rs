//! The ends of an axis, and its ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use super::Axis;
use crate::plot::style::rounded;

/// Most ticks with a number.
const TICKS: usize = 10;
/// Most decades for which a logarithmic axis has lines between its ticks.
const LIGHT_DECADES: f64 = 6.0;

/// An axis in the coordinate proportional to length: the value, or its decimal logarithm.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    pub(super) low: f64,
    pub(super) high: f64,
    logarithmic: bool,
}

/// The positions of numbers on an axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Ticks {
    /// Coordinate and number.
    pub(super) numbers: Vec<(f64, String)>,
    /// Coordinates of lines without a number.
    pub(super) light: Vec<f64>,
}

/// An axis with its ticks, as the library draws it.
#[derive(Clone, Debug)]
pub(super) struct Laid<'a> {
    pub(super) scale: &'a Scale,
    pub(super) ticks: Ticks,
}

impl Ranged for Laid<'_> {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, limit: (i32, i32)) -> i32 {
        let length = f64::from(limit.1 - limit.0);
        limit.0 + (self.scale.share(*place) * length).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            return self.ticks.light.clone();
        }
        self.ticks.numbers.iter().map(|(place, _)| *place).collect()
    }

    fn range(&self) -> Range<f64> {
        self.scale.low..self.scale.high
    }
}

impl ValueFormatter<f64> for Laid<'_> {
    fn format_ext(&self, place: &f64) -> String {
        let number = self.ticks.numbers.iter().find(|(at, _)| at == place);
        number.map_or_else(String::new, |(_, text)| text.clone())
    }
}

impl Scale {
    /// Creates the axis over these values, with this share of its length left free at either end;
    /// the axis' own range takes precedence.
    pub(super) fn new(axis: &Axis, values: impl Iterator<Item = f64>, free: f64) -> Self {
        let mut scale = Self {
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            logarithmic: axis.logarithmic,
        };
        if let Some((low, high)) = axis.range
            && let (Some(low), Some(high)) = (scale.place(low), scale.place(high))
            && low < high
        {
            return Self { low, high, ..scale };
        }
        for value in values {
            if let Some(place) = scale.place(value) {
                scale.low = scale.low.min(place);
                scale.high = scale.high.max(place);
            }
        }
        if scale.low > scale.high {
            (scale.low, scale.high) = (0.0, 1.0);
        }
        let span = scale.high - scale.low;
        let room = if span > 1e-9 * scale.low.abs().max(scale.high.abs()) {
            free * span
        } else {
            // A single value is in the middle.
            (0.1 * scale.high.abs()).max(0.1)
        };
        scale.low -= room;
        scale.high += room;
        scale
    }

    /// Returns the coordinate of a value; `None` if the axis has no place for it.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        let place = if self.logarithmic {
            value.log10()
        } else {
            value
        };
        place.is_finite().then_some(place)
    }

    /// Returns the position of a coordinate along the axis, 0 to 1 between the ends.
    pub(super) fn share(&self, place: f64) -> f64 {
        (place - self.low) / (self.high - self.low)
    }

    /// Returns as many round numbers as `fit` accepts side by side.
    pub(super) fn ticks(&self, fit: impl Fn(&[(f64, String)]) -> bool) -> Ticks {
        let fits = |numbers: &Vec<_>| numbers.len() <= TICKS && fit(numbers);
        let two = |numbers: &Vec<_>| numbers.len() >= 2;
        if self.logarithmic {
            let candidates = self.ratios();
            if let Some(numbers) = candidates.into_iter().find(fits).filter(two) {
                let light = if self.high - self.low <= LIGHT_DECADES {
                    self.multiples(1, &[1, 2, 3, 4, 5, 6, 7, 8, 9])
                } else {
                    Vec::new()
                };
                return Ticks {
                    numbers,
                    light: light.into_iter().map(|(place, _)| place).collect(),
                };
            }
        }
        Ticks {
            numbers: self.steps().find(fits).unwrap_or_default(),
            light: Vec::new(),
        }
    }

    /// Returns round numbers of equal ratio, from close to wide.
    fn ratios(&self) -> Vec<Vec<(f64, String)>> {
        let mantissas: [&[i32]; 4] = [&[1, 2, 3, 4, 5, 6, 7, 8, 9], &[1, 2, 5], &[1, 3], &[1]];
        let within = mantissas.map(|mantissas| self.multiples(1, mantissas));
        let decades = (2..=12).map(|decades| self.multiples(decades, &[1]));
        within.into_iter().chain(decades).collect()
    }

    /// Returns these multiples of every `decades`-th power of ten.
    fn multiples(&self, decades: i32, mantissas: &[i32]) -> Vec<(f64, String)> {
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let powers = (first..=last).filter(|power| power % decades == 0);
        let values = powers.flat_map(|power| {
            let unit = 10_f64.powi(power);
            mantissas.iter().map(move |mantissa| (unit, *mantissa))
        });
        values
            .map(|(unit, mantissa)| {
                let value = f64::from(mantissa) * unit;
                (value.log10(), tick(value, unit, value))
            })
            .filter(|(place, _)| self.holds(*place))
            .collect()
    }

    /// Returns round numbers of equal difference, from close to wide.
    fn steps(&self) -> impl Iterator<Item = Vec<(f64, String)>> {
        let (low, high) = if self.logarithmic {
            (10_f64.powf(self.low), 10_f64.powf(self.high))
        } else {
            (self.low, self.high)
        };
        let power = (high - low).log10().floor() as i32;
        let steps = (power - 2..=power).flat_map(|power| {
            let unit = 10_f64.powi(power);
            [1.0, 2.0, 5.0].map(|multiple| (unit, multiple * unit))
        });
        steps.map(move |(unit, step)| {
            let (first, last) = ((low / step).floor() as i64, (high / step).ceil() as i64);
            (first..=last)
                .map(|count| count as f64 * step)
                .filter_map(|value| {
                    let text = tick(value, unit, low.abs().max(high.abs()));
                    Some((self.place(value)?, text))
                })
                .filter(|(place, _)| self.holds(*place))
                .collect()
        })
    }

    fn holds(&self, place: f64) -> bool {
        // Rounding must not cost a tick at an end of the axis.
        (-1e-9..=1.0 + 1e-9).contains(&self.share(place))
    }
}

/// Formats a number to the place of `unit`, a power of ten; `greatest` is the greatest beside it.
fn tick(value: f64, unit: f64, greatest: f64) -> String {
    let place = unit.log10().round() as i32;
    let value = rounded(value, place);
    if greatest < 1e6 && place >= -5 {
        return format!("{value:.*}", (-place).max(0) as usize);
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = value.abs().log10().floor() as i32 - place;
    format!("{value:.*e}", digits.max(0) as usize)
}
