//! What an ADC count is worth on each board: the circuit from shunts, terminals and supply to the converter.
//!
//! Plain numbers, which a PC also needs to replay what the chip did.

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
