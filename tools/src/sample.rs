//! Telemetry of each ESC, as a line for people and as JSON.

use mavlink::dialects::ardupilotmega::{
    ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA, EscFailureFlags,
};
use serde_json::{Value, json};

use crate::json::{fixed, number};

/// ESCs in one `ESC_STATUS`.
const SLOTS: usize = 4;

/// Failure flags in words. The protocol has no flag for under-voltage or a lost rotor: these show as
/// `fault`, and a message names them.
const FAILURES: [(EscFailureFlags, &str); 7] = [
    (EscFailureFlags::ESC_FAILURE_OVER_CURRENT, "over-current"),
    (EscFailureFlags::ESC_FAILURE_OVER_VOLTAGE, "over-voltage"),
    (
        EscFailureFlags::ESC_FAILURE_OVER_TEMPERATURE,
        "over-temperature",
    ),
    (EscFailureFlags::ESC_FAILURE_OVER_RPM, "over-speed"),
    (
        EscFailureFlags::ESC_FAILURE_INCONSISTENT_CMD,
        "inconsistent command",
    ),
    (EscFailureFlags::ESC_FAILURE_MOTOR_STUCK, "motor stuck"),
    (EscFailureFlags::ESC_FAILURE_GENERIC, "fault"),
];

/// The slower messages, which go with an `ESC_STATUS`.
#[derive(Default)]
pub(crate) struct Source {
    pub(crate) info: Option<ESC_INFO_DATA>,
    pub(crate) telemetry: Option<ESC_TELEMETRY_1_TO_4_DATA>,
}

impl Source {
    /// Returns one row per ESC present: by the bits of `ESC_INFO`, which cover the first eight; beyond
    /// those, and until it has come, by having a voltage.
    pub(crate) fn rows(&self, status: &ESC_STATUS_DATA) -> Vec<Row> {
        let first = usize::from(status.index);
        (0..SLOTS)
            .filter(|&slot| match &self.info {
                Some(info) if first + slot < 8 => info.info & 1 << (first + slot) != 0,
                _ => status.voltage[slot] != 0.0,
            })
            .map(|slot| Row {
                esc: first + slot,
                time_s: status.time_usec as f64 / 1e6,
                rpm: status.rpm[slot],
                bus_v: status.voltage[slot],
                bus_a: status.current[slot],
                temperature_c: self
                    .info
                    .as_ref()
                    .map(|info| info.temperature[slot])
                    .filter(|cdegc| *cdegc != i16::MAX)
                    .map(|cdegc| f32::from(cdegc) / 100.0),
                consumed_mah: self.telemetry.as_ref().map(|t| t.totalcurrent[slot]),
                errors: self.info.as_ref().map(|info| info.error_count[slot]),
                failures: self
                    .info
                    .as_ref()
                    .map(|info| failures(info.failure_flags[slot])),
            })
            .collect()
    }
}

fn failures(flags: u16) -> Vec<&'static str> {
    FAILURES
        .iter()
        .filter(|(flag, _)| flags & flag.bits() != 0)
        .map(|(_, words)| *words)
        .collect()
}

/// A sample of one ESC; `None` for what has not been received yet.
pub(crate) struct Row {
    /// Number of the ESC, from 0.
    pub(crate) esc: usize,
    /// The ESC's clock.
    time_s: f64,
    /// Mechanical speed, signed.
    rpm: i32,
    bus_v: f32,
    /// Negative while braking.
    bus_a: f32,
    temperature_c: Option<f32>,
    consumed_mah: Option<u16>,
    errors: Option<u32>,
    failures: Option<Vec<&'static str>>,
}

impl Row {
    /// Formats it in at most 79 characters, if no more than one failure is shown.
    pub(crate) fn line(&self) -> String {
        let mut line = format!(
            "ESC {} {:>8.2} s {:>6} rpm {:>6} V {:>7} A",
            self.esc,
            self.time_s,
            self.rpm,
            fixed(self.bus_v, 2),
            fixed(self.bus_a, 2)
        );
        if let Some(temperature_c) = self.temperature_c {
            line += &format!(" {:>5} \u{b0}C", fixed(temperature_c, 1));
        }
        if let Some(consumed_mah) = self.consumed_mah {
            line += &format!(" {consumed_mah:>5} mAh");
        }
        match self.failures.as_deref() {
            None => {}
            Some([]) => line += " ok",
            Some(failures) => line += &format!(" {}", failures.join(", ")),
        }
        line
    }

    pub(crate) fn json(&self) -> Value {
        json!({
            "esc": self.esc,
            "time_s": self.time_s,
            "rpm": self.rpm,
            "bus_v": number(self.bus_v),
            "bus_a": number(self.bus_a),
            "temperature_c": self.temperature_c.map(number),
            "consumed_mah": self.consumed_mah,
            "errors": self.errors,
            "failures": self.failures,
        })
    }
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::ardupilotmega::EscConnectionType;

    use super::*;

    fn status(index: u8) -> ESC_STATUS_DATA {
        ESC_STATUS_DATA {
            time_usec: 12_340_000,
            rpm: [-4500, 0, 0, 0],
            voltage: [24.1, 0.0, 0.0, 0.0],
            current: [-3.25, 0.0, 0.0, 0.0],
            index,
        }
    }

    fn info(index: u8, bits: u8, flags: u16) -> ESC_INFO_DATA {
        ESC_INFO_DATA {
            time_usec: 12_000_000,
            error_count: [2, 0, 0, 0],
            counter: 1,
            failure_flags: [flags, 0, 0, 0],
            temperature: [3510, i16::MAX, i16::MAX, i16::MAX],
            index,
            count: 8,
            connection_type: EscConnectionType::ESC_CONNECTION_TYPE_DSHOT,
            info: bits,
        }
    }

    #[test]
    fn a_row_tells_what_is_known() {
        let bare = Source::default().rows(&status(0));
        assert_eq!(bare.len(), 1, "only the slot that has a voltage");
        assert_eq!(
            bare[0].line(),
            "ESC 0    12.34 s  -4500 rpm  24.10 V   -3.25 A"
        );
        let full = Source {
            info: Some(info(0, 0b1, 1 | 64)),
            telemetry: Some(ESC_TELEMETRY_1_TO_4_DATA {
                totalcurrent: [120, 0, 0, 0],
                ..ESC_TELEMETRY_1_TO_4_DATA::DEFAULT
            }),
        }
        .rows(&status(0));
        assert_eq!(
            full[0].line(),
            "ESC 0    12.34 s  -4500 rpm  24.10 V   -3.25 A  35.1 \u{b0}C   120 mAh over-current, fault"
        );
        assert_eq!(
            full[0].json(),
            json!({
                "esc": 0, "time_s": 12.34, "rpm": -4500, "bus_v": 24.1, "bus_a": -3.25,
                "temperature_c": 35.1, "consumed_mah": 120, "errors": 2,
                "failures": ["over-current", "fault"],
            })
        );
        assert_eq!(bare[0].json()["failures"], Value::Null);
    }

    #[test]
    fn what_is_left_of_no_current_is_shown_as_none() {
        for bus_a in [-0.0, -1.4e-43, -0.004] {
            let mut status = status(0);
            status.current[0] = bus_a;
            let row = &Source::default().rows(&status)[0];
            assert!(row.line().ends_with("    0.00 A"), "{}", row.line());
        }
    }

    #[test]
    fn a_time_in_json_has_no_more_digits_than_the_clock() {
        let status = ESC_STATUS_DATA {
            time_usec: 3_300_003,
            ..status(0)
        };
        let row = &Source::default().rows(&status)[0];
        assert_eq!(row.json()["time_s"].to_string(), "3.300003");
    }

    #[test]
    fn the_bits_of_info_say_which_escs_are_there() {
        let numbers = |index, bits| {
            Source {
                info: Some(info(index, bits, 0)),
                telemetry: None,
            }
            .rows(&status(index))
            .iter()
            .map(|row| row.esc)
            .collect::<Vec<_>>()
        };
        assert_eq!(numbers(0, 0b1111_0101), [0, 2]);
        assert_eq!(numbers(4, 0b0110_1111), [5, 6]);
        // Info has bits for eight: of those after them, the first slot has a voltage.
        assert_eq!(numbers(8, 0), [8]);
        assert_eq!(numbers(255, 0xFF), [255]);
    }
}
