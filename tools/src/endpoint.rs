//! The argument of `--connect`.

use std::fmt;
use std::str::FromStr;

/// Where an ESC is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Endpoint {
    /// A TCP server, `HOST:PORT`.
    Tcp(String),
    /// A local UDP port to which vehicles report, `HOST:PORT`.
    UdpIn(String),
    /// A remote UDP port, `HOST:PORT`.
    UdpOut(String),
    /// A serial port, 8 data bits, no parity, one stop bit.
    Serial {
        /// Device file.
        path: String,
        /// Bits per second.
        baud: u32,
    },
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::UdpIn(address) => write!(f, "udpin:{address}"),
            Self::UdpOut(address) => write!(f, "udpout:{address}"),
            Self::Serial { path, baud } => write!(f, "serial:{path}:{baud}"),
        }
    }
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        match kind {
            "tcp" => host_and_port(kind, rest).map(Self::Tcp),
            "udpin" => host_and_port(kind, rest).map(Self::UdpIn),
            "udpout" => host_and_port(kind, rest).map(Self::UdpOut),
            "serial" => {
                const FORM: &str = "write serial:PATH:BAUD, for example serial:/dev/ttyACM0:115200";
                let (path, baud) = rest
                    .rsplit_once(':')
                    .filter(|(path, _)| !path.is_empty())
                    .ok_or_else(|| format!("a path or a baud rate is missing; {FORM}"))?;
                match baud.parse() {
                    Ok(baud) if baud > 0 => Ok(Self::Serial {
                        path: path.into(),
                        baud,
                    }),
                    _ => Err(format!("'{baud}' is not a baud rate; {FORM}")),
                }
            }
            _ => Err(
                "write tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or serial:PATH:BAUD".into(),
            ),
        }
    }
}

fn host_and_port(kind: &str, text: &str) -> Result<String, String> {
    let form = || format!("write {kind}:HOST:PORT, for example {kind}:127.0.0.1:5760");
    let (host, port) = text
        .rsplit_once(':')
        .filter(|(host, _)| !host.is_empty())
        .ok_or_else(|| format!("a host or a port is missing; {}", form()))?;
    match port.parse::<u16>() {
        Ok(1..) => Ok(format!("{host}:{port}")),
        _ => Err(format!("'{port}' is not a port; {}", form())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_are_read_and_written_alike() {
        for text in [
            "tcp:127.0.0.1:5760",
            "tcp:[::1]:5760",
            "tcp:localhost:1",
            "udpin:0.0.0.0:14550",
            "udpout:192.168.1.7:65535",
            "serial:/dev/ttyACM0:115200",
            "serial:/dev/serial/by-id/usb:0:57600",
        ] {
            let endpoint: Endpoint = text.parse().expect(text);
            assert_eq!(endpoint.to_string(), text);
        }
    }

    #[test]
    fn a_bad_endpoint_says_what_to_write() {
        for (text, remedy) in [
            ("", "tcp:HOST:PORT"),
            ("usb:1", "serial:PATH:BAUD"),
            ("tcp", "tcp:HOST:PORT"),
            ("tcp:127.0.0.1", "tcp:HOST:PORT"),
            ("tcp::5760", "tcp:HOST:PORT"),
            ("udpin:h:0", "'0' is not a port"),
            ("udpout:h:65536", "'65536' is not a port"),
            ("serial:/dev/ttyACM0", "baud"),
            ("serial:/dev/ttyACM0:", "baud"),
            ("serial:/dev/ttyACM0:fast", "'fast' is not a baud rate"),
            ("serial::9600", "path"),
        ] {
            let message = text.parse::<Endpoint>().expect_err(text);
            assert!(message.contains(remedy), "{text}: {message}");
        }
    }
}
