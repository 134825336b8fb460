//! VESC 4.10 class: two low-side shunts through the gate driver's amplifiers.
//!
//! Its boards are alike but for their shunts, which no measurement can tell: with half the resistance every
//! current is twice what is read. So the builder says which, by the number printed on them. The VESC firmware
//! has the same three (`hwconf/other/vesc4/hw_410.h`, `hw_410_0005ohm.h`, `hw_410_005ohm.h`). Boards before the
//! 4.10 have other pins: the shunts of 4.0 to 4.8 are at PA5 and PA6, the thermistor of 4.9 at PA4. The supply
//! divider of 33 kΩ is theirs alone.

use siskin_control::protection::Ntc;
use siskin_params::{Board, Delay, Greatest, LeastDeadTime, Shunts};

use crate::image;

/// Volts per count: 12 bits over the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Gain of the gate driver's amplifiers.
pub const GAIN: f32 = 10.0;

/// Nominal zero-current reading, counts: the amplifiers' reference is half the supply.
pub const ZERO_COUNTS: i32 = 2048;

/// Gain from the supply, and from a terminal, to the converter.
pub const DIVIDER: f32 = 2.2 / (2.2 + 39.0);

/// What differs between the boards of this class.
struct Variant {
    /// Board name, in the image and for MAVLink: the firmware's feature.
    name: &'static str,
    number: u16,
    /// Low-side shunt of each measured phase, Ω.
    shunt_ohm: f32,
    /// Greatest current that is measured or that the board carries, peak A.
    range_a: f32,
    greatest_phase: Greatest,
}

/// Boards with 0.5 mΩ. They carry no more than the others: the VESC firmware's limits are those of the class.
pub const R0005: Board = board(Variant {
    name: "vesc4-f405-r0005",
    number: 3,
    shunt_ohm: 0.0005,
    range_a: 120.0,
    greatest_phase: AS_THE_CLASS,
});

/// Boards with 1 mΩ. The converter's range is ±165 A about mid-scale.
pub const R001: Board = board(Variant {
    name: "vesc4-f405-r001",
    number: 2,
    shunt_ohm: 0.001,
    range_a: 120.0,
    greatest_phase: AS_THE_CLASS,
});

/// Boards with 5 mΩ. The converter's range is ±33 A, of which the same share is used.
pub const R005: Board = board(Variant {
    name: "vesc4-f405-r005",
    number: 4,
    shunt_ohm: 0.005,
    range_a: 24.0,
    greatest_phase: Greatest {
        value: 16.6,
        refusal: "above this board's 16.6 A",
    },
});

/// What the class's feature alone builds. It has the smallest shunts, so that no current is greater than it
/// shows; `siskin` neither makes nor flashes it.
const UNTOLD: Board = board(Variant {
    name: "vesc4-f405",
    number: 5,
    shunt_ohm: 0.0005,
    range_a: 120.0,
    greatest_phase: AS_THE_CLASS,
});

const AS_THE_CLASS: Greatest = Greatest {
    value: 83.1,
    refusal: "above this board's 83.1 A",
};

/// The board that the features choose.
pub const BOARD: Board = if cfg!(feature = "vesc4-f405-r0005") {
    R0005
} else if cfg!(feature = "vesc4-f405-r001") {
    R001
} else if cfg!(feature = "vesc4-f405-r005") {
    R005
} else {
    UNTOLD
};

/// Its name.
pub const NAME: &str = BOARD.image.board;

/// Returns the board as the control needs to know it. Its times are estimates until measured.
const fn board(variant: Variant) -> Board {
    Board {
        image: image::identity(variant.name, variant.number),
        current_a_per_count: V_PER_COUNT / (variant.shunt_ohm * GAIN),
        bus_v_per_count: V_PER_COUNT / DIVIDER,
        terminal_v_per_count: V_PER_COUNT / DIVIDER,
        shunts: Shunts::Two,
        current_range_a: variant.range_a,
        greatest_phase: variant.greatest_phase,
        // As in the VESC firmware for this class; the converter ends at 61.8 V, and the DRV8302 is for 60 V.
        greatest_supply: Greatest {
            value: 57.0,
            refusal: "above this board's 57 V",
        },
        // Duties computed in one period apply from the next counter top on.
        delay: Delay::One,
        // Half of the sampling window, 0.36 µs, and 1.5 µs of amplifier settling before the top.
        low_side_on_s: 3.7e-6,
        // The DRV8302's bootstrap capacitors charge through its diodes, without resistors.
        refresh_s: 1.0e-6,
        charge_s: 50e-6,
        // As in the VESC firmware for this class; the DRV8302 adds some, set by strap DTC.
        least_dead_time: LeastDeadTime {
            ns: 360.0,
            refusal: "below this board's 360 ns",
        },
        pwm_bounds: &[],
    }
}

/// The transistors' thermistor.
pub const NTC: Ntc = Ntc::VESC;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_board_is_named_and_measured_by_what_its_shunts_say() {
        let guide = include_str!("../../README.md");
        for (board, printed, milliohms) in [
            (R0005, "R0005", 0.5_f32),
            (R001, "R001", 1.0),
            (R005, "R005", 5.0),
        ] {
            let name = board.image.board;
            assert_eq!(name, format!("vesc4-f405-{}", printed.to_lowercase()));
            // 3.3 V over the gain and 4096 counts.
            let wanted_a = 0.33 / 4096.0 / (milliohms * 1e-3);
            let off = board.current_a_per_count / wanted_a - 1.0;
            assert!(off.abs() < 1e-6, "{name}: {off}");
            // Within the converter's half scale.
            assert!(board.current_range_a < 2048.0 * wanted_a);
            let row = format!(
                "| `{printed}` | {milliohms} mΩ | `{name}` | {} A |",
                board.greatest_phase.value
            );
            assert!(guide.contains(&row), "{row}");
        }
    }

    #[test]
    fn without_a_name_no_current_is_greater_than_it_shows() {
        for board in [R0005, R001, R005] {
            assert!(board.current_a_per_count <= UNTOLD.current_a_per_count);
        }
        // No feature is chosen on the host.
        assert_eq!(NAME, UNTOLD.image.board);
    }
}
