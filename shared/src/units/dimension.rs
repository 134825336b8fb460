//! The dimensions of the control's quantities, by their units in SI, and every product of two that
//! has a meaning.

use fixed::FixedI32;
use fixed::types::extra::Unsigned;

use crate::math::Times;

/// Declares dimensions.
macro_rules! dimensions {
    ($($(#[$attribute:meta])* $name:ident),* $(,)?) => {$(
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug)]
        pub enum $name {}
    )*};
}

dimensions! {
    /// Of a flux linkage.
    Weber,
    /// Of an inverse flux.
    PerWeber,
    /// Of a torque.
    NewtonMetre,
}

/// Declares what two dimensions make, in either order.
macro_rules! products {
    ($($(#[$attribute:meta])* $one:ty, $other:ty => $product:ident;)*) => {$(
        $(#[$attribute])*
        impl Times<$other> for $one {
            type Product<F: Unsigned> = $product<F>;
        }

        impl Times<$one> for $other {
            type Product<F: Unsigned> = $product<F>;
        }
    )*};
}

products! {
    /// (9): i_q = ξ·T.
    NewtonMetre, PerWeber => FixedI32;
}
