//! Estimates the analyser's sample rate if the export does not state it.

/// Common analyser rates, MHz.
const RATES_MHZ: [f64; 24] = [
    0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.25, 8.0, 10.0, 12.0, 12.5, 15.0, 16.0, 20.0, 24.0, 25.0,
    30.0, 32.0, 40.0, 48.0, 50.0, 80.0, 100.0,
];

/// Times are whole nanoseconds, and so is their origin.
const ROUNDING_NS: f64 = 1.01;

/// Edges that are looked at.
const EDGES: u32 = 500;

/// The coarsest sampling grid that all edges so far lie on.
#[derive(Debug)]
pub(super) struct Sampling {
    told_hz: Option<f64>,
    first_ns: Option<i64>,
    edges: u32,
    /// Index of the slowest of [`RATES_MHZ`] that is still possible.
    slowest: usize,
}

impl Sampling {
    /// `told_hz` is what the export states, if anything.
    pub(super) fn new(told_hz: Option<f64>) -> Self {
        Self {
            told_hz,
            first_ns: None,
            edges: 0,
            slowest: 0,
        }
    }

    pub(super) fn edge(&mut self, at_ns: i64) {
        if self.told_hz.is_some() || self.edges >= EDGES {
            return;
        }
        self.edges += 1;
        let since_ns = (at_ns - *self.first_ns.get_or_insert(at_ns)) as f64;
        let fits = |mhz: &f64| {
            let samples = since_ns * mhz * 1e-3;
            (samples - samples.round()).abs() / (mhz * 1e-3) <= ROUNDING_NS
        };
        // A rate ruled out by an earlier edge may fit the next one: only the rest is searched.
        self.slowest += RATES_MHZ[self.slowest..]
            .iter()
            .take_while(|mhz| !fits(mhz))
            .count();
    }

    /// Returns the analyser's rate, Hz; `None` if it cannot be determined or is above 100 MHz.
    pub(super) fn hz(&self) -> Option<f64> {
        self.told_hz.or_else(|| {
            let mhz = RATES_MHZ.get(self.slowest)?;
            (self.edges > 1).then_some(mhz * 1e6)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_is_found_whatever_was_rounded() {
        for mhz in RATES_MHZ {
            let mut sampling = Sampling::new(None);
            let mut sample = 0_u64;
            for edge in 0..EDGES {
                // Distances without a common factor.
                sample += u64::from(edge % 7) * 3 + 1;
                sampling.edge((sample as f64 * 1e3 / mhz).round() as i64);
            }
            assert_eq!(sampling.hz(), Some(mhz * 1e6));
        }
    }

    #[test]
    fn what_is_told_counts_and_what_lies_on_no_raster_has_none() {
        let mut sampling = Sampling::new(Some(7e6));
        sampling.edge(1);
        assert_eq!(sampling.hz(), Some(7e6));
        let mut sampling = Sampling::new(None);
        assert_eq!(sampling.hz(), None);
        for edge in 0..i64::from(EDGES) {
            sampling.edge(edge * edge * 13 + edge);
        }
        assert_eq!(sampling.hz(), None);
    }
}
