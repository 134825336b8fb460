//! Messages about the ESC.

use mavlink::dialects::ardupilotmega::{
    EscConnectionType, MavModeFlag, MavParamType, MavProtocolCapability, MavState,
};
use siskin_params::{Image, ParamId, Params, TABLE};
use siskin_throttle::signal::{Pulse, Signal};
use siskin_units::math::{quotient, round};

use super::group::Escs;
use super::identity::Identity;
use super::payload::Payload;
use crate::drive::Faults;
use crate::image::{PARTS, VERSION};
use crate::telemetry::Telemetry;

/// `ESC_INFO.temperature` of a slot without an ESC, or whose ESC does not know it.
const NO_TEMPERATURE: i16 = i16::MAX;

pub(super) fn heartbeat(
    payload: &mut Payload,
    identity: &Identity,
    telemetry: &Telemetry,
    armed: bool,
    stopped: bool,
) {
    let (mavtype, autopilot) = identity.kind();
    let base_mode = if armed {
        MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED
    } else {
        MavModeFlag::empty()
    };
    let system_status = if !telemetry.faults.is_empty() {
        MavState::MAV_STATE_CRITICAL
    } else if armed || !stopped {
        MavState::MAV_STATE_ACTIVE
    } else {
        MavState::MAV_STATE_STANDBY
    };
    // The custom mode comes first: the conditions, each a bit at its number. MAVLink's version is 3 throughout MAVLink
    // 2.
    payload.u32(telemetry.faults.custom_mode() | telemetry.limits.custom_mode());
    payload.put(&[
        mavtype as u8,
        autopilot as u8,
        base_mode.bits(),
        system_status as u8,
        3,
    ]);
}

/// Writes ESC_INFO; `counter` is the number of this message.
pub(super) fn esc_info(payload: &mut Payload, now_us: u64, escs: &Escs, counter: u16) {
    payload.u64(now_us);
    let errors = |esc: &Telemetry| esc.fault_count.saturating_add(esc.bad_frames);
    escs.put(payload, 4, 0, errors);
    payload.u16(counter);
    escs.put(payload, 2, 0, |esc| failure_flags(esc.faults).into());
    escs.put(payload, 2, NO_TEMPERATURE as u32, temperature_cdegc);
    payload.put(&[
        escs.place.index(),
        escs.count(),
        connection_type(escs.own.signal) as u8,
        escs.online(),
    ]);
}

/// Returns the temperature as `ESC_INFO` has it: an i16 in the lower half.
fn temperature_cdegc(esc: &Telemetry) -> u32 {
    let cdegc = if esc.temperature_c.is_nan() {
        NO_TEMPERATURE
    } else {
        (round(esc.temperature_c * 100.0) as i16).min(NO_TEMPERATURE - 1)
    };
    cdegc as u32
}

/// Returns the connection type: DShot until known otherwise.
fn connection_type(signal: Option<Signal>) -> EscConnectionType {
    match signal {
        None | Some(Signal::Dshot { .. }) => EscConnectionType::ESC_CONNECTION_TYPE_DSHOT,
        Some(Signal::Pulse(Pulse::Servo)) => EscConnectionType::ESC_CONNECTION_TYPE_PPM,
        Some(Signal::Pulse(_)) => EscConnectionType::ESC_CONNECTION_TYPE_ONESHOT,
    }
}

/// Writes a value with a name of at most 10 characters.
pub(super) fn named_value(payload: &mut Payload, now_us: u64, name: &str, value: f32) {
    // The field wraps after 49 days.
    payload.u32(quotient(now_us, 1000));
    payload.f32(value);
    payload.put(name.as_bytes());
}

pub(super) fn esc_status(payload: &mut Payload, now_us: u64, escs: &Escs) {
    payload.u64(now_us);
    escs.put(payload, 4, 0, |esc| round(esc.rpm) as i32 as u32);
    escs.put(payload, 4, 0, |esc| esc.bus_v.to_bits());
    escs.put(payload, 4, 0, |esc| esc.bus_a.to_bits());
    payload.put(&[escs.place.index()]);
}

/// Writes ESC_TELEMETRY. It has no signs: speed is its magnitude, and a current into the supply is 0. Those for later
/// ESCs have the same layout ([`Place::telemetry`](super::place::Place::telemetry)).
pub(super) fn esc_telemetry(payload: &mut Payload, escs: &Escs, count: u16) {
    escs.put(payload, 2, 0, |esc| whole(esc.bus_v * 100.0));
    escs.put(payload, 2, 0, |esc| whole(esc.bus_a * 100.0));
    escs.put(payload, 2, 0, |esc| whole(esc.consumed_mah));
    escs.put(payload, 2, 0, |esc| whole(esc.rpm.abs()));
    escs.put(payload, 2, 0, |_| count.into());
    escs.put(payload, 1, 0, |esc| {
        u32::from(round(esc.temperature_c) as u8)
    });
}

/// Returns the nearest number of 16 bits.
#[inline(never)] // four call it
fn whole(value: f32) -> u32 {
    u32::from(round(value) as u16)
}

pub(super) fn autopilot_version(payload: &mut Payload, image: &Image) {
    // C_CAST: a float is the value itself, never an integer's bytes.
    let capabilities = MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP;
    payload.u64(capabilities.bits());
    payload.u64(uid(&image.serial));
    // The versions of middleware and operating system are 0, and there are no vendor and product numbers.
    for word in [version(), 0, 0, image.board_number.into(), 0] {
        payload.u32(word);
    }
    payload.put(&image.build);
    // Instead of a middleware's: which parts of the drive the program has.
    payload.put(PARTS);
}

pub(super) fn param_value(payload: &mut Payload, params: &Params, id: ParamId) {
    payload.f32(params.get(id));
    payload.u16(TABLE.len() as u16);
    payload.u16(id as u16);
    payload.put(&name_bytes(id));
    payload.put(&[MavParamType::MAV_PARAM_TYPE_REAL32 as u8]);
}

/// Returns its name, without a final zero if it has 16 characters.
pub(super) fn name_bytes(id: ParamId) -> [u8; 16] {
    let mut bytes = [0; 16];
    for (to, byte) in bytes.iter_mut().zip(id.entry().name.bytes()) {
        *to = byte;
    }
    bytes
}

/// `ESC_FAILURE_FLAGS`.
fn failure_flags(faults: Faults) -> u16 {
    faults
        .iter()
        .fold(0, |flags, fault| flags | fault.failure_flag())
}

/// Returns major, minor, patch and release type of the version, a byte each.
fn version() -> u32 {
    const OFFICIAL: u8 = 255;
    let [major, minor, patch] = VERSION;
    u32::from_be_bytes([major, minor, patch, OFFICIAL])
}

/// Folds the chip's serial number into 64 bits.
fn uid(serial: &[u8; 12]) -> u64 {
    let word = |at: usize| {
        u32::from_le_bytes([serial[at], serial[at + 1], serial[at + 2], serial[at + 3]])
    };
    u64::from(word(0) ^ word(8)) << 32 | u64::from(word(4))
}

#[cfg(test)]
mod tests {
    use mavlink::dialects::ardupilotmega::{
        ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA,
    };
    use mavlink::{MavlinkVersion, MessageData};

    use super::*;
    use crate::drive::Fault;
    use crate::mavlink::place::Place;
    use crate::mavlink::tests::TELEMETRY;

    /// Reads a payload as the dialect's message.
    fn read<D: MessageData>(write: impl FnOnce(&mut Payload)) -> D {
        let mut payload = Payload::new();
        write(&mut payload);
        D::deser(MavlinkVersion::V2, payload.bytes()).expect("it is whole")
    }

    fn alone(telemetry: &Telemetry) -> Escs<'_> {
        Escs::of(Place::FIRST, telemetry, None)
    }

    fn info(telemetry: &Telemetry) -> ESC_INFO_DATA {
        read(|payload| esc_info(payload, 5, &alone(telemetry), 1))
    }

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
        let message: ESC_TELEMETRY_1_TO_4_DATA =
            read(|payload| esc_telemetry(payload, &alone(&telemetry), 7));
        assert_eq!(message.rpm, [65_535, 0, 0, 0]);
        assert_eq!(message.current[0], 0);
        assert_eq!(message.temperature[0], 255);
        assert_eq!(message.voltage[0], 0);
        assert_eq!(message.totalcurrent[0], 65_535);
        let status: ESC_STATUS_DATA = read(|payload| esc_status(payload, 5, &alone(&telemetry)));
        assert_eq!(status.rpm[0], -70_000);
        let info = info(&telemetry);
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
            let info = info(&telemetry);
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
        let info = info(&telemetry);
        assert_eq!(info.error_count[0], u32::MAX);
    }

    #[test]
    fn each_fault_has_a_flag() {
        // The protocol's numbers; faults that it does not name are GENERIC.
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
