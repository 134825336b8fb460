//! The numbers that the control computes with: quantities in its own units, in fixed point, and angles.
//!
//! Every quantity is a fraction of a base, so that a product needs only its top half ([`math`]).
//! Conversion from and to SI happens when the configuration is built and in telemetry, never in a
//! control period.
//!
//! A [`Quantity`] adds only to its own kind; [`dimension`] lists every product of two. A voltage
//! adds to a voltage:
//!
//! ```
//! # use siskin_units::{Current, Voltage};
//! let (u, i) = (Voltage::lit("0.5"), Current::lit("0.25"));
//! assert_eq!(u + u, Voltage::ONE);
//! ```
//!
//! but not to a current:
//!
//! ```compile_fail,E0308
//! # use siskin_units::{Current, Voltage};
//! let (u, i) = (Voltage::lit("0.5"), Current::lit("0.25"));
//! u + i;
//! ```
//!
//! An angle adds what a speed turns in a period:
//!
//! ```
//! # use siskin_units::{Angle, Speed};
//! let (theta, omega) = (Angle::lit("0.25"), Speed::lit("0.01"));
//! assert!(theta.wrapping_add(omega.over_period()) > theta);
//! ```
//!
//! but not the speed:
//!
//! ```compile_fail,E0308
//! # use siskin_units::{Angle, Speed};
//! let (theta, omega) = (Angle::lit("0.25"), Speed::lit("0.01"));
//! theta.wrapping_add(omega);
//! ```
//!
//! [`trace`] emits a state word by word, for two machines to compare.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

#[macro_use]
pub mod trace;

pub mod dimension;
pub mod math;

use fixed::types::I16F16;
use fixed::types::extra::{U16, U24, U26, U28, U32};

use crate::math::{Quantity, Real};

pub use crate::math::Angle;
pub use dimension::Charge;
use dimension::{
    Ampere, AmperePerPeriod, NewtonMetre, PerVolt, PerWeber, TurnPerPeriod, TurnPerPeriodSquare,
    Volt, VoltSquare, Weber,
};

/// Electrical speed in turns per control period: the angle's step.
pub type Speed = Quantity<TurnPerPeriod, U32>;

/// A current in units of [`Scale::current_a`].
pub type Current = Quantity<Ampere, U28>;

/// A voltage in units of [`Scale::voltage_v`].
pub type Voltage = Quantity<Volt, U28>;

/// A voltage with headroom for sums far beyond the supply.
pub type WideVoltage = Quantity<Volt, U24>;

/// A voltage of a vector rotated twice: each sine takes a fraction bit.
pub type TurnedVoltage = Quantity<Volt, U26>;

/// One over a voltage.
pub type InverseVoltage = Quantity<PerVolt, U28>;

/// Widens a voltage, for sums.
pub fn wide(u: Voltage) -> WideVoltage {
    u.scaled()
}

/// Narrows a voltage, saturated; the low four bits, which the wide type lacks, are 0.
pub fn narrow(u: WideVoltage) -> Voltage {
    Voltage::from_bits(u.to_bits().clamp(i32::MIN >> 4, i32::MAX >> 4) << 4)
}

/// A voltage squared.
pub type VoltageSquare = Quantity<VoltSquare, U24>;

/// A voltage squared, with headroom for sums far beyond the supply.
pub type WideVoltageSquare = Quantity<VoltSquare, U16>;

/// ω·i: how fast a current changes in a rotating frame, in units of current per period, over 2π.
pub type CurrentRate = Quantity<AmperePerPeriod, U28>;

/// A speed squared.
pub type SpeedSquare = Quantity<TurnPerPeriodSquare, U32>;

/// A torque in units of [`Scale::torque_nm`].
pub type Torque = Quantity<NewtonMetre, U28>;

/// A flux linkage in units of [`Scale::flux_wb`]: what one unit of voltage adds in a period.
pub type Flux = Quantity<Weber, U28>;

/// A flux linkage with headroom for that of a current.
pub type WideFlux = Quantity<Weber, U24>;

/// The motor's stated flux, 2/π: the voltage base makes it so for every motor.
pub const FLUX_NOMINAL: Flux = Flux::from_bits(170_891_319);

/// A quarter of an electrical turn, or 90°.
pub const QUARTER_TURN: Angle = Angle::from_bits(1 << 30);

/// The inverse flux ξ = 1/φ in units of [`Scale::inverse_flux_per_wb`].
pub type InverseFlux = Quantity<PerWeber, U32>;

/// The inverse of the motor's stated flux, ξ = 1/4: the voltage base makes it so for every motor.
pub const INVERSE_FLUX_NOMINAL: InverseFlux = InverseFlux::from_bits(1 << 30);

/// Returns the back-EMF of the motor's stated flux at a speed, |h| = ω/ξ.
pub fn stated_emf(omega: Speed) -> Voltage {
    // ξ = 1/4, and a speed has 32 fraction bits.
    Voltage::from_bits(omega.to_bits() >> 2)
}

/// Returns the torque of a q current with the motor's stated flux, T = i_q/ξ, saturated.
pub fn stated_torque(i_q: Current) -> Torque {
    Torque::from_bits(i_q.to_bits().saturating_mul(4))
}

/// An ADC reading in counts, signed and without its offset. The chip's are whole; simulated ideal
/// sensing has fractions.
pub type AdcCounts = I16F16;

/// The share of the PWM period for which the high side is on, 0 to 1. A phase that stays high has `Duty::MAX`, nearly
/// 2: it fills the period.
pub type Duty = fixed::types::U1F31;

/// The control's units in SI.
///
/// The bases are chosen so that Clarke's transform is two integer products (one unit of current is
/// 4096/3 counts), and so that every motor's flux is the same number: the voltage base is
/// π·φ/(2·T_s), which makes ξ = 1/4 and ψ = 2/π.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// The control period T_s, s.
    pub period_s: f32,
    /// One unit of [`Current`], peak phase amperes.
    pub current_a: f32,
    /// One unit of [`Voltage`], volts.
    pub voltage_v: f32,
    /// Pole pairs p.
    pub pole_pairs: f32,
}

impl Scale {
    /// Returns one unit of [`InverseFlux`], 1/Wb: with it, ω = ξ·|h| holds in the control's units.
    pub fn inverse_flux_per_wb(&self) -> f32 {
        core::f32::consts::TAU / (self.voltage_v * self.period_s)
    }

    /// Returns one unit of [`Flux`], Wb: with it, a voltage adds itself to a flux in a period.
    pub fn flux_wb(&self) -> f32 {
        self.voltage_v * self.period_s
    }

    /// Returns one unit of [`Torque`], Nm: with it, i_q = ξ·T (9) holds in the control's units.
    pub fn torque_nm(&self) -> f32 {
        1.5 * self.pole_pairs * self.current_a / self.inverse_flux_per_wb()
    }

    /// Converts mechanical rpm to a speed, saturated below half a turn per period.
    // Out of line, like `current_from_a`: every limit calls one of them.
    #[inline(never)]
    pub fn speed_from_rpm(&self, rpm: f32) -> Speed {
        Speed::from_f32(rpm * self.turns_per_rpm())
    }

    /// Converts a speed to mechanical rpm.
    pub fn rpm(&self, speed: Speed) -> f32 {
        speed.to_f32() / self.turns_per_rpm()
    }

    /// Converts amperes to a current, saturated.
    #[inline(never)] // every limit calls it
    pub fn current_from_a(&self, current_a: f32) -> Current {
        Current::from_f32(current_a / self.current_a)
    }

    /// Converts a current to amperes.
    pub fn amperes(&self, current: Current) -> f32 {
        current.to_f32() * self.current_a
    }

    /// Converts a voltage to volts.
    pub fn volts(&self, voltage: Voltage) -> f32 {
        voltage.to_f32() * self.voltage_v
    }

    fn turns_per_rpm(&self) -> f32 {
        self.pole_pairs * self.period_s / 60.0
    }
}
