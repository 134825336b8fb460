//! Faults: each has one number, in telemetry, in logs and in the documentation.

use crate::trace::Trace;

/// A reason for which the bridge was turned off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// A phase current was above 1.4 times `LIM_PHASE_A` for two samples.
    OverCurrent = 0,
    /// The supply was above `LIM_BUS_V_MAX`.
    OverVoltage = 1,
    /// The supply was below `LIM_BUS_V_MIN`.
    UnderVoltage = 2,
    /// The board was hotter than `LIM_TEMP_C`.
    OverTemperature = 3,
    /// The observer's state left its range: the rotor's position is not known.
    ObserverLost = 4,
    /// All attempts of a start have failed, or the motor was too slow for too long.
    Stuck = 5,
    /// A current sensor's zero is too far off.
    CurrentSensor = 6,
}

impl Fault {
    /// All faults in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::OverCurrent,
        Self::OverVoltage,
        Self::UnderVoltage,
        Self::OverTemperature,
        Self::ObserverLost,
        Self::Stuck,
        Self::CurrentSensor,
    ];

    /// A few words for a person.
    pub const fn text(self) -> &'static str {
        match self {
            Self::OverCurrent => "over-current",
            Self::OverVoltage => "bus over-voltage",
            Self::UnderVoltage => "bus under-voltage",
            Self::OverTemperature => "over-temperature",
            Self::ObserverLost => "rotor position lost",
            Self::Stuck => "motor does not start",
            Self::CurrentSensor => "current sensor defect",
        }
    }
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults(u8);

impl Trace for Faults {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.0.trace(out);
    }
}

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// Adds one.
    pub fn insert(&mut self, fault: Fault) {
        self.0 |= 1 << fault as u8;
    }

    /// Returns true if the fault is in the set.
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u8) != 0
    }

    /// Returns true if there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Those that are in the set, in the order of their numbers.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |f| self.contains(*f))
    }

    /// One bit a fault, at its number.
    pub const fn bits(self) -> u8 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    #[test]
    fn the_builders_guide_has_every_fault() {
        let guide = include_str!("../../../firmware/README.md");
        for fault in Fault::ALL {
            let row = format!("\n| `{}` |", fault.text());
            assert!(guide.contains(&row), "{row}");
        }
    }
}
