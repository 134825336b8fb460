//! Formulas of quantities, at one byte per operand.
//!
//! The coefficients take some two hundred formulas. As machine code an operand costs eight bytes of flash or more, to
//! load it and to multiply. Here the compiler encodes a block's formulas as bytes, and one loop evaluates them in
//! order, each from left to right like a pocket calculator.

use core::cell::Cell;

use fixed::types::extra::Unsigned;

use super::quantity::Quantity;
use super::si::{OUT_OF_RANGE, Si};
use crate::math::{Gain, Multiplier, Number, Real, gain_parts, whole};
use crate::params::table::ParamId;
use crate::units::Charge;

/// Fills the fields of a place with the values of formulas, in order:
///
/// ```text
/// fill!(p, place, {
///     define ActsS(Decay / ROverL),
///     gain admittance(MotLUh, ActsS / L * CurrentPerVoltage),
///     number corner([CORNER_RAD_S] * T / Tau),
/// });
/// ```
///
/// A quantity is written by name, a number in brackets; the operators are `*`, `/`, `-`, `max`, `min`, and `+` in front
/// of a number. `define` stores the value as a quantity. `gain` and `factor` name the parameter that is refused if the
/// coefficient leaves its range; `number` makes a fixed-point number, `count` a whole one.
macro_rules! fill {
    ($si:expr, $place:expr, { $($kind:ident $name:ident($($formula:tt)*)),* $(,)? }) => {{
        let formulas = $crate::params::build::formula::formulas!(
            $si, { $($kind $name($($formula)*)),* }
        );
        $($crate::params::build::formula::fill_one!(formulas, $place, $kind $name);)*
    }};
}

/// The formulas of [`fill!`] for values that are no fields: the caller reads them in order.
macro_rules! formulas {
    ($si:expr, { $($kind:ident $name:ident($($formula:tt)*)),* $(,)? }) => {{
        const ENTRIES: &[$crate::params::build::formula::Entry] =
            &[$($crate::params::build::formula::entry!($kind $name($($formula)*))),*];
        const LENGTH: usize = $crate::params::build::formula::length(ENTRIES);
        static BYTES: [u8; LENGTH] = $crate::params::build::formula::bytes(ENTRIES);
        $si.begin(&BYTES)
    }};
}

/// Defines quantities by formulas.
macro_rules! define {
    ($si:expr, { $($name:ident($($formula:tt)*)),* $(,)? }) => {
        $crate::params::build::formula::formulas!($si, { $(define $name($($formula)*)),* }).define()
    };
}

/// Evaluates one formula.
macro_rules! value {
    ($si:expr, $($formula:tt)*) => {
        $crate::params::build::formula::formulas!($si, { value it($($formula)*) }).value()
    };
}

/// Refuses each parameter whose formula is below zero, with the reason after it; the first one counts.
macro_rules! refuse {
    ($si:expr, { $($param:ident($($formula:tt)*) $reason:expr),* $(,)? }) => {
        $crate::params::build::formula::formulas!($si, {
            $(refusing refused($param, $($formula)*)),*
        }).refuse(&[$($reason),*])
    };
}

macro_rules! fill_one {
    ($formulas:ident, $place:expr, define $name:ident) => {};
    ($formulas:ident, $place:expr, $kind:ident $name:ident) => {
        $place.$name = $formulas.$kind()
    };
}

macro_rules! entry {
    (define $name:ident($($formula:tt)*)) => {
        $crate::params::build::formula::Entry {
            head: $crate::params::build::formula::DEFINE
                | $crate::params::build::quantity::Quantity::$name.0,
            terms: $crate::params::build::formula::terms!($($formula)*),
        }
    };
    (gain $name:ident($($formula:tt)*)) => {
        $crate::params::build::formula::entry!(refusing $name($($formula)*))
    };
    (factor $name:ident($($formula:tt)*)) => {
        $crate::params::build::formula::entry!(refusing $name($($formula)*))
    };
    (refusing $name:ident($param:ident, $($formula:tt)*)) => {
        $crate::params::build::formula::Entry {
            head: $crate::params::ParamId::$param as u8,
            terms: $crate::params::build::formula::terms!($($formula)*),
        }
    };
    ($kind:ident $name:ident($($formula:tt)*)) => {
        $crate::params::build::formula::Entry {
            head: $crate::params::build::formula::END,
            terms: $crate::params::build::formula::terms!($($formula)*),
        }
    };
}

macro_rules! terms {
    ($first:tt $($operator:tt $operand:tt)*) => {
        &[
            $crate::params::build::formula::term!(* $first),
            $($crate::params::build::formula::term!($operator $operand)),*
        ]
    };
}

macro_rules! term {
    (+ [$number:expr]) => {
        $crate::params::build::formula::term!(-[-$number])
    };
    ($operator:tt $operand:tt) => {
        (
            $crate::params::build::formula::operator!($operator),
            $crate::params::build::formula::operand!($operand),
        )
    };
}

macro_rules! operator {
    (*) => {
        $crate::params::build::formula::Operator::Times
    };
    (/) => {
        $crate::params::build::formula::Operator::Over
    };
    (-) => {
        $crate::params::build::formula::Operator::Less
    };
    (max) => {
        $crate::params::build::formula::Operator::Max
    };
    (min) => {
        $crate::params::build::formula::Operator::Min
    };
}

macro_rules! operand {
    ([$number:expr]) => {
        $crate::params::build::formula::Operand::Number($number)
    };
    ($quantity:ident) => {
        $crate::params::build::formula::Operand::Quantity(
            $crate::params::build::quantity::Quantity::$quantity,
        )
    };
}

pub(super) use {
    define, entry, fill, fill_one, formulas, operand, operator, refuse, term, terms, value,
};

/// A formula and what its value is for.
pub(super) struct Entry {
    /// The parameter that may be refused, the quantity that is defined, or [`END`].
    pub(super) head: u8,
    pub(super) terms: &'static [(Operator, Operand)],
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Operator {
    Times,
    Over,
    Less,
    Max,
    Min,
}

#[derive(Clone, Copy)]
pub(super) enum Operand {
    Quantity(Quantity),
    Number(f32),
}

/// Set in a head that defines a quantity.
pub(super) const DEFINE: u8 = 0x80;

/// Set in an operand that divides.
const OVER: u8 = 0x80;

/// Precedes an operand that is not multiplied.
const LESS: u8 = 0x7a;
const MAX: u8 = 0x7b;
const MIN: u8 = 0x7c;

/// Stands in for a quantity: the number in the next four bytes.
const NUMBER: u8 = 0x7d;

/// Follows the last operand.
pub(super) const END: u8 = 0x7e;

const _: () = assert!(Quantity::COUNT <= LESS as usize && ParamId::ALL.len() <= END as usize);

/// Returns the number of bytes of the formulas.
pub(super) const fn length(entries: &[Entry]) -> usize {
    write(entries, &mut [])
}

/// Returns the bytes of the formulas.
pub(super) const fn bytes<const LENGTH: usize>(entries: &[Entry]) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    write(entries, &mut bytes);
    bytes
}

/// Writes as many bytes as fit; returns how many there are.
const fn write(entries: &[Entry], bytes: &mut [u8]) -> usize {
    let (mut at, mut i) = (0, 0);
    while i < entries.len() {
        at = put(bytes, at, entries[i].head);
        let (terms, mut j) = (entries[i].terms, 0);
        while j < terms.len() {
            let (operator, operand) = terms[j];
            at = match operator {
                Operator::Times | Operator::Over => at,
                Operator::Less => put(bytes, at, LESS),
                Operator::Max => put(bytes, at, MAX),
                Operator::Min => put(bytes, at, MIN),
            };
            let over = if matches!(operator, Operator::Over) {
                OVER
            } else {
                0
            };
            at = match operand {
                Operand::Quantity(quantity) => put(bytes, at, over | quantity.0),
                Operand::Number(number) => {
                    let [a, b, c, d] = number.to_le_bytes();
                    at = put(bytes, at, over | NUMBER);
                    at = put(bytes, at, a);
                    at = put(bytes, at, b);
                    at = put(bytes, at, c);
                    put(bytes, at, d)
                }
            };
            j += 1;
        }
        at = put(bytes, at, END);
        i += 1;
    }
    at
}

const fn put(bytes: &mut [u8], at: usize, byte: u8) -> usize {
    if at < bytes.len() {
        bytes[at] = byte;
    }
    at + 1
}

impl Si<'_> {
    /// Starts the evaluation of these formulas.
    #[inline(never)] // the chip stores two words at each of many
    pub(super) fn begin(&self, formulas: &'static [u8]) -> Formulas<'_> {
        self.formulas.set(formulas);
        Formulas(self)
    }
}

/// The formulas that were begun.
pub(super) struct Formulas<'a>(&'a Si<'a>);

impl Formulas<'_> {
    /// Returns the next value as a gain; if it has none, its parameter is refused.
    pub(super) fn gain<A: Number, B: Number>(&self) -> Gain<A, B> {
        let (mantissa, shift) = self.parts(B::Frac::I32 - A::Frac::I32 + LEAST);
        Gain::from_parts(mantissa, shift)
    }

    /// Returns the next value as a factor; if it is out of range, its parameter is refused.
    pub(super) fn factor<A: Number, B: Number>(&self) -> Multiplier<A, B> {
        Multiplier::from_bits(self.bits(B::Frac::I32 - A::Frac::I32 + LEAST))
    }

    /// Returns the next value in fixed point, saturated.
    pub(super) fn number<N: Number>(&self) -> N {
        N::from_bits(self.whole(N::Frac::I32))
    }

    /// Returns the next value without its fraction. Never inlined, nor are the next: each coefficient calls one of
    /// them.
    #[inline(never)]
    pub(super) fn count(&self) -> u32 {
        self.value() as u32
    }

    /// Returns the next value as a charge.
    pub(super) fn charge(&self) -> Charge {
        Charge::from_f32(self.value())
    }

    fn whole(&self, places: i32) -> i32 {
        whole(self.value(), places)
    }

    #[inline(never)] // as above
    fn bits(&self, exponent: i32) -> i32 {
        self.coefficient(exponent, 0).0
    }

    #[inline(never)] // as above
    fn parts(&self, exponent: i32) -> (i32, u32) {
        self.coefficient(exponent, u32::MAX)
    }

    fn coefficient(&self, exponent: i32, shift_max: u32) -> (i32, u32) {
        let (head, value) = self.next();
        let parts = gain_parts(value, exponent - LEAST).filter(|(_, shift)| *shift <= shift_max);
        self.refuse_head(parts.is_none(), head, OUT_OF_RANGE);
        parts.unwrap_or_default()
    }

    /// Refuses the parameter of each following value that is below zero.
    pub(super) fn refuse(&self, reasons: &[&'static str]) {
        for reason in reasons {
            let (head, value) = self.next();
            self.refuse_head(value < 0.0, head, reason);
        }
    }

    /// Refuses the parameter in `head` if `refused`.
    fn refuse_head(&self, refused: bool, head: u8, reason: &'static str) {
        if let Some(param) = ParamId::ALL.get(usize::from(head)) {
            self.0.refuse_if(refused, *param, reason);
        }
    }

    /// Returns the next value.
    pub(super) fn value(&self) -> f32 {
        self.next().1
    }

    /// Evaluates the remaining formulas, all of which define quantities.
    pub(super) fn define(&self) {
        self.next();
    }

    /// Defines quantities up to the next formula of another kind; returns its head and value.
    fn next(&self) -> (u8, f32) {
        loop {
            let (head, value) = (self.byte(), self.formula());
            if head & DEFINE == 0 {
                return (head, value);
            }
            if let Some(quantity) = self.quantity(head) {
                quantity.set(value);
            }
        }
    }

    fn formula(&self) -> f32 {
        let mut value = 1.0;
        loop {
            let mut byte = self.byte();
            if byte == END {
                return value;
            }
            let operator = byte;
            if let LESS | MAX | MIN = operator {
                byte = self.byte();
            }
            let operand = match self.quantity(byte) {
                Some(quantity) => quantity.get(),
                None => f32::from_le_bytes([0; 4].map(|_: u8| self.byte())),
            };
            value = match operator {
                LESS => value - operand,
                MAX => value.max(operand),
                MIN => value.min(operand),
                _ if byte & OVER != 0 => value / operand,
                _ => value * operand,
            };
        }
    }

    /// Returns the quantity of an operand or a head, or `None` where a number follows.
    fn quantity(&self, byte: u8) -> Option<&Cell<f32>> {
        self.0.quantities.get(usize::from(byte & !OVER))
    }

    /// Returns the next byte; after the last one, [`END`].
    #[inline(never)] // as above
    fn byte(&self) -> u8 {
        let Some((byte, rest)) = self.0.formulas.get().split_first() else {
            return END;
        };
        self.0.formulas.set(rest);
        *byte
    }
}

/// Subtracted from exponents: the chip loads small positive numbers in less code.
const LEAST: i32 = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Drift;
    use crate::params::{BOSSO_BENCH, Board, Params};

    struct Place {
        number: I16F16,
        count: u32,
        charge: Charge,
        gain: Gain<I16F16, I16F16>,
        factor: Multiplier<I16F16, I16F16>,
    }

    use fixed::types::I16F16;

    /// Returns the parameter that a test's formulas refuse on a motor of 18 mΩ.
    fn made(test: impl FnOnce(&Si)) -> Option<ParamId> {
        let (params, quantities) = (Params::of(&BOSSO_BENCH), Si::quantities());
        let p = Si::new(&params, &Board::BENCH, Drift::NONE, &quantities);
        p.prepare(Drift::NONE);
        p.set(Quantity::R, 0.018);
        test(&p);
        p.refused.get().map(|refused| refused.param)
    }

    #[test]
    fn operators_are_worked_out_from_the_left() {
        let refused = made(|p| {
            assert_eq!(value!(p, [3.0] * R), 3.0 * 0.018);
            assert_eq!(value!(p, [3.0] / R * [7.0]), 3.0 / 0.018 * 7.0);
            assert_eq!(value!(p, R - [1.0] * [2.0]), (0.018 - 1.0) * 2.0);
            assert_eq!(value!(p, R + [1.0] / R), (0.018 + 1.0) / 0.018);
            assert_eq!(value!(p, R max [1.0] * [2.0] min [1.5]), 1.5);
            assert_eq!(value!(p, [0.5] min R max [0.001]), 0.018);
        });
        assert_eq!(refused, None);
    }

    #[test]
    fn each_field_takes_its_formula() {
        let mut place = Place {
            number: I16F16::ZERO,
            count: 0,
            charge: Charge::ZERO,
            gain: Gain::ZERO,
            factor: Multiplier::from_bits(0),
        };
        let refused = made(|p| {
            let place = &mut place;
            fill!(p, place, {
                number number([2.5] * [2.0]),
                define KP(R * [1000.0]),
                gain gain(MotRMohm, KP),
                define KP(KP * [2.0]),
                count count(KP + [0.5]),
                factor factor(MotLUh, [0.25]),
                charge charge([-3.5]),
            });
        });
        assert_eq!(refused, None);
        assert_eq!((place.number, place.count), (I16F16::lit("5"), 36));
        assert_eq!(place.charge, Charge::lit("-3.5"));
        assert!((place.gain.apply(I16F16::ONE) - I16F16::lit("18")).abs() < 0.001);
        assert_eq!(place.factor.of(I16F16::ONE), I16F16::lit("0.25"));
    }

    #[test]
    fn the_first_parameter_is_refused_whose_coefficient_does_not_fit() {
        let refused = made(|p| {
            let formulas = formulas!(p, {
                gain fits(MotLUh, [1e3]),
                factor beyond(MotRMohm, [1e3]),
                gain far_beyond(CtlFfA, [1e30]),
            });
            let _: Gain<I16F16, I16F16> = formulas.gain();
            let _: Multiplier<I16F16, I16F16> = formulas.factor();
            let _: Gain<I16F16, I16F16> = formulas.gain();
        });
        assert_eq!(refused, Some(ParamId::MotRMohm));
    }

    #[test]
    fn the_first_parameter_is_refused_whose_formula_is_below_zero() {
        let mut said = None;
        let refused = made(|p| {
            refuse!(p, {
                MotLUh([0.018] - R) "zero is not below zero",
                MotRMohm(R - [0.02]) "less than 20 mΩ",
                CtlFfA([-1.0]) "it is not the first",
            });
            said = p.refused.get();
        });
        assert_eq!(refused, Some(ParamId::MotRMohm));
        assert_eq!(said.map(|said| said.reason), Some("less than 20 mΩ"));
    }
}
