//! A client's requests: the datagrams of `LOCKSTEP.md`, parsed.

use thiserror::Error;

use crate::rack::{Environment, OutOfRange, Shaft};
use crate::wire;

/// The version of the datagrams.
pub(super) const VERSION: u8 = 1;

const ADVANCE: u8 = 41;
const ENVIRONMENT: u8 = 42;
const ASK: u8 = 43;

/// The longest advance, ns: MAVLink is checked once in each.
const TIME_MAX_NS: u32 = 1_000_000_000;

/// Most frames in an advance: their answers fit a datagram.
const FRAMES_MAX: usize = 1024;

/// A client's request.
#[derive(Debug, PartialEq)]
pub(super) enum Request<'a> {
    /// Asks for the state.
    Ask,
    /// Acts, in its turn only.
    Turn(u32, Turn<'a>),
}

/// A request that acts.
#[derive(Debug, PartialEq)]
pub(super) enum Turn<'a> {
    /// Advances time by this many ns, with these frames.
    Advance(u32, Vec<Timed<'a>>),
    /// Changes the ESCs' surroundings.
    Change(Environment),
}

/// A frame for one ESC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Timed<'a> {
    pub(super) esc: usize,
    /// Relative to the start of the advance, ns.
    pub(super) offset_ns: u32,
    /// A throttle-wire datagram.
    pub(super) datagram: &'a [u8],
}

/// Why a request is not obeyed.
#[derive(Debug, PartialEq, Error)]
pub(super) enum Malformed {
    #[error("it ends before its fields do")]
    Short,
    #[error("{0} bytes are left over")]
    Long(usize),
    #[error("version {0} is not {VERSION}")]
    Version(u8),
    #[error("a reserved byte is not 0")]
    Reserved,
    #[error("{0} ns are more than {TIME_MAX_NS}")]
    Time(u32),
    #[error("{0} frames are more than {FRAMES_MAX}")]
    Frames(usize),
    #[error("ESC {0} is not there")]
    Esc(u8),
    #[error("a frame for ESC {0} begins after the advance ends, or before the one ahead of it")]
    Offset(u8),
    #[error("a frame for ESC {0}: {1}")]
    Frame(u8, wire::Rejected),
    #[error("it is for {0} ESCs, not for all or none")]
    Count(u8),
    #[error("{0}")]
    Range(#[from] OutOfRange),
}

/// Returns true if a datagram on the throttle wire is a request.
pub(super) fn is_request(datagram: &[u8]) -> bool {
    matches!(datagram.first(), Some(&(ADVANCE | ENVIRONMENT | ASK)))
}

/// Parses a request to this many ESCs.
pub(super) fn parse(datagram: &[u8], escs: usize) -> Result<Request<'_>, Malformed> {
    let mut fields = Fields(datagram);
    let [kind, version] = fields.take()?;
    if version != VERSION {
        return Err(Malformed::Version(version));
    }
    let request = match kind {
        ADVANCE => advance(&mut fields, escs)?,
        ENVIRONMENT => environment(&mut fields, escs)?,
        _ => Request::Ask,
    };
    match fields.0.len() {
        0 => Ok(request),
        left => Err(Malformed::Long(left)),
    }
}

fn advance<'a>(fields: &mut Fields<'a>, escs: usize) -> Result<Request<'a>, Malformed> {
    let count = usize::from(u16::from_le_bytes(fields.take()?));
    let sequence = u32::from_le_bytes(fields.take()?);
    let time_ns = u32::from_le_bytes(fields.take()?);
    if time_ns > TIME_MAX_NS {
        return Err(Malformed::Time(time_ns));
    }
    if count > FRAMES_MAX {
        return Err(Malformed::Frames(count));
    }
    let mut earliest_ns = vec![0; escs];
    let mut frames = Vec::with_capacity(count);
    for _ in 0..count {
        let [esc, reserved] = fields.take()?;
        let length = usize::from(u16::from_le_bytes(fields.take()?));
        let offset_ns = u32::from_le_bytes(fields.take()?);
        let datagram = fields.bytes(length)?;
        let Some(earliest_ns) = earliest_ns.get_mut(usize::from(esc)) else {
            return Err(Malformed::Esc(esc));
        };
        if reserved != 0 {
            return Err(Malformed::Reserved);
        }
        if offset_ns >= time_ns || offset_ns < *earliest_ns {
            return Err(Malformed::Offset(esc));
        }
        *earliest_ns = offset_ns;
        wire::check(datagram).map_err(|rejected| Malformed::Frame(esc, rejected))?;
        frames.push(Timed {
            esc: esc.into(),
            offset_ns,
            datagram,
        });
    }
    Ok(Request::Turn(sequence, Turn::Advance(time_ns, frames)))
}

fn environment<'a>(fields: &mut Fields<'a>, escs: usize) -> Result<Request<'a>, Malformed> {
    let [count, reserved] = fields.take()?;
    if reserved != 0 {
        return Err(Malformed::Reserved);
    }
    if usize::from(count) != escs && count != 0 {
        return Err(Malformed::Count(count));
    }
    let sequence = u32::from_le_bytes(fields.take()?);
    let supply_v = fields.value()?;
    let supply_ohm = fields.value()?;
    let ambient_c = fields.value()?;
    let mut shafts = Vec::with_capacity(escs);
    for _ in 0..count {
        shafts.push(Shaft {
            torque_nm: fields.value()?,
            wind_rpm: fields.value()?,
        });
    }
    let change = Environment {
        supply_v,
        supply_ohm,
        ambient_c,
        shafts,
    };
    change.check()?;
    Ok(Request::Turn(sequence, Turn::Change(change)))
}

/// The remaining fields of a datagram.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let (field, rest) = self.0.split_first_chunk().ok_or(Malformed::Short)?;
        self.0 = rest;
        Ok(*field)
    }

    fn bytes(&mut self, length: usize) -> Result<&'a [u8], Malformed> {
        let (bytes, rest) = self.0.split_at_checked(length).ok_or(Malformed::Short)?;
        self.0 = rest;
        Ok(bytes)
    }

    /// Reads a value; NaN means unchanged.
    fn value(&mut self) -> Result<Option<f64>, Malformed> {
        let value = f64::from_le_bytes(self.take()?);
        Ok((!value.is_nan()).then_some(value))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// An advance of 1 ms with a frame of DShot600 to ESC 1 at 500 µs.
    const ADVANCED: [u8; 23] = [
        41, 1, 1, 0, 7, 0, 0, 0, 0x40, 0x42, 0x0f, 0, 1, 0, 3, 0, 0x20, 0xa1, 0x07, 0, 12, 0, 0,
    ];

    #[test]
    fn an_advance_has_its_frames() {
        let frame = Timed {
            esc: 1,
            offset_ns: 500_000,
            datagram: &[12, 0, 0],
        };
        let wanted = Request::Turn(7, Turn::Advance(1_000_000, vec![frame]));
        assert_eq!(parse(&ADVANCED, 2), Ok(wanted));
    }

    #[test]
    fn what_is_malformed_is_said() {
        for (at, byte, wanted) in [
            (1, 2, Malformed::Version(2)),
            (2, 2, Malformed::Short),
            (3, 5, Malformed::Frames(1281)),
            (11, 255, Malformed::Time(0xff0f_4240)),
            (12, 2, Malformed::Esc(2)),
            (13, 1, Malformed::Reserved),
            (
                14,
                2,
                Malformed::Frame(
                    1,
                    wire::Rejected::Length {
                        protocol: 12,
                        length: 2,
                    },
                ),
            ),
            (19, 9, Malformed::Offset(1)),
            (20, 99, Malformed::Frame(1, wire::Rejected::Protocol(99))),
        ] {
            let mut bytes = ADVANCED;
            bytes[at] = byte;
            let cut = if at == 14 { 22 } else { 23 };
            assert_eq!(parse(&bytes[..cut], 2), Err(wanted), "byte {at}");
        }
        let long = [&ADVANCED[..], &[0]].concat();
        assert_eq!(parse(&long, 2), Err(Malformed::Long(1)));
    }

    #[test]
    fn nan_leaves_a_value_as_it_is() {
        let mut bytes = vec![42, 1, 1, 0, 9, 0, 0, 0];
        for value in [12.5, f64::NAN, 40.0, f64::NAN, 60.0] {
            bytes.extend(value.to_le_bytes());
        }
        let wanted = Environment {
            supply_v: Some(12.5),
            supply_ohm: None,
            ambient_c: Some(40.0),
            shafts: vec![Shaft {
                torque_nm: None,
                wind_rpm: Some(60.0),
            }],
        };
        assert_eq!(parse(&bytes, 1), Ok(Request::Turn(9, Turn::Change(wanted))));
        assert_eq!(parse(&bytes, 2), Err(Malformed::Count(1)));
        bytes[8..16].copy_from_slice(&f64::INFINITY.to_le_bytes());
        assert!(matches!(parse(&bytes, 1), Err(Malformed::Range(_))));
    }

    proptest! {
        #[test]
        fn no_datagram_is_too_much(bytes in prop::collection::vec(any::<u8>(), 0..64), kind in 41..44_u8) {
            let _ = parse(&bytes, 4);
            let _ = parse(&[&[kind, VERSION], bytes.as_slice()].concat(), 4);
        }
    }
}
