//! ESCs of one program, of which the first of each four tells of all four.

use super::payload::Payload;
use super::place::{Place, SLOTS};
use crate::telemetry::Telemetry;

/// The ESCs of a message for four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Four {
    /// By their slots.
    pub escs: [Option<Telemetry>; SLOTS],
    /// ESCs in the vehicle.
    pub count: u8,
}

/// The ESCs that a message tells of.
pub(super) struct Escs<'a> {
    pub(super) place: Place,
    pub(super) own: &'a Telemetry,
    four: Option<&'a Four>,
}

impl<'a> Escs<'a> {
    /// The ESC at this place, and those that it tells of besides.
    pub(super) fn of(place: Place, own: &'a Telemetry, four: Option<&'a Four>) -> Self {
        Self { place, own, four }
    }

    /// Those in the slots beside its own.
    fn others(&self) -> impl Iterator<Item = (usize, &Telemetry)> {
        let slots = self
            .four
            .iter()
            .flat_map(|four| four.escs.iter().enumerate());
        let slots = slots.filter_map(|(slot, esc)| Some((slot, esc.as_ref()?)));
        slots.filter(|(slot, _)| *slot != self.place.slot())
    }

    /// Puts a value for each slot, of which `len` bytes count: of the ESC there, or another where there is none.
    ///
    /// Inlined: where nobody else is told of, one call is left of it.
    #[inline(always)]
    pub(super) fn put(
        &self,
        payload: &mut Payload,
        len: usize,
        none: u32,
        field: impl Fn(&Telemetry) -> u32,
    ) {
        let own = (self.place.slot(), field(self.own));
        if cfg!(feature = "group") {
            let mut values = [none; SLOTS];
            values[own.0] = own.1;
            self.others()
                .for_each(|(slot, esc)| values[slot] = field(esc));
            for value in values {
                payload.value(len, value);
            }
        } else {
            payload.slot(len, own, none);
        }
    }

    /// ESCs in the vehicle: of one that is alone the least number that there are. It is not known here; readers
    /// ignore what is above it.
    pub(super) fn count(&self) -> u8 {
        self.four.map_or(self.place.count(), |four| four.count)
    }

    /// `ESC_INFO.info`: their bits. The field has none for a ninth ESC and those after it.
    pub(super) fn online(&self) -> u8 {
        let own = self.place.online();
        self.others().fold(own, |bits, (slot, _)| {
            bits | self.place.beside(slot).online()
        })
    }
}

impl Payload {
    /// An array with a value in one slot, and another in the rest.
    ///
    /// Never inlined: each message calls it for each array.
    #[inline(never)]
    fn slot(&mut self, len: usize, (own, value): (usize, u32), none: u32) {
        for slot in 0..SLOTS {
            self.value(len, if slot == own { value } else { none });
        }
    }

    /// The lowest `len` bytes.
    fn value(&mut self, len: usize, value: u32) {
        self.put(value.to_le_bytes().get(..len).unwrap_or_default());
    }
}
