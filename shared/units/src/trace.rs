//! Traces a state word by word, for two machines to compare.
//!
//! `traced!` declares a state together with its trace, so that no field is forgotten.

use fixed::{FixedI32, FixedI64, FixedU32};

/// A state that can emit all of its words.
pub trait Trace {
    /// Emits the words, always as many and in the same order: position identifies a word.
    fn trace(&self, out: &mut impl FnMut(u32));
}

/// Declares a struct with at most one type parameter, or a fieldless enum, that emits its fields' words in
/// declaration order.
#[macro_export]
macro_rules! traced {
    (
        $(#[$attribute:meta])*
        $visible:vis struct $name:ident $(<$parameter:ident>)? {
            $($(#[$field_attribute:meta])* $field_visible:vis $field:ident: $type:ty),* $(,)?
        }
    ) => {
        $(#[$attribute])*
        $visible struct $name $(<$parameter>)? {
            $($(#[$field_attribute])* $field_visible $field: $type),*
        }

        impl $(<$parameter: $crate::trace::Trace>)? $crate::trace::Trace for $name $(<$parameter>)? {
            // A call would keep the place of the words out of registers.
            #[inline(always)]
            fn trace(&self, out: &mut impl FnMut(u32)) {
                $($crate::trace::Trace::trace(&self.$field, out);)*
            }
        }
    };
    (
        $(#[$attribute:meta])*
        $visible:vis struct $name:ident($field_visible:vis $type:ty);
    ) => {
        $(#[$attribute])*
        $visible struct $name($field_visible $type);

        impl $crate::trace::Trace for $name {
            fn trace(&self, out: &mut impl FnMut(u32)) {
                $crate::trace::Trace::trace(&self.0, out);
            }
        }
    };
    (
        $(#[$attribute:meta])*
        $visible:vis enum $name:ident {
            $($(#[$variant_attribute:meta])* $variant:ident),* $(,)?
        }
    ) => {
        $(#[$attribute])*
        $visible enum $name {
            $($(#[$variant_attribute])* $variant),*
        }

        impl $crate::trace::Trace for $name {
            fn trace(&self, out: &mut impl FnMut(u32)) {
                out(*self as u32);
            }
        }
    };
}

/// Implements [`Trace`] for unsigned numbers of at most 32 bits.
macro_rules! one_word {
    ($($type:ty),*) => {$(
        impl Trace for $type {
            fn trace(&self, out: &mut impl FnMut(u32)) {
                out(u32::from(*self));
            }
        }
    )*};
}

one_word!(bool, u8, u16, u32);

impl Trace for i32 {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        out(*self as u32);
    }
}

impl Trace for i64 {
    /// Emits the lower word first.
    fn trace(&self, out: &mut impl FnMut(u32)) {
        out(*self as u32);
        out((*self >> 32) as u32);
    }
}

impl<F> Trace for FixedI32<F> {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.to_bits().trace(out);
    }
}

impl<F> Trace for FixedU32<F> {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.to_bits().trace(out);
    }
}

impl<F> Trace for FixedI64<F> {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.to_bits().trace(out);
    }
}

impl<T: Trace, const N: usize> Trace for [T; N] {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        for item in self {
            item.trace(out);
        }
    }
}

impl<T: Trace, U: Trace> Trace for (T, U) {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.0.trace(out);
        self.1.trace(out);
    }
}

impl<T: Trace + Copy + Default> Trace for Option<T> {
    /// Emits one word for presence, then the value's words, or the default's.
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.is_some().trace(out);
        self.unwrap_or_default().trace(out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::types::{I4F28, I36F28, U20F12};
    use std::vec::Vec;

    traced! {
        #[derive(Clone, Copy, Default)]
        struct Pair<T> {
            first: T,
            second: T,
        }
    }

    traced! {
        #[derive(Clone, Copy)]
        enum Kind {
            Left,
            Right,
        }
    }

    traced! {
        struct Mixed {
            pair: Pair<I4F28>,
            kinds: [Kind; 2],
            wide: I36F28,
            maybe: Option<Pair<u16>>,
            timed: (U20F12, bool),
        }
    }

    fn words(state: &impl Trace) -> Vec<u32> {
        let mut words = Vec::new();
        state.trace(&mut |word| words.push(word));
        words
    }

    #[test]
    fn each_field_is_told_in_its_order_and_none_moves_another() {
        let mut state = Mixed {
            pair: Pair {
                first: I4F28::from_bits(-2),
                second: I4F28::from_bits(7),
            },
            kinds: [Kind::Right, Kind::Left],
            wide: I36F28::from_bits(-1 << 32 | 5),
            maybe: Some(Pair {
                first: 8,
                second: 9,
            }),
            timed: (U20F12::from_bits(u32::MAX), true),
        };
        let minus_two = u32::MAX - 1;
        let after = [u32::MAX, 1];
        let before = [minus_two, 7, 1, 0, 5, u32::MAX];
        let with = |maybe: [u32; 3]| [&before[..], &maybe, &after].concat();
        assert_eq!(words(&state), with([1, 8, 9]));
        state.maybe = None;
        assert_eq!(words(&state), with([0, 0, 0]));
    }
}
