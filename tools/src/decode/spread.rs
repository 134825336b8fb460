//! Minimum, mean and maximum of many numbers.

use serde_json::{Value, json};

/// Running statistics of numbers, which are not kept.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spread {
    count: u64,
    least: f64,
    most: f64,
    sum: f64,
    squares: f64,
}

impl Spread {
    pub(super) fn add(&mut self, number: f64) {
        if self.count == 0 {
            (self.least, self.most) = (number, number);
        }
        self.count += 1;
        self.least = self.least.min(number);
        self.most = self.most.max(number);
        self.sum += number;
        self.squares += number * number;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(super) fn most(&self) -> f64 {
        self.most
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }

    pub(super) fn rms(&self) -> f64 {
        (self.squares / self.count.max(1) as f64).sqrt()
    }

    /// Returns minimum, mean and maximum; `None` without numbers.
    pub(super) fn range(&self) -> Option<Range> {
        (!self.is_empty()).then(|| Range {
            least: self.least,
            mean: self.mean(),
            most: self.most,
        })
    }

    /// Converts intervals in ns to rates in Hz. The mean is how often they occur.
    pub(super) fn rate_hz(&self) -> Option<Range> {
        self.range().map(|interval_ns| Range {
            least: 1e9 / interval_ns.most,
            mean: 1e9 / interval_ns.mean,
            most: 1e9 / interval_ns.least,
        })
    }
}

/// The range in which numbers lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    least: f64,
    mean: f64,
    most: f64,
}

impl Range {
    /// Formats it as `least to most, mean mean` with this many decimals.
    pub(super) fn text(&self, decimals: usize) -> String {
        format!(
            "{:.decimals$} to {:.decimals$}, mean {:.decimals$}",
            self.least, self.most, self.mean
        )
    }

    /// Converts it to a JSON object.
    pub(super) fn json(self) -> Value {
        json!({ "min": short(self.least), "mean": short(self.mean), "max": short(self.most) })
    }
}

/// Rounds to four decimals, beyond which digits mean nothing.
pub(super) fn short(number: f64) -> f64 {
    (number * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_mean_and_most() {
        let mut spread = Spread::default();
        assert!(spread.is_empty());
        assert_eq!(spread.range(), None);
        for number in [-3.0, 1.0, 5.0] {
            spread.add(number);
        }
        let range = spread.range().expect("numbers");
        assert_eq!(range.text(1), "-3.0 to 5.0, mean 1.0");
        assert_eq!(spread.rms(), (35.0_f64 / 3.0).sqrt());
        assert_eq!(
            range.json(),
            json!({ "min": -3.0, "mean": 1.0, "max": 5.0 })
        );
    }

    #[test]
    fn the_mean_rate_is_how_often_something_comes() {
        let mut interval_ns = Spread::default();
        assert_eq!(interval_ns.rate_hz(), None);
        for _ in 0..4 {
            interval_ns.add(50e3);
            interval_ns.add(200e3);
        }
        let rate_hz = interval_ns.rate_hz().expect("intervals");
        assert_eq!(rate_hz.text(1), "5000.0 to 20000.0, mean 8000.0");
    }
}
