//! The Hall sensors' code from the levels of their ports.

/// A sensor's pin, by its port and its number there.
#[derive(Clone, Copy)]
pub(crate) enum Pin {
    B(u8),
    #[cfg_attr(
        not(any(feature = "stm32f405", test)),
        expect(dead_code, reason = "for the boards with sensors there")
    )]
    C(u8),
}

/// The pins of sensors a, b and c.
#[derive(Clone, Copy)]
pub(crate) struct Pins(pub(crate) [Pin; 3]);

impl Pins {
    /// Returns true if one of them is on port C.
    pub(crate) fn are_on_c(self) -> bool {
        let [a, b, c] = self.0;
        matches!(a, Pin::C(_)) || matches!(b, Pin::C(_)) || matches!(c, Pin::C(_))
    }

    /// Returns the sensors' code, a in bit 0, from the levels of ports B and C.
    #[inline(always)] // in each period
    pub(crate) fn code(self, port_b: u32, port_c: u32) -> u8 {
        let level = |pin: Pin| match pin {
            Pin::B(pin) => port_b >> pin & 1,
            Pin::C(pin) => port_c >> pin & 1,
        };
        // Unrolled, so that neighbours are one shift.
        let [a, b, c] = self.0;
        (level(a) | level(b) << 1 | level(c) << 2) as u8
    }

    /// Returns these levels of ports B and C with the sensors' pins as in a code.
    pub(crate) fn show(self, code: u8, [mut port_b, mut port_c]: [u32; 2]) -> [u32; 2] {
        for (sensor, pin) in self.0.into_iter().enumerate() {
            let (port, pin) = match pin {
                Pin::B(pin) => (&mut port_b, pin),
                Pin::C(pin) => (&mut port_c, pin),
            };
            *port = *port & !(1 << pin) | u32::from(code >> sensor & 1) << pin;
        }
        [port_b, port_c]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_has_the_sensors_in_the_order_of_the_phases() {
        // As on the first board, and on the VESC.
        for (pins, are_on_c) in [
            (Pins([Pin::B(6), Pin::B(7), Pin::B(8)]), false),
            (Pins([Pin::B(6), Pin::C(11), Pin::B(7)]), true),
        ] {
            assert_eq!(pins.are_on_c(), are_on_c);
            for (sensor, pin) in pins.0.into_iter().enumerate() {
                let (port_b, port_c) = match pin {
                    Pin::B(pin) => (1 << pin, 0),
                    Pin::C(pin) => (0, 1 << pin),
                };
                assert_eq!(pins.code(port_b, port_c), 1 << sensor);
                assert_eq!(pins.code(!port_b, !port_c), 7 & !(1 << sensor));
            }
            for code in 0..8 {
                for others in [0, !0] {
                    let [port_b, port_c] = pins.show(code, [others; 2]);
                    assert_eq!(pins.code(port_b, port_c), code);
                    // nFAULT's.
                    assert_eq!(port_c >> 12 & 1, others & 1);
                }
            }
        }
    }
}
