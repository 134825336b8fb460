//! The dimensions of the control's quantities, by their units in SI, and every product of two that
//! has a meaning.
//!
//! Each conversion is inlined: it is no instruction at all, but for one with a factor.

use fixed::FixedI32;
use fixed::types::I36F28;
use fixed::types::extra::{U28, Unsigned};

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
    /// Of a current.
    Ampere,
    /// Of a current that turns: what ω·i is.
    AmperePerPeriod,
    /// Of a voltage.
    Volt,
    /// Of one over a voltage.
    PerVolt,
    /// Of a power.
    Watt,
    /// Of the square of a voltage.
    VoltSquare,
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
            type Product<F: Unsigned> = Quantity<$product, F>;
        }

        impl Times<$one> for $other {
            type Product<F: Unsigned> = Quantity<$product, F>;
        }
    )*};
}

products! {
    /// (9): i_q = ξ·T.
    NewtonMetre, PerWeber => Ampere;
    /// The voltage that a flux induces, ω·φ.
    TurnPerPeriod, Weber => Volt;
    /// A power.
    Volt, Ampere => Watt;
    /// The current that a power takes from a supply.
    Watt, PerVolt => Ampere;
    /// The speed that a back-EMF tells, ω = ξ·|h|.
    PerWeber, Volt => TurnPerPeriod;
    /// The rate of a current in a frame that turns, ω·i.
    TurnPerPeriod, Ampere => AmperePerPeriod;
}

/// The share of a voltage in another.
impl Times<PerVolt> for Volt {
    type Product<F: Unsigned> = FixedI32<F>;
}

impl Times<Self> for Volt {
    type Product<F: Unsigned> = Quantity<VoltSquare, F>;
}

impl<F> Quantity<Volt, F> {
    /// The flux linkage that the voltage adds in a period.
    pub const fn over_period(self) -> Quantity<Weber, F> {
        Quantity::from_bits(self.to_bits())
    }
}

impl Times<Self> for TurnPerPeriod {
    type Product<F: Unsigned> = Quantity<TurnPerPeriodSquare, F>;
}

/// A current over a time, in units of current times periods.
pub type Charge = I36F28;

impl Quantity<Ampere, U28> {
    /// The charge of so many periods.
    pub fn over_periods(self, periods: u32) -> Charge {
        Charge::from_bits(i64::from(self.to_bits())) * i64::from(periods)
    }
}

impl<F> Quantity<TurnPerPeriod, F> {
    /// ω·T_s in turns, a plain number.
    pub const fn turns(self) -> FixedI32<F> {
        FixedI32::from_bits(self.to_bits())
    }

    /// The angle that the rotor turns by in a period.
    pub const fn over_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits())
    }

    /// The angle of half a period.
    pub const fn over_half_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits() >> 1)
    }

    /// The angle of so many periods; it wraps.
    pub const fn over_periods(self, periods: i32) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits().wrapping_mul(periods))
    }
}

impl<F> Quantity<Turn, F> {
    /// The speed that turns by the angle in a period.
    pub const fn per_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}

impl<F> Quantity<TurnPerPeriodSquare, F> {
    /// The change of a speed in a period: of ω²·T_s one turn is a number, as a radian is.
    pub const fn over_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}
