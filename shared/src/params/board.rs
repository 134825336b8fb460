//! The properties of the board that the configuration needs.

use crate::control::delay::Delay;
use crate::control::sensing::Shunts;
use crate::image::Image;

/// The properties of the board that the control must know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// The program's name and version.
    pub image: Image,
    /// Amperes of one count of the current converter.
    pub current_a_per_count: f32,
    /// Volts of one count of the supply's converter.
    pub bus_v_per_count: f32,
    /// Greatest phase current that the converter can show, peak amperes.
    pub current_range_a: f32,
    /// Volts of one count of the terminals' converter, of 4096.
    pub terminal_v_per_count: f32,
    /// The phases that have a current shunt.
    pub shunts: Shunts,
    /// Control periods from the sample to the voltage.
    pub delay: Delay,
    /// Least time for which a low side must be on, half of it before the sample, for its current to
    /// be read, s. Dead times are not part of it.
    pub low_side_on_s: f32,
    /// Least time for which a low side must be on in each period so that its high side's driver
    /// stays supplied, s.
    pub refresh_s: f32,
    /// Time for which the low sides must be on in all before the high sides' drivers are supplied
    /// after a time off, s.
    pub charge_s: f32,
    /// `PWM_DEADTIME_NS` at least, which is also its default if the table's is shorter.
    pub least_dead_time: LeastDeadTime,
}

/// The shortest dead time that the drivers and transistors of a board take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastDeadTime {
    /// In ns.
    pub ns: f32,
    /// The reason why a shorter one is refused, with its number.
    pub refusal: &'static str,
}

impl LeastDeadTime {
    /// Any will do, and none.
    pub const NONE: Self = Self {
        ns: 0.0,
        refusal: "",
    };
}

impl Board {
    /// The sensors of the emulator's bench: 12 bits over ±40 A and 70 V.
    pub(crate) const BENCH: Self = Self {
        image: Image::EMULATOR,
        current_a_per_count: 40.0 / 2048.0,
        bus_v_per_count: 70.0 / 4096.0,
        current_range_a: 40.0,
        terminal_v_per_count: 70.0 / 4096.0,
        shunts: Shunts::Three,
        delay: Delay::One,
        low_side_on_s: 1e-6,
        refresh_s: 1e-6,
        charge_s: 63e-6,
        least_dead_time: LeastDeadTime::NONE,
    };
}
