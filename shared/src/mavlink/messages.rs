//! Messages about the ESC.

use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA,
    EscConnectionType, EscFailureFlags, HEARTBEAT_DATA, MavModeFlag, MavParamType,
    MavProtocolCapability, MavState, NAMED_VALUE_FLOAT_DATA, PARAM_VALUE_DATA,
};
use mavlink::types::CharArray;

use super::identity::Identity;
use super::place::{Place, SLOTS};
use crate::drive::{Fault, Faults};
use crate::image::{Image, VERSION};
use crate::input::signal::{Pulse, Signal};
use crate::math::{quotient, round};
use crate::params::{ParamId, Params, TABLE};
use crate::telemetry::Telemetry;

/// `ESC_INFO.temperature` of a slot without an ESC, or of one that does not know it.
const NO_TEMPERATURE: i16 = i16::MAX;

pub(super) fn heartbeat(
    identity: &Identity,
    telemetry: &Telemetry,
    armed: bool,
    stopped: bool,
) -> HEARTBEAT_DATA {
    let (mavtype, autopilot) = identity.kind();
    HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype,
        autopilot,
        base_mode: if armed {
            MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED
        } else {
            MavModeFlag::empty()
        },
        system_status: if !telemetry.faults.is_empty() {
            MavState::MAV_STATE_CRITICAL
        } else if armed || !stopped {
            MavState::MAV_STATE_ACTIVE
        } else {
            MavState::MAV_STATE_STANDBY
        },
        mavlink_version: 3,
    }
}

/// `counter` is the number of this message.
pub(super) fn esc_info(
    now_us: u64,
    telemetry: &Telemetry,
    place: Place,
    counter: u16,
) -> ESC_INFO_DATA {
    let errors = telemetry.fault_count.saturating_add(telemetry.bad_frames);
    let temperature_cdegc = if telemetry.temperature_c.is_nan() {
        NO_TEMPERATURE
    } else {
        (round(telemetry.temperature_c * 100.0) as i16).min(NO_TEMPERATURE - 1)
    };
    ESC_INFO_DATA {
        time_usec: now_us,
        error_count: place.slots(errors, 0),
        counter,
        failure_flags: place.slots(failure_flags(telemetry.faults), 0),
        temperature: place.slots(temperature_cdegc, NO_TEMPERATURE),
        index: place.index(),
        count: place.count(),
        connection_type: connection_type(telemetry.signal),
        info: place.online(),
    }
}

/// DShot, as long as nothing else is known.
fn connection_type(signal: Option<Signal>) -> EscConnectionType {
    match signal {
        None | Some(Signal::Dshot { .. }) => EscConnectionType::ESC_CONNECTION_TYPE_DSHOT,
        Some(Signal::Pulse(Pulse::Servo)) => EscConnectionType::ESC_CONNECTION_TYPE_PPM,
        Some(Signal::Pulse(_)) => EscConnectionType::ESC_CONNECTION_TYPE_ONESHOT,
    }
}

/// A value by a name of at most 10 characters.
pub(super) fn named_value(now_us: u64, name: &str, value: f32) -> NAMED_VALUE_FLOAT_DATA {
    NAMED_VALUE_FLOAT_DATA {
        // The field wraps after 49 days.
        time_boot_ms: quotient(now_us, 1000),
        value,
        name: CharArray::new(padded(name)),
    }
}

pub(super) fn esc_status(now_us: u64, telemetry: &Telemetry, place: Place) -> ESC_STATUS_DATA {
    ESC_STATUS_DATA {
        time_usec: now_us,
        rpm: place.slots(round(telemetry.rpm) as i32, 0),
        voltage: place.slots(telemetry.bus_v, 0.0),
        current: place.slots(telemetry.bus_a, 0.0),
        index: place.index(),
    }
}

/// The message has no signs: speed is its magnitude, and a current into the supply is 0. Those for
/// later ESCs are laid out alike ([`Place::telemetry`]).
pub(super) fn esc_telemetry(
    telemetry: &Telemetry,
    place: Place,
    count: u16,
) -> ESC_TELEMETRY_1_TO_4_DATA {
    // Never inlined: four fields are made by it.
    #[inline(never)]
    fn whole(place: Place, value: f32) -> [u16; SLOTS] {
        place.slots(round(value) as u16, 0)
    }
    ESC_TELEMETRY_1_TO_4_DATA {
        voltage: whole(place, telemetry.bus_v * 100.0),
        current: whole(place, telemetry.bus_a * 100.0),
        totalcurrent: whole(place, telemetry.consumed_mah),
        rpm: whole(place, telemetry.rpm.abs()),
        count: place.slots(count, 0),
        temperature: place.slots(round(telemetry.temperature_c) as u8, 0),
    }
}

pub(super) fn autopilot_version(image: &Image) -> AUTOPILOT_VERSION_DATA {
    AUTOPILOT_VERSION_DATA {
        // C_CAST: a float is the value itself, never an integer's bytes.
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP,
        uid: uid(&image.serial),
        flight_sw_version: version(),
        middleware_sw_version: 0,
        os_sw_version: 0,
        board_version: image.board_number.into(),
        vendor_id: 0,
        product_id: 0,
        flight_custom_version: image.build,
        middleware_custom_version: [0; 8],
        os_custom_version: [0; 8],
    }
}

pub(super) fn param_value(params: &Params, id: ParamId) -> PARAM_VALUE_DATA {
    PARAM_VALUE_DATA {
        param_value: params.get(id),
        param_count: TABLE.len() as u16,
        param_index: id as u16,
        param_id: CharArray::new(name_bytes(id)),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    }
}

/// Its name, without a zero behind it where it has 16 characters.
pub(super) fn name_bytes(id: ParamId) -> [u8; 16] {
    padded(id.entry().name)
}

fn padded<const N: usize>(name: &str) -> [u8; N] {
    let mut bytes = [0; N];
    for (to, byte) in bytes.iter_mut().zip(name.bytes()) {
        *to = byte;
    }
    bytes
}

/// `ESC_FAILURE_FLAGS`; faults without a flag of their own are GENERIC.
fn failure_flags(faults: Faults) -> u16 {
    faults
        .iter()
        .map(|fault| match fault {
            Fault::OverCurrent => EscFailureFlags::ESC_FAILURE_OVER_CURRENT,
            Fault::OverVoltage => EscFailureFlags::ESC_FAILURE_OVER_VOLTAGE,
            Fault::OverTemperature => EscFailureFlags::ESC_FAILURE_OVER_TEMPERATURE,
            Fault::Stuck => EscFailureFlags::ESC_FAILURE_MOTOR_STUCK,
            _ => EscFailureFlags::ESC_FAILURE_GENERIC,
        })
        .fold(0, |flags, flag| flags | flag.bits())
}

/// Major, minor, patch and release type of the version, a byte each.
fn version() -> u32 {
    const OFFICIAL: u8 = 255;
    let [major, minor, patch] = VERSION;
    u32::from_be_bytes([major, minor, patch, OFFICIAL])
}

/// The chip's serial number, folded to the bits that there are.
fn uid(serial: &[u8; 12]) -> u64 {
    let word = |at: usize| {
        u32::from_le_bytes([serial[at], serial[at + 1], serial[at + 2], serial[at + 3]])
    };
    u64::from(word(0) ^ word(8)) << 32 | u64::from(word(4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::tests::TELEMETRY;

    #[test]
    fn values_are_held_at_the_ends_of_their_fields() {
        let telemetry = Telemetry {
            rpm: -70_000.0,
            bus_a: -3.0,
            temperature_c: 400.0,
            bus_v: f32::NAN,
            consumed_mah: 1e9,
            ..TELEMETRY
        };
        let message = esc_telemetry(&telemetry, Place::FIRST, 7);
        assert_eq!(message.rpm, [65_535, 0, 0, 0]);
        assert_eq!(message.current[0], 0);
        assert_eq!(message.temperature[0], 255);
        assert_eq!(message.voltage[0], 0);
        assert_eq!(message.totalcurrent[0], 65_535);
        assert_eq!(esc_status(5, &telemetry, Place::FIRST).rpm[0], -70_000);
        let info = esc_info(5, &telemetry, Place::FIRST, 1);
        assert_eq!(info.temperature[0], i16::MAX - 1);
    }

    #[test]
    fn a_temperature_that_is_not_known_is_told_as_such() {
        for (temperature_c, told) in [
            (f32::NAN, i16::MAX),
            (f32::INFINITY, i16::MAX - 1),
            (-40.0, -4000),
            (f32::NEG_INFINITY, i16::MIN),
        ] {
            let telemetry = Telemetry {
                temperature_c,
                ..TELEMETRY
            };
            let info = esc_info(5, &telemetry, Place::FIRST, 1);
            assert_eq!(info.temperature[0], told, "{temperature_c}");
        }
    }

    #[test]
    fn errors_stop_at_the_greatest_count() {
        let telemetry = Telemetry {
            fault_count: 3,
            bad_frames: u32::MAX - 1,
            ..TELEMETRY
        };
        let info = esc_info(5, &telemetry, Place::FIRST, 1);
        assert_eq!(info.error_count[0], u32::MAX);
    }

    #[test]
    fn each_fault_has_a_flag() {
        // The numbers of the protocol; faults that it does not name are GENERIC.
        let flags = [1, 2, 64, 4, 64, 32, 64];
        let mut all = Faults::NONE;
        for (fault, flag) in Fault::ALL.into_iter().zip(flags) {
            let mut faults = Faults::NONE;
            faults.insert(fault);
            assert_eq!(failure_flags(faults), flag, "{fault:?}");
            all.insert(fault);
        }
        assert_eq!(failure_flags(all), 1 | 2 | 4 | 32 | 64);
        assert_eq!(failure_flags(Faults::NONE), 0);
    }
}
