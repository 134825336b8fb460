//! How a scenario sends throttle.

use serde::Deserialize;
use siskin_params::choice::Inp3d;
use siskin_params::{ParamId, Params};
use siskin_throttle::dshot::{self, Rate};
use siskin_throttle::endpoints::ZERO_DIVISOR;
use siskin_throttle::signal::{Pulse, Signal};

/// Share of a pulse's range that counts as zero throttle.
const ZERO_SHARE: f64 = 1.0 / ZERO_DIVISOR as f64;

/// The signal on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Wire(Signal);

impl Default for Wire {
    fn default() -> Self {
        Self(Signal::Dshot {
            rate: Rate::Dshot600,
            bidirectional: false,
        })
    }
}

/// Returns the name of a signal in a file.
fn name(signal: Signal) -> String {
    signal.name().to_lowercase().replace(' ', "-")
}

impl TryFrom<String> for Wire {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let signal = Signal::all().find(|signal| name(*signal) == text);
        signal.map(Self).ok_or_else(|| {
            let names: Vec<_> = Signal::all().map(name).collect();
            format!(
                "'{text}' is not a throttle signal; give one of {}",
                names.join(", ")
            )
        })
    }
}

impl Wire {
    /// Returns the interval between frame starts, ns: that of a flight controller's 1 kHz loop, and
    /// 400 Hz for servo pulses, which take up to 2 ms.
    pub fn interval_ns(self) -> u64 {
        match self.0 {
            Signal::Pulse(Pulse::Servo) => 2_500_000,
            _ => 1_000_000,
        }
    }

    /// Returns the datagram of a throttle, 0 to 1. 0 is motor stop or its pulse; above it the
    /// throttle's steps are used from first to last, with `INP_3D` those of both directions.
    pub fn datagram(self, throttle: f64, params: &Params) -> Vec<u8> {
        match self.0 {
            Signal::Dshot { bidirectional, .. } => {
                let [low, high] = bits(throttle, bidirectional).to_le_bytes();
                vec![self.0.number(), low, high]
            }
            Signal::Pulse(kind) => {
                let servo_ns = libm::round(servo_us(throttle, params) * 1e3) as u32;
                // The wire counts pulses from 0, INP_PROTO from 1.
                let mut datagram = vec![self.0.number() - 1];
                datagram.extend(kind.width_ns(servo_ns).to_le_bytes());
                datagram
            }
        }
    }
}

/// Returns the 16 bits of a DShot frame for a throttle, 0 to 1.
pub(crate) fn bits(throttle: f64, bidirectional: bool) -> u16 {
    let value = if throttle > 0.0 {
        48 + libm::round(throttle * 1999.0) as u16
    } else {
        0
    };
    let frame = dshot::Frame {
        value,
        telemetry: false,
    };
    frame.to_bits() ^ dshot::check_mask(bidirectional)
}

/// Returns the servo pulse for a throttle, µs.
fn servo_us(throttle: f64, params: &Params) -> f64 {
    let get = |id| f64::from(params.get(id));
    let (min_us, max_us) = (get(ParamId::InpPulseMinUs), get(ParamId::InpPulseMaxUs));
    let share = match (params.chosen(Inp3d::On), throttle > 0.0) {
        (false, false) => 0.0,
        (false, true) => ZERO_SHARE + (1.0 - ZERO_SHARE) * throttle,
        (true, false) => 0.5,
        (true, true) => throttle,
    };
    min_us + (max_us - min_us) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    fn datagram(wire: &str, throttle: f64) -> Vec<u8> {
        let wire = Wire::try_from(wire.to_owned()).unwrap();
        wire.datagram(throttle, &Params::default())
    }

    #[test]
    fn every_signal_has_a_name_in_files() {
        for (wire, code) in [
            ("servo", 0),
            ("oneshot125", 1),
            ("oneshot42", 2),
            ("multishot", 3),
            ("dshot150", 10),
            ("dshot1200", 13),
            ("bidirectional-dshot150", 20),
            ("bidirectional-dshot600", 22),
        ] {
            assert_eq!(datagram(wire, 0.0)[0], code, "{wire}");
        }
        let problem = Wire::try_from("pwm".to_owned()).unwrap_err();
        assert!(
            problem.starts_with("'pwm' is not a throttle signal; give one of servo, oneshot125,"),
            "{problem}"
        );
    }

    #[test]
    fn frames_go_through_the_whole_throttle() {
        assert_eq!(datagram("dshot600", 0.0), [12, 0, 0]);
        assert_eq!(datagram("bidirectional-dshot600", 0.0), [22, 0x0F, 0]);
        for (throttle, value) in [(1e-6, 48), (0.5, 1048), (1.0, 2047)] {
            let [_, low, high] = datagram("dshot300", throttle)[..] else {
                panic!("three bytes");
            };
            let frame = dshot::Frame::from_bits(u16::from_le_bytes([low, high]));
            assert_eq!(frame.unwrap().value, value);
        }
    }

    #[test]
    fn pulses_go_through_their_range() {
        for (wire, zero_ns, least_ns, full_ns) in [
            ("servo", 1_000_000_u32, 1_020_000_u32, 2_000_000_u32),
            ("oneshot125", 125_000, 127_500, 250_000),
            ("oneshot42", 42_000, 42_840, 84_000),
            ("multishot", 5_000, 5_400, 25_000),
        ] {
            for (throttle, width_ns) in [(0.0, zero_ns), (1e-9, least_ns), (1.0, full_ns)] {
                let datagram = datagram(wire, throttle);
                assert_eq!(datagram[1..], width_ns.to_le_bytes(), "{wire} {throttle}");
            }
        }
    }

    #[test]
    fn with_two_directions_the_middle_is_zero() {
        let mut params = Params::default();
        params.set(ParamId::Inp3d, 1.0).unwrap();
        let wire = Wire::try_from("servo".to_owned()).unwrap();
        for (throttle, width_ns) in [(0.0, 1_500_000_u32), (1e-9, 1_000_000), (1.0, 2_000_000)] {
            let datagram = wire.datagram(throttle, &params);
            assert_eq!(datagram[1..], width_ns.to_le_bytes());
        }
    }
}
