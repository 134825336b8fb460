//! Fixed-point arithmetic in which every product keeps the top half of its 64 bits.
//!
//! `((a as i64 * b as i64) >> 32) as i32` is one SMMUL on a Cortex-M4 and gives the same bits on a
//! PC. The [`fixed`] crate's types carry the fraction bits, so the compiler does the bookkeeping:
//! the product of `a` and `b` fraction bits has `a + b - 32`.

mod elementary;
mod gain;
mod held;
mod multiplier;
mod number;
mod product;
mod quantity;
mod quotient;
mod real;
mod root;
mod trig;

pub use elementary::{SQRT_3, logarithm, settled, square_root};
pub use gain::Gain;
pub use gain::parts as gain_parts;
pub use held::Held;
pub use multiplier::Multiplier;
pub use number::Number;
pub use product::{EIGHTH_PI, TopProduct, TopSum};
pub use quantity::{Quantity, Times};
pub use quotient::{divide, quotient};
pub use real::{Real, round};
pub use root::{magnitude, other_leg};
pub use trig::{Angle, SinCos, Turn, atan2_turns, sin_cos};
