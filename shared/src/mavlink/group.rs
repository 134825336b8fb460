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

    /// A value for each slot: of the ESC there, or another where there is none.
    ///
    /// Inlined: where nobody else is told of, two stores are left of it.
    #[inline(always)]
    pub(super) fn each(&self, none: u32, field: impl Fn(&Telemetry) -> u32) -> [u32; SLOTS] {
        let mut values = [none; SLOTS];
        values[self.place.slot()] = field(self.own);
        if cfg!(feature = "group") {
            self.others()
                .for_each(|(slot, esc)| values[slot] = field(esc));
        }
        values
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
    /// An array with the lowest `len` bytes of the value in each slot.
    ///
    /// Never inlined: each message calls it for each array.
    #[inline(never)]
    pub(super) fn slots(&mut self, len: usize, values: [u32; SLOTS]) {
        for value in values {
            self.put(value.to_le_bytes().get(..len).unwrap_or_default());
        }
    }
}
