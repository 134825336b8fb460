//! The B-G431B-ESC1 outside its chip: what its resistors make of currents and voltages.
//!
//! Pins are (port, number), where port 0 is A.

/// The supply of the chip and of the sensors, V.
const SUPPLY_V: f64 = 3.3;

/// Each leg's shunt, below its low side, Ω.
const SHUNT_OHM: f64 = 0.003;

/// An op-amp's input, kΩ: to the shunt, to the shunts' ground, and to the chip's supply. The schematic labels
/// the second end "GND"; at the chip's ground it would show 4/7 of a ground shift instead of all but 4 %.
const SHUNT_KOHM: [f64; 3] = [1.5, 2.2, 22.0];

/// The supply's divider, kΩ: above and below the pin.
const BUS_KOHM: [f64; 2] = [169.0, 18.0];

/// The terminals' dividers, kΩ: above and below the pin.
const TERMINAL_KOHM: [f64; 2] = [10.0, 2.2];

/// The thermistor at 25 °C, kΩ.
const THERMISTOR_KOHM: f64 = 10.0;

/// Its β, K.
const THERMISTOR_BETA_K: f64 = 3380.0;

/// Its resistor to ground, kΩ.
const THERMISTOR_DOWN_KOHM: f64 = 4.7;

/// 0 °C, K.
const FREEZING_K: f64 = 273.15;

/// The op-amps' inputs at the shunts of legs a, b and c: PA1, PA7 and PB0.
pub const SHUNTS: [(u8, u8); 3] = [(0, 1), (0, 7), (1, 0)];

/// The op-amps' reference inputs at these shunts' grounds: PA3, PA5 and PB2, without a resistor (MB1419
/// schematic, shunt sensing circuit: Vshunt−).
pub const GROUNDS: [(u8, u8); 3] = [(0, 3), (0, 5), (1, 2)];

/// The dividers of terminals a, b and c: PA4, PC4 and PB11.
pub const TERMINALS: [(u8, u8); 3] = [(0, 4), (2, 4), (1, 11)];

/// The supply's divider: PA0.
pub const BUS: (u8, u8) = (0, 0);

/// The thermistor: PB14.
pub const THERMISTOR: (u8, u8) = (1, 14);

/// Grounds the terminals' dividers while low: PB5.
pub const DIVIDERS_GROUND: (u8, u8) = (1, 5);

/// Pins with the converter (1 or 2) and channel of each (data sheet, pinout).
const CHANNELS: [((u8, u8), (u8, u8)); 8] = [
    (BUS, (1, 1)),
    (BUS, (2, 1)),
    (THERMISTOR, (1, 5)),
    (TERMINALS[0], (2, 17)),
    (TERMINALS[1], (2, 5)),
    (TERMINALS[2], (1, 14)),
    (TERMINALS[2], (2, 14)),
    (SHUNTS[1], (2, 4)),
];

/// Returns the pin at a converter's channel; the op-amps' outputs are not the board's.
pub fn pin(converter: u8, channel: u8) -> Option<(u8, u8)> {
    let mut channels = CHANNELS.iter();
    let found = channels.find(|(_, at)| *at == (converter, channel));
    found.map(|(pin, _)| *pin)
}

/// What the sensors are exposed to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outside {
    /// Currents down through the shunts of legs a, b, c, out of the motor, A: 0 while a leg's low side
    /// carries none.
    pub shunts_a: [f64; 3],
    /// Voltages of these shunts' grounds above the chip's, V: the drop of their currents across the copper
    /// between.
    pub grounds_v: [f64; 3],
    /// Voltages of terminals a, b, c, V.
    pub terminals_v: [f64; 3],
    /// Supply voltage, V.
    pub bus_v: f64,
    /// The thermistor's temperature, °C.
    pub temperature_c: f64,
    /// Whether the chip holds [`DIVIDERS_GROUND`] low.
    pub grounded: bool,
}

impl Outside {
    /// Returns the voltage at a pin; `None` without a sensor, and at the terminals' pins without a ground.
    ///
    /// The diodes that clamp a pin near the supply are left out: the converter clamps too.
    pub fn volts(&self, pin: (u8, u8)) -> Option<f64> {
        let among = |pins: [(u8, u8); 3]| pins.iter().position(|of| *of == pin);
        if let Some(leg) = among(SHUNTS) {
            return Some(shunt_input(self.shunts_a[leg], self.grounds_v[leg]));
        }
        if let Some(leg) = among(GROUNDS) {
            return Some(self.grounds_v[leg]);
        }
        if let Some(leg) = among(TERMINALS) {
            let volts = divided(self.terminals_v[leg], TERMINAL_KOHM);
            return self.grounded.then_some(volts);
        }
        match pin {
            BUS => Some(divided(self.bus_v, BUS_KOHM)),
            THERMISTOR => {
                let thermistor = thermistor_kohm(self.temperature_c);
                Some(divided(SUPPLY_V, [thermistor, THERMISTOR_DOWN_KOHM]))
            }
            _ => None,
        }
    }
}

/// Returns the voltage where the three resistors meet, for this shunt current and this voltage below the
/// shunt.
fn shunt_input(current_a: f64, ground_v: f64) -> f64 {
    let [shunt, ground, supply] = SHUNT_KOHM.map(|kohm| 1.0 / kohm);
    let above_v = ground_v + current_a * SHUNT_OHM;
    let into = above_v * shunt + ground_v * ground + SUPPLY_V * supply;
    into / (shunt + ground + supply)
}

fn divided(volts: f64, [above, below]: [f64; 2]) -> f64 {
    volts * below / (above + below)
}

fn thermistor_kohm(celsius: f64) -> f64 {
    let inverse = 1.0 / (FREEZING_K + celsius) - 1.0 / (FREEZING_K + 25.0);
    THERMISTOR_KOHM * (THERMISTOR_BETA_K * inverse).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTSIDE: Outside = Outside {
        shunts_a: [35.0, -35.0, 0.0],
        grounds_v: [0.0, 0.0, 0.01],
        terminals_v: [12.2, 0.0, 6.1],
        bus_v: 18.7,
        temperature_c: 25.0,
        grounded: true,
    };

    fn assert_volts(pin: (u8, u8), volts: f64) {
        let shown = OUTSIDE.volts(pin).expect("it has a sensor");
        assert!((shown - volts).abs() < 1e-4, "{pin:?}: {shown}");
    }

    #[test]
    fn pins_have_what_the_resistors_make() {
        // 3.3 V times 3/77 is 128.57 mV, and 4/7 of 105 mV at 35 A is 60 mV.
        assert_volts((0, 1), 0.188571);
        assert_volts((0, 7), 0.068571);
        // Plus 37/38.5 of 10 mV below it.
        assert_volts((1, 0), 0.138182);
        assert_volts((1, 2), 0.01);
        assert_volts((0, 3), 0.0);
        assert_volts((0, 4), 2.2);
        assert_volts((2, 4), 0.0);
        assert_volts((1, 11), 1.1);
        assert_volts((0, 0), 1.8);
        // 3.3 V times 4.7/14.7.
        assert_volts((1, 14), 1.0551);
        assert_eq!(OUTSIDE.volts((1, 12)), None);
    }

    #[test]
    fn terminals_without_a_ground_have_no_reading() {
        let outside = Outside {
            grounded: false,
            ..OUTSIDE
        };
        assert!(TERMINALS.iter().all(|pin| outside.volts(*pin).is_none()));
    }

    #[test]
    fn a_warm_thermistor_has_less_resistance() {
        // 3380·(1/373.15 − 1/298.15) = −2.2786: 1.0243 kΩ.
        assert!((thermistor_kohm(100.0) - 1.0243).abs() < 1e-3);
    }

    #[test]
    fn channels_lead_to_the_pins() {
        for ((converter, channel), at) in [
            ((1, 1), BUS),
            ((1, 5), THERMISTOR),
            ((2, 17), TERMINALS[0]),
            ((2, 5), TERMINALS[1]),
            ((1, 14), TERMINALS[2]),
        ] {
            assert_eq!(pin(converter, channel), Some(at));
        }
        assert_eq!(pin(1, 13), None);
    }
}
