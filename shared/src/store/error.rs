//! The integrity of stored values, and the errors of storage.

/// The integrity of the stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// Every value is the one that was saved.
    Sound,
    /// Nothing was stored: the values are the defaults.
    Empty,
    /// A save was interrupted, or a value has rotted: the values are those of an earlier save, or of the
    /// other copy of this one.
    Incomplete,
    /// The first save of all was interrupted: the values are the defaults.
    Unfinished,
    /// No order was found in the flash: the values are the defaults.
    Corrupt,
    /// The flash could not be read: the values are the defaults.
    Unreadable,
}

impl Integrity {
    /// Returns true if there was something and nothing of it can be used: the defaults may be those of
    /// another motor than the one that was set up.
    pub const fn is_lost(self) -> bool {
        matches!(self, Self::Unfinished | Self::Corrupt | Self::Unreadable)
    }
}

/// The reason why stored values cannot be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The range is not two halves of whole pages of the flash.
    BadRange,
    /// The flash refused a read, a write or an erase.
    Flash,
    /// The values do not fit, or the flash does not hold what was written.
    NotStored,
}

impl StoreError {
    /// A few words for a person.
    pub const fn text(self) -> &'static str {
        match self {
            Self::BadRange => "storage: too few or uneven pages of flash",
            Self::Flash => "storage: the flash failed",
            Self::NotStored => "storage: the flash does not hold the values",
        }
    }
}
