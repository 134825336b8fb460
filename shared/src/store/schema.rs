//! The conversion of older firmware's values to this one's.

/// Number of what keys and values mean now. It grows with each new row of [`CHANGES`].
pub(super) const SCHEMA: u32 = 1;

/// Values renamed or rescaled since the first schema, in that order.
pub(super) const CHANGES: &[Change] = &[];

/// A parameter that has another key or unit than it once had.
pub(super) struct Change {
    /// The last schema in which it was otherwise.
    pub(super) from: u32,
    /// Its key then.
    pub(super) old: u16,
    /// Its key since.
    pub(super) new: u16,
    /// Its value since over its value then.
    pub(super) factor: f32,
}

/// The key and the bits today of what was stored under an older schema.
pub(super) fn change(changes: &[Change], schema: u32, key: u16, bits: u32) -> (u16, u32) {
    changes.iter().filter(|change| schema <= change.from).fold(
        (key, bits),
        |(key, bits), change| {
            if key == change.old {
                let value = f32::from_bits(bits) * change.factor;
                (change.new, value.to_bits())
            } else {
                (key, bits)
            }
        },
    )
}
