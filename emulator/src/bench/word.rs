//! A supply in a word: volts, or a pack by its cells.

use crate::plant::Supply;

/// The most cells of a pack: the voltage dividers end at 70 V.
pub(super) const CELLS_MAX: u32 = 14;

/// Parses `24`, `24.0` or `6s`.
pub(super) fn word(text: &str) -> Option<Supply> {
    if let Some(cells) = text.strip_suffix(['s', 'S']) {
        let cells = cells.parse().ok()?;
        return (1..=CELLS_MAX)
            .contains(&cells)
            .then(|| Supply::battery(cells));
    }
    let volts = text.parse().ok()?;
    (volts > 0.0 && volts <= 70.0).then(|| Supply::stiff(volts))
}
