//! ESCs of one program, where the first of each four reports for all of them.

use super::payload::Payload;
use super::place::{Place, SLOTS};
use crate::telemetry::Telemetry;

/// The ESCs of a message for four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Four {
    /// By slot.
    pub escs: [Option<Telemetry>; SLOTS],
    /// ESCs in the vehicle.
    pub count: u8,
}

/// The ESCs that a message reports.
pub(super) struct Escs<'a> {
    pub(super) place: Place,
    pub(super) own: &'a Telemetry,
    four: Option<&'a Four>,
}

impl<'a> Escs<'a> {
    /// The ESC at this place, and the others that it reports.
    pub(super) fn of(place: Place, own: &'a Telemetry, four: Option<&'a Four>) -> Self {
        Self { place, own, four }
    }

    /// Returns those in the other slots.
    fn others(&self) -> impl Iterator<Item = (usize, &Telemetry)> {
        let slots = self
            .four
            .iter()
            .flat_map(|four| four.escs.iter().enumerate());
        let slots = slots.filter_map(|(slot, esc)| Some((slot, esc.as_ref()?)));
        slots.filter(|(slot, _)| *slot != self.place.slot())
    }

    /// Writes a value for each slot, `len` bytes each: that of the ESC there, or `none`.
    ///
    /// Inlined: if no others are reported, it reduces to one call.
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

    /// Returns the number of ESCs in the vehicle. A single ESC does not know it and gives the least there can be;
    /// readers ignore what is above it.
    pub(super) fn count(&self) -> u8 {
        self.four.map_or(self.place.count(), |four| four.count)
    }

    /// Returns `ESC_INFO.info`: the ESCs' bits. The field has none for the ninth ESC and those after it.
    pub(super) fn online(&self) -> u8 {
        let own = self.place.online();
        self.others().fold(own, |bits, (slot, _)| {
            bits | self.place.beside(slot).online()
        })
    }
}

impl Payload {
    /// Writes an array with a value in one slot, and another in the rest.
    ///
    /// Never inlined: each message calls it for each array.
    #[inline(never)]
    fn slot(&mut self, len: usize, (own, value): (usize, u32), none: u32) {
        for slot in 0..SLOTS {
            self.value(len, if slot == own { value } else { none });
        }
    }

    /// Writes the lowest `len` bytes.
    fn value(&mut self, len: usize, value: u32) {
        self.put(value.to_le_bytes().get(..len).unwrap_or_default());
    }
}
