//! The poles of the supply.

/// A pole of the supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rail {
    /// The negative one.
    Low,
    /// The positive one.
    High,
}

impl Rail {
    pub(super) const fn other(self) -> Self {
        match self {
            Self::Low => Self::High,
            Self::High => Self::Low,
        }
    }
}
