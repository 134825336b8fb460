//! Numbers with a dimension: a current is not a voltage, though both have the same bits.
//!
//! Each operator is at most one instruction. They are inlined even into callers that are not
//! optimised for speed, since a call would be longer.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Shl, Shr, Sub, SubAssign};

use fixed::FixedI32;
use fixed::traits::{FromFixed, ToFixed};
use fixed::types::extra::{Diff, LeEqU32, Sum, U32, Unsigned};

use super::{Number, TopProduct};
use crate::trace::Trace;

/// A number of dimension `D` with `F` fraction bits.
///
/// It adds only to its own kind. Multiplied by a plain number it keeps its dimension; [`Times`]
/// defines the product of two dimensions, and no other product compiles.
#[repr(transparent)]
pub struct Quantity<D, F> {
    number: FixedI32<F>,
    dimension: PhantomData<D>,
}

/// The product of two dimensions, defined once for each pair that has a meaning.
pub trait Times<Rhs> {
    /// The product with `F` fraction bits.
    type Product<F: Unsigned>: Number;
}

impl<D, F> Quantity<D, F> {
    /// Zero.
    pub const ZERO: Self = Self::from_bits(0);
    /// The smallest step of the type.
    pub const DELTA: Self = Self::from_bits(1);
    /// The smallest value of the type.
    pub const MIN: Self = Self::from_bits(i32::MIN);
    /// The largest value of the type.
    pub const MAX: Self = Self::from_bits(i32::MAX);

    /// Gives a plain number this dimension.
    const fn of(number: FixedI32<F>) -> Self {
        Self {
            number,
            dimension: PhantomData,
        }
    }

    /// Creates a quantity from its bits.
    pub const fn from_bits(bits: i32) -> Self {
        Self::of(FixedI32::from_bits(bits))
    }

    /// Returns its bits.
    pub const fn to_bits(self) -> i32 {
        self.number.to_bits()
    }

    /// Returns true if it is below zero.
    pub const fn is_negative(self) -> bool {
        self.to_bits() < 0
    }

    /// Returns true if it is above zero.
    pub const fn is_positive(self) -> bool {
        self.to_bits() > 0
    }

    /// self + rhs, wrapped.
    #[must_use]
    pub const fn wrapping_add(self, rhs: Self) -> Self {
        Self::from_bits(self.to_bits().wrapping_add(rhs.to_bits()))
    }

    /// self − rhs, wrapped.
    #[must_use]
    pub const fn wrapping_sub(self, rhs: Self) -> Self {
        Self::from_bits(self.to_bits().wrapping_sub(rhs.to_bits()))
    }

    /// self + rhs, saturated.
    #[must_use]
    pub const fn saturating_add(self, rhs: Self) -> Self {
        Self::from_bits(self.to_bits().saturating_add(rhs.to_bits()))
    }

    /// self − rhs, saturated.
    #[must_use]
    pub const fn saturating_sub(self, rhs: Self) -> Self {
        Self::from_bits(self.to_bits().saturating_sub(rhs.to_bits()))
    }

    /// self·rhs, wrapped.
    #[must_use]
    pub const fn wrapping_mul_int(self, rhs: i32) -> Self {
        Self::from_bits(self.to_bits().wrapping_mul(rhs))
    }

    /// self·rhs, saturated.
    #[must_use]
    pub const fn saturating_mul_int(self, rhs: i32) -> Self {
        Self::from_bits(self.to_bits().saturating_mul(rhs))
    }

    /// self/rhs, or `None` on division by zero or overflow.
    pub fn checked_div_int(self, rhs: i32) -> Option<Self> {
        self.to_bits().checked_div(rhs).map(Self::from_bits)
    }

    /// −self, wrapped.
    #[must_use]
    pub const fn wrapping_neg(self) -> Self {
        Self::from_bits(self.to_bits().wrapping_neg())
    }

    /// −self, saturated.
    #[must_use]
    pub const fn saturating_neg(self) -> Self {
        Self::from_bits(self.to_bits().saturating_neg())
    }

    /// |self|, saturated.
    #[must_use]
    pub const fn saturating_abs(self) -> Self {
        Self::from_bits(self.to_bits().saturating_abs())
    }

    /// |self|.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self::from_bits(self.to_bits().abs())
    }

    /// |self| in bits.
    pub const fn magnitude_bits(self) -> u32 {
        self.to_bits().unsigned_abs()
    }
}

impl<D, F: Unsigned> Quantity<D, F> {
    /// One unit, where the type can hold it.
    pub const ONE: Self = Self::from_bits(1 << F::U32);

    /// The number of fraction bits.
    pub const FRAC_NBITS: u32 = F::U32;

    /// Converts to `G` fraction bits: fewer drop the last bits, more wrap what no longer fits.
    #[must_use]
    pub const fn scaled<G: Unsigned>(self) -> Quantity<D, G> {
        let bits = self.to_bits();
        Quantity::from_bits(if G::U32 >= F::U32 {
            bits << (G::U32 - F::U32)
        } else {
            bits >> (F::U32 - G::U32)
        })
    }
}

impl<D, F: LeEqU32> Quantity<D, F> {
    /// Parses a decimal number, for constants.
    pub const fn lit(number: &str) -> Self {
        Self::of(FixedI32::<F>::lit(number))
    }

    /// Rounds a number that the type can hold to the nearest quantity; for tests and simulations.
    pub fn from_num<N: ToFixed>(number: N) -> Self {
        Self::of(FixedI32::from_num(number))
    }

    /// Converts any number, wrapped.
    pub fn wrapping_from_num<N: ToFixed>(number: N) -> Self {
        Self::of(FixedI32::wrapping_from_num(number))
    }

    /// Converts any number, saturated.
    pub fn saturating_from_num<N: ToFixed>(number: N) -> Self {
        Self::of(FixedI32::saturating_from_num(number))
    }

    /// Converts to a plain number; for tests and simulations.
    pub fn to_num<N: FromFixed>(self) -> N {
        self.number.to_num()
    }
}

impl<D, F: Unsigned> Number for Quantity<D, F> {
    type Frac = F;

    fn from_bits(bits: i32) -> Self {
        Self::from_bits(bits)
    }

    fn to_bits(self) -> i32 {
        self.to_bits()
    }
}

impl<D, F> Trace for Quantity<D, F> {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.number.trace(out);
    }
}

// By hand: derives would demand the same traits of the dimension.
impl<D, F> Clone for Quantity<D, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<D, F> Copy for Quantity<D, F> {}

impl<D, F> Default for Quantity<D, F> {
    fn default() -> Self {
        Self::ZERO
    }
}

impl<D, F> PartialEq for Quantity<D, F> {
    fn eq(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl<D, F> Eq for Quantity<D, F> {}

impl<D, F> PartialOrd for Quantity<D, F> {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }

    fn lt(&self, other: &Self) -> bool {
        self.to_bits() < other.to_bits()
    }

    fn le(&self, other: &Self) -> bool {
        self.to_bits() <= other.to_bits()
    }

    fn gt(&self, other: &Self) -> bool {
        self.to_bits() > other.to_bits()
    }

    fn ge(&self, other: &Self) -> bool {
        self.to_bits() >= other.to_bits()
    }
}

impl<D, F> Ord for Quantity<D, F> {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        self.to_bits().cmp(&other.to_bits())
    }

    fn max(self, other: Self) -> Self {
        Self::from_bits(self.to_bits().max(other.to_bits()))
    }

    fn min(self, other: Self) -> Self {
        Self::from_bits(self.to_bits().min(other.to_bits()))
    }
}

impl<D, F: LeEqU32> fmt::Debug for Quantity<D, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.number.fmt(f)
    }
}

impl<D, F: LeEqU32> fmt::Display for Quantity<D, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.number.fmt(f)
    }
}

impl<D, F> Add for Quantity<D, F> {
    type Output = Self;

    fn add(self, rhs: Self) -> Self {
        Self::of(self.number + rhs.number)
    }
}

impl<D, F> Sub for Quantity<D, F> {
    type Output = Self;

    fn sub(self, rhs: Self) -> Self {
        Self::of(self.number - rhs.number)
    }
}

impl<D, F> Neg for Quantity<D, F> {
    type Output = Self;

    fn neg(self) -> Self {
        Self::of(-self.number)
    }
}

impl<D, F> AddAssign for Quantity<D, F> {
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl<D, F> SubAssign for Quantity<D, F> {
    fn sub_assign(&mut self, rhs: Self) {
        *self = *self - rhs;
    }
}

impl<D, F> Mul<i32> for Quantity<D, F> {
    type Output = Self;

    fn mul(self, rhs: i32) -> Self {
        Self::from_bits(self.to_bits() * rhs)
    }
}

impl<D, F> Div<i32> for Quantity<D, F> {
    type Output = Self;

    fn div(self, rhs: i32) -> Self {
        Self::from_bits(self.to_bits() / rhs)
    }
}

impl<D, F> Shl<u32> for Quantity<D, F> {
    type Output = Self;

    fn shl(self, rhs: u32) -> Self {
        Self::from_bits(self.to_bits() << rhs)
    }
}

impl<D, F> Shr<u32> for Quantity<D, F> {
    type Output = Self;

    fn shr(self, rhs: u32) -> Self {
        Self::from_bits(self.to_bits() >> rhs)
    }
}

impl<D, A, B> TopProduct<FixedI32<B>> for Quantity<D, A>
where
    A: Unsigned + Add<B>,
    B: Unsigned,
    Sum<A, B>: Unsigned + Sub<U32>,
    Diff<Sum<A, B>, U32>: Unsigned,
{
    type Output = Quantity<D, Diff<Sum<A, B>, U32>>;

    fn top(self, rhs: FixedI32<B>) -> Self::Output {
        Quantity::of(self.number.top(rhs))
    }
}

impl<D, A, B> TopProduct<Quantity<D, B>> for FixedI32<A>
where
    A: Unsigned + Add<B>,
    B: Unsigned,
    Sum<A, B>: Unsigned + Sub<U32>,
    Diff<Sum<A, B>, U32>: Unsigned,
{
    type Output = Quantity<D, Diff<Sum<A, B>, U32>>;

    fn top(self, rhs: Quantity<D, B>) -> Self::Output {
        Quantity::of(self.top(rhs.number))
    }
}

impl<D, E, A, B> TopProduct<Quantity<E, B>> for Quantity<D, A>
where
    D: Times<E>,
    A: Unsigned + Add<B>,
    B: Unsigned,
    Sum<A, B>: Unsigned + Sub<U32>,
    Diff<Sum<A, B>, U32>: Unsigned,
{
    type Output = D::Product<Diff<Sum<A, B>, U32>>;

    fn top(self, rhs: Quantity<E, B>) -> Self::Output {
        D::Product::from_bits(self.number.top(rhs.number).to_bits())
    }
}
