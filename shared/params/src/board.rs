//! The board's properties that the configuration needs, and a program's identity.

use crate::delay::Delay;
use crate::table::ParamId;

/// The board's properties that the control must know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// The program's name and version.
    pub image: Image,
    /// Amperes per count of the current converter.
    pub current_a_per_count: f32,
    /// Volts per count of the supply's converter.
    pub bus_v_per_count: f32,
    /// Greatest phase current that the converter can read, peak amperes.
    pub current_range_a: f32,
    /// Upper bound of `LIM_PHASE_A`: its trip is within what the converter shows and what the board is rated for.
    pub greatest_phase: Greatest,
    /// Upper bound of `LIM_BUS_V_MAX`: what the board is rated for, within what the converter shows.
    pub greatest_supply: Greatest,
    /// Volts per count of the terminals' converter, of 4096 counts.
    pub terminal_v_per_count: f32,
    /// Which phases have a current shunt.
    pub shunts: Shunts,
    /// Control periods from sample to voltage.
    pub delay: Delay,
    /// Least on-time of a low side for its current to be read, s, half of it before the sample.
    /// Excludes dead times.
    pub low_side_on_s: f32,
    /// Least on-time of a low side in each period that keeps its high side's driver supplied, s.
    pub refresh_s: f32,
    /// Total on-time of the low sides that charges the high sides' drivers after a time off, s.
    pub charge_s: f32,
    /// Lower bound of `PWM_DEADTIME_NS`, and its default where the table's is shorter.
    pub least_dead_time: LeastDeadTime,
    /// Choices whose longest period bounds `PWM_FREQ_HZ`, the lowest bound first; all else fits up to the end of the
    /// parameter's range.
    pub pwm_bounds: &'static [PwmBound],
}

/// Which phases have a shunt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shunts {
    /// All three phases; the one with the highest duty may go unread.
    #[default]
    Three,
    /// Phases a and b: both must be read every period, which bounds every duty.
    Two,
}

impl Shunts {
    /// Returns the number of phases with a shunt, counted from a.
    pub const fn count(self) -> usize {
        match self {
            Self::Three => 3,
            Self::Two => 2,
        }
    }
}

/// A program built for a board, and the chip it runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image {
    /// Board name as in the build; its first 24 characters are reported.
    pub board: &'static str,
    /// Board number, `board_version` of AUTOPILOT_VERSION; 0 is the emulator.
    pub board_number: u16,
    /// First eight bytes of the commit hash; zeros if unknown.
    pub build: [u8; 8],
    /// Serial number of the microcontroller; zeros if there is none.
    pub serial: [u8; 12],
}

impl Image {
    /// The emulator, and tests on a PC.
    pub const EMULATOR: Self = Self {
        board: "emulator",
        board_number: 0,
        build: [0; 8],
        serial: [0; 12],
    };
}

/// The highest PWM frequency at which a choice's longest period fits the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PwmBound {
    /// The parameter, and its choice. One of another than `CTL_DRIVE` counts in the field-oriented drive.
    pub choice: (ParamId, f32),
    /// In Hz.
    pub hz: f32,
    /// Why a higher one is refused, with its number.
    pub refusal: &'static str,
}

/// The highest limit that a board can keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Greatest {
    /// In the limit's unit.
    pub value: f32,
    /// Why a higher one is refused, with its number.
    pub refusal: &'static str,
}

impl Greatest {
    /// The table's range is no wider.
    pub const ANY: Self = Self {
        value: f32::INFINITY,
        refusal: "",
    };
}

/// The shortest dead time that a board's drivers and transistors tolerate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastDeadTime {
    /// In ns.
    pub ns: f32,
    /// Why a shorter one is refused, with its number.
    pub refusal: &'static str,
}

impl LeastDeadTime {
    /// Any dead time will do, even none.
    pub const NONE: Self = Self {
        ns: 0.0,
        refusal: "",
    };
}

/// Software trip over `LIM_PHASE_A`.
pub const TRIP_SHARE: f32 = 1.4;

/// Greatest trip over the converter's range; the rest is for offsets and the uneven ends of the range.
const SHOWN_SHARE: f32 = 0.97;

impl Board {
    /// Returns the upper bound of `LIM_PHASE_A` for sensors of this range, without its number.
    pub const fn greatest_phase(range_a: f32) -> Greatest {
        Greatest {
            value: SHOWN_SHARE / TRIP_SHARE * range_a,
            refusal: "its trip is beyond the current sensors' range",
        }
    }

    /// The sensors of the emulator's bench: 12 bits over ±40 A and 70 V.
    pub const BENCH: Self = Self {
        image: Image::EMULATOR,
        current_a_per_count: 40.0 / 2048.0,
        bus_v_per_count: 70.0 / 4096.0,
        current_range_a: 40.0,
        greatest_phase: Self::greatest_phase(40.0),
        greatest_supply: Greatest::ANY,
        terminal_v_per_count: 70.0 / 4096.0,
        shunts: Shunts::Three,
        delay: Delay::One,
        low_side_on_s: 1e-6,
        refresh_s: 1e-6,
        charge_s: 63e-6,
        least_dead_time: LeastDeadTime::NONE,
        pwm_bounds: &[],
    };
}
