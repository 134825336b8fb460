//! Conditions: faults that stop the bridge and limits that bound it, in one number space.
//!
//! The listings below are the single source of numbers, names, flags and of the pilot's page in
//! `firmware/README.md`, which a test compares with [`Condition`]'s rows.

use siskin_units::trace::Trace;

/// A condition's entry on the pilot's page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Its number, also its bit in HEARTBEAT's custom mode.
    pub number: u8,
    /// Its name, in texts and files.
    pub text: &'static str,
    /// When it applies.
    pub meaning: &'static str,
    /// What to do about it, or what the ESC does.
    pub remedy: &'static str,
}

macro_rules! conditions {
    (
        $(#[$about:meta])* $name:ident, $(#[$of_set:meta])* $set:ident of $count:literal from $first:literal in $bits:ty,
        $(#[$of_mark:meta])* $mark:ident: $kind:ty;
        $($(#[$doc:meta])* $variant:ident = $number:literal $text:literal $value:expr, $meaning:literal $remedy:literal;)*
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum $name {
            $($(#[$doc])* $variant = $number,)*
        }

        impl $name {
            /// All of them, in numerical order.
            pub const ALL: [Self; $count] = [$(Self::$variant),*];

            /// Returns the one with this number.
            // By comparison: a lookup would put a table into the interrupt's flash.
            pub const fn of_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// Returns a short text for people.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }

            $(#[$of_mark])*
            pub const fn $mark(self) -> $kind {
                match self {
                    $(Self::$variant => $value,)*
                }
            }

            /// Returns its row of the pilot's page.
            pub const fn condition(self) -> Condition {
                let (meaning, remedy) = match self {
                    $(Self::$variant => ($meaning, $remedy),)*
                };
                Condition { number: self as u8, text: self.text(), meaning, remedy }
            }
        }

        $(#[$of_set])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $set($bits);

        impl $set {
            /// The empty set.
            pub const NONE: Self = Self(0);

            /// Adds one.
            pub const fn insert(&mut self, one: $name) {
                self.0 |= 1 << (one as u8 - $first);
            }

            /// Adds one, or removes it if present.
            pub fn toggle(&mut self, one: $name) {
                self.0 ^= 1 << (one as u8 - $first);
            }

            /// Returns true if the set contains it.
            pub const fn contains(self, one: $name) -> bool {
                self.0 & (1 << (one as u8 - $first)) != 0
            }

            /// Returns true if the set is empty.
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// Returns the union of both sets.
            pub const fn with(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }

            /// Returns those not in the other set.
            pub const fn without(self, other: Self) -> Self {
                Self(self.0 & !other.0)
            }

            /// Iterates over the set in numerical order.
            pub fn iter(self) -> impl Iterator<Item = $name> {
                let numbers = $first..$first + $count;
                numbers.filter_map($name::of_number).filter(move |one| self.contains(*one))
            }

            #[doc = concat!("A bit each, from the number ", stringify!($first), " on.")]
            pub const fn bits(self) -> $bits {
                self.0
            }

            /// Returns the bits at the conditions' numbers, as in HEARTBEAT's custom mode.
            pub const fn custom_mode(self) -> u32 {
                (self.0 as u32) << $first
            }
        }
    };
}

/// The bit of extended telemetry's status that a [`Limit`] raises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Raised {
    /// No more torque is available.
    Alert,
    /// Something is broken, and the motor keeps running with it.
    Warning,
}

conditions! {
    /// A reason why the bridge was turned off.
    Fault,
    /// A set of faults.
    Faults of 8 from 0 in u8,
    /// Its flag in `ESC_FAILURE_FLAGS`; GENERIC if it has none of its own.
    failure_flag: u16;

    /// A phase current was above 1.4 times `LIM_PHASE_A` for two samples.
    OverCurrent = 0 "over-current" 1,
        "a phase current above 1.4 · `LIM_PHASE_A` for two samples, the hardware's own trip, or the gate driver's alarm"
        "look for a short; check `MOT_R_MOHM`, `MOT_L_UH` and the bandwidth `CTL_BW_CUR_HZ`";
    /// The supply was above `LIM_BUS_V_MAX`.
    OverVoltage = 1 "bus over-voltage" 2,
        "supply above `LIM_BUS_V_MAX`"
        "braking into a supply that takes no current back: set `LIM_REGEN_A` lower, or `MOT_STOP` 0";
    /// The supply was below `LIM_BUS_V_MIN`.
    UnderVoltage = 2 "bus under-voltage" 64,
        "supply below `LIM_BUS_V_MIN`"
        "an empty pack, thin wires, a current-limited supply; lower `LIM_BUS_A`";
    /// The board was hotter than `LIM_TEMP_C`.
    OverTemperature = 3 "over-temperature" 4,
        "board above `LIM_TEMP_C`"
        "cool it; lower `LIM_PHASE_A`";
    /// The observer's state left its range: the rotor's position is unknown.
    ObserverLost = 4 "rotor position lost" 64,
        "the observer's angle cannot be trusted any more"
        "check the motor's parameters; a loose phase; a blocked propeller";
    /// Every attempt of a start failed, or the motor was too slow for too long.
    Stuck = 5 "motor does not start" 32,
        "every attempt of a start has failed"
        "see below";
    /// A current sensor's zero error is too large.
    CurrentSensor = 6 "current sensor defect" 64,
        "a current sensor's zero is too far off, or it does not read during an identification"
        "its shunt and amplifier: `siskin check`";
    /// Control periods took longer than the PWM's, so that duties came late.
    Overrun = 7 "control too slow" 64,
        "three control periods in a row took longer than the PWM's, or for long more than one in 100 did: duties came late"
        "lower `PWM_FREQ_HZ`";
}

conditions! {
    /// A limit that the drive respects at the cost of the demand, or a defect that it continues with.
    Limit,
    /// A set of limits.
    Limits of 10 from 16 in u16,
    /// The bit of extended telemetry's status that it raises.
    raises: Option<Raised>;

    /// The current vector is at `LIM_PHASE_A`.
    PhaseCurrent = 16 "phase current" Some(Raised::Alert),
        "the current is at `LIM_PHASE_A`"
        "holds the current there: there is no more torque";
    /// The supply delivers `LIM_BUS_A`.
    BusCurrent = 17 "supply current" Some(Raised::Alert),
        "the supply gives `LIM_BUS_A`"
        "lowers the phase current: there is no more torque";
    /// The supply sinks `LIM_REGEN_A`.
    RegenCurrent = 18 "returned current" None,
        "braking returns `LIM_REGEN_A`"
        "brakes more slowly";
    /// The supply is within 1 V of `LIM_BUS_V_MAX`.
    BusVoltage = 19 "supply voltage" None,
        "the supply is within 1 V of `LIM_BUS_V_MAX`"
        "returns less to the supply, and turns more into heat in the motor";
    /// The motor has all the voltage that the supply can give.
    Duty = 20 "duty" None,
        "the motor gets the full supply voltage"
        "speeds up only while the flux can still be weakened (`CTL_WEAKEN`)";
    /// A phase carries no current in one direction or in both.
    PhaseOpen = 21 "phase open" Some(Raised::Warning),
        "a phase carries no current, or in one direction only: a loose wire, or a switch that does not turn on"
        "keeps running, with less torque: land, then `siskin check`";
    /// The phase currents do not sum to zero.
    SensorDrift = 22 "current sensor drifts" Some(Raised::Warning),
        "the phase currents do not sum to zero: a current sensor's zero has moved, or it reads nothing"
        "keeps running, with a pulsating torque: land, then `siskin check`";
    /// A Hall sensor does not switch as the others do.
    PositionSensor = 23 "position sensor defect" Some(Raised::Warning),
        "a Hall sensor does not switch as the others do"
        "keeps running on the others, and without them at speed";
    /// The supply is near `LIM_BUS_V_MIN`.
    SupplySag = 24 "supply sag" Some(Raised::Alert),
        "the supply is less than 8 %, or 0.31 V if that is more, above `LIM_BUS_V_MIN`"
        "draws less: there is no more torque, and none at all just above `LIM_BUS_V_MIN`";
    /// The six-step drive's samples follow no faster motor.
    CommutationRate = 25 "commutation rate" Some(Raised::Alert),
        "in six-step the motor is as fast as the samples can follow, an electrical turn in 21 periods of `PWM_FREQ_HZ`: with 7 pole pairs 9 800 rpm at 24 kHz, 14 300 rpm at 35 kHz"
        "holds the speed there: raise `PWM_FREQ_HZ`, on the B-G431B-ESC1 to 35 kHz at most, or identify the motor, which is then driven field-oriented";
}

impl Fault {
    /// Returns the number of flashes between pauses of the light; a single flash means all is well.
    pub const fn flashes(self) -> u8 {
        self as u8 + 2
    }

    /// Returns true if it can pass by itself, so that a drive that has proven itself may be retried.
    pub const fn is_retried(self) -> bool {
        match self {
            Self::OverCurrent
            | Self::OverVoltage
            | Self::UnderVoltage
            | Self::ObserverLost
            | Self::Overrun => true,
            Self::OverTemperature | Self::Stuck | Self::CurrentSensor => false,
        }
    }
}

impl Limit {
    /// Returns true if it is a warning: nothing is bounded, but the motor runs with a defect.
    pub const fn warns(self) -> bool {
        matches!(self.raises(), Some(Raised::Warning))
    }
}

impl Limits {
    /// Those that raise the alert.
    const ALERTS: Self = Self::that_raise(Raised::Alert);

    /// Those that raise the warning.
    const WARNINGS: Self = Self::that_raise(Raised::Warning);

    const fn that_raise(status: Raised) -> Self {
        let mut those = Self::NONE;
        let mut n = 0;
        while n < Limit::ALL.len() {
            let limit = Limit::ALL[n];
            if matches!(limit.raises(), Some(raised) if raised as u8 == status as u8) {
                those.insert(limit);
            }
            n += 1;
        }
        those
    }

    /// Returns true if one of them raises the alert.
    pub const fn alert(self) -> bool {
        self.0 & Self::ALERTS.0 != 0
    }

    /// Returns true if one of them raises the warning.
    pub const fn warn(self) -> bool {
        self.0 & Self::WARNINGS.0 != 0
    }
}

impl Trace for Fault {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        (*self as u8).trace(out);
    }
}

impl Trace for Faults {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        self.0.trace(out);
    }
}

#[cfg(test)]
mod tests {
    use std::format;
    use std::string::String;
    use std::vec::Vec;

    use super::*;

    /// Returns the rows of the builder's guide table that begins with this line.
    fn rows(head: &str) -> Vec<&'static str> {
        let guide = include_str!("../../../firmware/README.md");
        let (_, table) = guide.split_once(head).expect("the table is there");
        table
            .lines()
            .skip(2)
            .take_while(|line| line.starts_with('|'))
            .collect()
    }

    #[test]
    fn the_pilots_page_is_what_the_listings_say() {
        let faults = Fault::ALL.map(|fault| {
            let (row, flashes) = (fault.condition(), fault.flashes());
            let Condition {
                number,
                text,
                meaning,
                remedy,
            } = row;
            let in_flight = if fault.is_retried() {
                "tried again"
            } else {
                "off"
            };
            format!("| {number} | `{text}` | {flashes} | {in_flight} | {meaning} | {remedy} |")
        });
        assert_eq!(rows("| no. | fault |"), faults);
        let limits = Limit::ALL.map(|limit| {
            let told = match limit.raises() {
                Some(Raised::Alert) => "alert",
                Some(Raised::Warning) => "warning",
                None => "",
            };
            let Condition {
                number,
                text,
                meaning,
                remedy,
            } = limit.condition();
            let row = format!("| {number} | `{text}` | {told} | {meaning} | {remedy} |");
            row.replace("|  |", "| |")
        });
        assert_eq!(rows("| no. | limit |"), limits);
    }

    #[test]
    fn numbers_are_distinct_and_bits_stand_at_them() {
        let mut seen = 0_u32;
        let mut names: Vec<String> = Vec::new();
        let faults = Fault::ALL.map(|fault| {
            let mut set = Faults::NONE;
            set.insert(fault);
            assert_eq!(Fault::of_number(fault as u8), Some(fault));
            (set.custom_mode(), fault.condition())
        });
        let limits = Limit::ALL.map(|limit| {
            let mut set = Limits::NONE;
            set.insert(limit);
            assert_eq!(Limit::of_number(limit as u8), Some(limit));
            (set.custom_mode(), limit.condition())
        });
        for (bit, condition) in faults.into_iter().chain(limits) {
            assert_eq!(bit, 1 << condition.number);
            assert_eq!(seen & bit, 0, "{condition:?}");
            seen |= bit;
            assert!(!names.iter().any(|name| name == condition.text));
            names.push(condition.text.into());
        }
    }
}
