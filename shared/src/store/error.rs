//! Integrity of the stored values, and storage errors.

/// Integrity of the stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// Every value is as saved.
    Sound,
    /// Nothing was stored: all values are defaults.
    Empty,
    /// A save was interrupted, or a value has rotted: the values are from an earlier save, or from this one's
    /// other copy.
    Incomplete,
    /// The very first save was interrupted: all values are defaults.
    Unfinished,
    /// The flash holds nothing usable: all values are defaults.
    Corrupt,
    /// The flash could not be read: all values are defaults.
    Unreadable,
}

impl Integrity {
    /// Returns true if something was stored and none of it is usable: the defaults may be for a motor other
    /// than the one that was set up.
    pub const fn is_lost(self) -> bool {
        matches!(self, Self::Unfinished | Self::Corrupt | Self::Unreadable)
    }
}

/// Why stored values cannot be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not two halves of whole flash pages.
    BadRange,
    /// A read, write or erase failed.
    Flash,
    /// The values do not fit, or the flash does not read back as written.
    NotStored,
}

impl StoreError {
    /// Returns a short text for the user.
    pub const fn text(self) -> &'static str {
        match self {
            Self::BadRange => "storage: unusable flash pages",
            Self::Flash => "storage: the flash failed",
            Self::NotStored => "storage: write not verified",
        }
    }
}
