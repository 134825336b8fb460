//! Where MAVLink goes: the argument of `--mavlink`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use thiserror::Error;

use siskin_scope::{AddressError, HostPort};

/// Baud rate of a `pty` endpoint that names none: the initial rate of telemetry radios and boards.
pub const DEFAULT_BAUD: u32 = 115_200;

/// The slowest and fastest accepted rate: from the oldest radios to USB bridges.
const BAUD: std::ops::RangeInclusive<u32> = 300..=12_000_000;

/// One place to which MAVLink goes and from which it comes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// Datagrams to this address, and back to whoever answers.
    UdpOut(HostPort),
    /// Datagrams to whoever has sent to this address.
    UdpIn(HostPort),
    /// A server for any number of clients.
    TcpIn(HostPort),
    /// A serial port of this machine, 8N1.
    Serial {
        /// The device.
        path: PathBuf,
        /// Bits per second.
        baud: u32,
    },
    /// A pseudo-terminal, which another program opens like a serial port.
    Pty {
        /// A symbolic link to create to it.
        link: Option<PathBuf>,
        /// Rate at which bytes pass, bits per second.
        baud: u32,
    },
    /// No MAVLink at all.
    None,
}

/// Why a text is not an endpoint.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "'{text}' is not a MAVLink endpoint: {reason}; use udpout:HOST:PORT, udpin:HOST:PORT, \
     tcpin:HOST:PORT, serial:PATH:BAUD, pty[:LINK[:BAUD]] or none"
)]
pub struct EndpointError {
    /// What was given.
    pub text: String,
    /// What is wrong with it.
    pub reason: EndpointReason,
}

/// What is wrong with an endpoint's text.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EndpointReason {
    /// The word before the first colon is none of the kinds.
    #[error("the kind '{0}' is unknown")]
    Kind(String),
    /// The address is wrong.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Datagrams cannot be sent to port 0.
    #[error("datagrams cannot be sent to port 0")]
    PortZero,
    /// The device or the rate is missing.
    #[error("it needs a device and a rate, such as serial:/dev/ttyUSB0:115200")]
    Serial,
    /// The rate is not a number or out of range.
    #[error("the rate '{0}' is not a number from 300 to 12000000")]
    Baud(String),
    /// Something follows a word that must be alone.
    #[error("nothing follows 'none'")]
    None,
}

impl Endpoint {
    /// Returns the default endpoints: a ground station's usual port and a server for scripts, both
    /// on this machine only.
    pub fn defaults() -> Vec<Self> {
        let local = |port| HostPort {
            host: "127.0.0.1".to_owned(),
            port,
        };
        vec![Self::UdpOut(local(14550)), Self::TcpIn(local(5760))]
    }

    /// Returns what `siskin --connect` takes to reach it; `None` for a port whose other end is
    /// elsewhere.
    pub fn opposite(&self) -> Option<String> {
        // What listens on every interface is reachable on this machine too.
        let here = |address: &HostPort| match address.host.as_str() {
            "0.0.0.0" | "::" => format!("127.0.0.1:{}", address.port),
            _ => address.to_string(),
        };
        match self {
            Self::TcpIn(address) => Some(format!("tcp:{}", here(address))),
            Self::UdpOut(address) => Some(format!("udpin:{address}")),
            Self::UdpIn(address) => Some(format!("udpout:{}", here(address))),
            Self::Pty {
                link: Some(link),
                baud,
            } => Some(format!("serial:{}:{baud}", link.display())),
            Self::Pty { link: None, .. } | Self::Serial { .. } | Self::None => None,
        }
    }
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        parse(text).map_err(|reason| EndpointError {
            text: text.to_owned(),
            reason,
        })
    }
}

fn parse(text: &str) -> Result<Endpoint, EndpointReason> {
    let (kind, rest) = match text.split_once(':') {
        Some((kind, rest)) => (kind, Some(rest)),
        None => (text, None),
    };
    let address = || Ok::<HostPort, EndpointReason>(rest.unwrap_or_default().parse()?);
    match kind {
        "udpout" => match address()? {
            HostPort { port: 0, .. } => Err(EndpointReason::PortZero),
            address => Ok(Endpoint::UdpOut(address)),
        },
        "udpin" => Ok(Endpoint::UdpIn(address()?)),
        "tcpin" => Ok(Endpoint::TcpIn(address()?)),
        "serial" => match rest.unwrap_or_default().rsplit_once(':') {
            Some((path, rate)) if !path.is_empty() => Ok(Endpoint::Serial {
                path: path.into(),
                baud: baud(rate)?,
            }),
            _ => Err(EndpointReason::Serial),
        },
        "pty" => {
            let (link, baud) = match rest.map(|r| r.rsplit_once(':').unwrap_or((r, ""))) {
                None => ("", DEFAULT_BAUD),
                Some((link, "")) => (link, DEFAULT_BAUD),
                Some((link, rate)) => (link, baud(rate)?),
            };
            Ok(Endpoint::Pty {
                link: (!link.is_empty()).then(|| link.into()),
                baud,
            })
        }
        "none" if rest.is_none() => Ok(Endpoint::None),
        "none" => Err(EndpointReason::None),
        _ => Err(EndpointReason::Kind(kind.to_owned())),
    }
}

fn baud(text: &str) -> Result<u32, EndpointReason> {
    match text.parse() {
        Ok(baud) if BAUD.contains(&baud) => Ok(baud),
        _ => Err(EndpointReason::Baud(text.to_owned())),
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UdpOut(address) => write!(f, "udpout:{address}"),
            Self::UdpIn(address) => write!(f, "udpin:{address}"),
            Self::TcpIn(address) => write!(f, "tcpin:{address}"),
            Self::Serial { path, baud } => write!(f, "serial:{}:{baud}", path.display()),
            Self::Pty { link: None, baud } => write!(f, "pty::{baud}"),
            Self::Pty {
                link: Some(link),
                baud,
            } => write!(f, "pty:{}:{baud}", link.display()),
            Self::None => f.write_str("none"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pty(link: &str, baud: u32) -> Endpoint {
        let link = (!link.is_empty()).then(|| link.into());
        Endpoint::Pty { link, baud }
    }

    #[test]
    fn reads_every_kind() {
        let read = |text: &str| text.parse::<Endpoint>().unwrap();
        assert_eq!(
            vec![read("udpout:127.0.0.1:14550"), read("tcpin:127.0.0.1:5760")],
            Endpoint::defaults()
        );
        let any = HostPort {
            host: "::".into(),
            port: 0,
        };
        assert_eq!(read("udpin:[::]:0"), Endpoint::UdpIn(any));
        let port = Endpoint::Serial {
            path: "/dev/serial/by-id/usb-1:0".into(),
            baud: 57600,
        };
        assert_eq!(read("serial:/dev/serial/by-id/usb-1:0:57600"), port);
        assert_eq!(read("pty"), pty("", 115_200));
        assert_eq!(read("pty:/tmp/esc"), pty("/tmp/esc", 115_200));
        assert_eq!(read("pty:/tmp/esc:9600"), pty("/tmp/esc", 9600));
        assert_eq!(read("pty::9600"), pty("", 9600));
        assert_eq!(read("none"), Endpoint::None);
    }

    #[test]
    fn the_other_end_is_told() {
        for (text, other) in [
            ("tcpin:0.0.0.0:5761", Some("tcp:127.0.0.1:5761")),
            ("tcpin:[::1]:5761", Some("tcp:[::1]:5761")),
            ("udpout:127.0.0.1:14551", Some("udpin:127.0.0.1:14551")),
            ("udpin:127.0.0.1:14551", Some("udpout:127.0.0.1:14551")),
            ("pty:/tmp/esc:57600", Some("serial:/tmp/esc:57600")),
            ("serial:/dev/ttyUSB0:57600", None),
            ("none", None),
        ] {
            let endpoint: Endpoint = text.parse().unwrap();
            assert_eq!(endpoint.opposite().as_deref(), other, "{text}");
        }
    }

    #[test]
    fn an_error_is_one_line_with_the_input_and_the_remedy() {
        for text in [
            "",
            "udp:127.0.0.1:14550",
            "udpout",
            "udpout:127.0.0.1",
            "udpout:127.0.0.1:0",
            "udpin:::1:14550",
            "tcpin:127.0.0.1:x",
            "serial:/dev/ttyUSB0",
            "serial::9600",
            "serial:/dev/ttyUSB0:fast",
            "pty:/tmp/esc:0",
            "none:1",
        ] {
            let error = text.parse::<Endpoint>().unwrap_err().to_string();
            assert!(error.contains(&format!("'{text}'")), "{error}");
            assert!(error.contains("use udpout:HOST:PORT"), "{error}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    proptest! {
        #[test]
        fn what_is_read_is_written(
            text in "(udpout|udpin|tcpin|serial|pty|none|)(:[a-z0-9.:/\\[\\]]{0,20}){0,3}"
        ) {
            if let Ok(endpoint) = text.parse::<Endpoint>() {
                prop_assert_eq!(endpoint.to_string().parse(), Ok(endpoint));
            }
        }
    }
}
