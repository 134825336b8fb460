//! The board, chosen by a feature.

#[cfg(feature = "b-g431b-esc1")]
mod b_g431b_esc1;
#[cfg(feature = "b-g431b-esc1")]
pub(crate) use b_g431b_esc1::{BOARD, Converters, Hardware, SAMPLING_CLOCKS, clock};
