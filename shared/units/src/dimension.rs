//! The dimensions of the control's quantities, named by SI unit, and every product of two that has
//! a meaning.
//!
//! Each conversion is inlined and costs no instruction, except one with a factor.

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
    /// Current.
    Ampere,
    /// Rotating current, ω·i.
    AmperePerPeriod,
    /// Voltage.
    Volt,
    /// Inverse voltage.
    PerVolt,
    /// Power.
    Watt,
    /// Voltage squared.
    VoltSquare,
    /// Flux linkage.
    Weber,
    /// Inverse flux.
    PerWeber,
    /// Torque.
    NewtonMetre,
    /// Speed.
    TurnPerPeriod,
    /// Speed squared.
    TurnPerPeriodSquare,
}

/// Declares the product of two dimensions, in either order.
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
    /// The current that a power draws from a supply.
    Watt, PerVolt => Ampere;
    /// The speed that a back-EMF shows, ω = ξ·|h|.
    PerWeber, Volt => TurnPerPeriod;
    /// The rate of a current in a rotating frame, ω·i.
    TurnPerPeriod, Ampere => AmperePerPeriod;
}

/// The ratio of two voltages.
impl Times<PerVolt> for Volt {
    type Product<F: Unsigned> = FixedI32<F>;
}

impl Times<Self> for Volt {
    type Product<F: Unsigned> = Quantity<VoltSquare, F>;
}

impl<F> Quantity<Volt, F> {
    /// Returns the flux linkage that the voltage adds in a period.
    pub const fn over_period(self) -> Quantity<Weber, F> {
        Quantity::from_bits(self.to_bits())
    }
}

impl Times<Self> for TurnPerPeriod {
    type Product<F: Unsigned> = Quantity<TurnPerPeriodSquare, F>;
}

/// A current over time, in units of current times periods.
pub type Charge = I36F28;

impl Quantity<Ampere, U28> {
    /// Returns the charge over this many periods.
    pub fn over_periods(self, periods: u32) -> Charge {
        Charge::from_bits(i64::from(self.to_bits())) * i64::from(periods)
    }
}

impl<F> Quantity<TurnPerPeriod, F> {
    /// Returns ω·T_s in turns, a plain number.
    pub const fn turns(self) -> FixedI32<F> {
        FixedI32::from_bits(self.to_bits())
    }

    /// Returns the angle that the rotor turns in a period.
    pub const fn over_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits())
    }

    /// Returns the angle turned in half a period.
    pub const fn over_half_period(self) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits() >> 1)
    }

    /// Returns the angle turned in this many periods; it wraps.
    pub const fn over_periods(self, periods: i32) -> Quantity<Turn, F> {
        Quantity::from_bits(self.to_bits().wrapping_mul(periods))
    }
}

impl<F> Quantity<Turn, F> {
    /// Returns the speed that turns this angle in a period.
    pub const fn per_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}

impl<F> Quantity<TurnPerPeriodSquare, F> {
    /// Returns the change of speed in a period: in ω²·T_s one of the turns counts as a plain
    /// number, as a radian does.
    pub const fn over_period(self) -> Quantity<TurnPerPeriod, F> {
        Quantity::from_bits(self.to_bits())
    }
}
