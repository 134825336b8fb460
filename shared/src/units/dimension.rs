//! The dimensions of the control's quantities, by their units in SI, and every product of two that
//! has a meaning.

use fixed::FixedI32;
use fixed::types::extra::Unsigned;

use crate::math::{Quantity, Times, Turn};

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
    /// Of a speed.
    TurnPerPeriod,
    /// Of the square of a speed.
    TurnPerPeriodSquare,
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
    /// The voltage that a flux induces, ω·φ.
    TurnPerPeriod, Weber => FixedI32;
}

impl Times<Self> for TurnPerPeriod {
    type Product<F: Unsigned> = Quantity<TurnPerPeriodSquare, F>;
}

impl<F> Quantity<TurnPerPeriod, F> {
    /// The angle that the rotor turns by in a period.
    #[inline(always)]
    pub const fn over_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits())
    }

    /// The angle of half a period.
    #[inline(always)]
    pub const fn over_half_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits() >> 1)
    }

    /// The angle of so many periods; it wraps.
    #[inline(always)]
    pub const fn over_periods(self, periods: i32) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits().wrapping_mul(periods))
    }
}

impl<F> Quantity<Turn, F> {
    /// The speed that turns by the angle in a period.
    #[inline(always)]
    pub const fn per_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}

impl<F> Quantity<TurnPerPeriodSquare, F> {
    /// The change of a speed in a period: of ω²·T_s one turn is a number, as a radian is.
    #[inline(always)]
    pub const fn over_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}
