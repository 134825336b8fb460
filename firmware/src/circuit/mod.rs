//! The worth of a count on each board: its circuit from shunts, terminals and supply to the converter.
//!
//! Plain numbers, which a PC needs as well to replay what the chip has done.

pub mod b_g431b_esc1;
#[cfg_attr(
    not(any(feature = "stm32g431", test)),
    expect(
        dead_code,
        reason = "for the boards with comparators; tested on the host"
    )
)]
pub(crate) mod trip_level;
pub mod vesc4_f405;
