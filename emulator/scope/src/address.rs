//! A host and a port as a person types them.

use std::fmt;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;

use thiserror::Error;

/// A host (a name, an IPv4 address or an IPv6 address in brackets) and a port, not yet resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HostPort {
    /// A name or an address; an IPv6 address without its brackets.
    pub host: String,
    /// 0 lets the system choose where the program listens.
    pub port: u16,
}

/// Why a text is not a host and a port.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AddressError {
    /// There is no colon between host and port.
    #[error("the port is missing (write HOST:PORT)")]
    NoPort,
    /// The host is empty.
    #[error("the host is missing (127.0.0.1 is this machine, 0.0.0.0 every interface)")]
    NoHost,
    /// The port is not a number of 16 bits.
    #[error("the port '{0}' is not a number from 0 to 65535")]
    Port(String),
    /// A host with colons that stands without brackets, or brackets with something else.
    #[error("an IPv6 address stands in brackets, such as [::1]:14550")]
    Brackets,
}

impl HostPort {
    /// The address to use. Of several it is the first IPv4 one: `localhost` stands for both
    /// families on most machines, and ground stations listen on IPv4.
    ///
    /// # Errors
    /// The name has none, or cannot be looked up.
    pub fn resolve(&self) -> io::Result<SocketAddr> {
        let addresses: Vec<_> = (self.host.as_str(), self.port).to_socket_addrs()?.collect();
        let v4 = addresses.iter().find(|a| a.is_ipv4());
        v4.or(addresses.first())
            .copied()
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host name has no address"))
    }
}

impl From<SocketAddr> for HostPort {
    fn from(address: SocketAddr) -> Self {
        Self {
            host: address.ip().to_string(),
            port: address.port(),
        }
    }
}

impl FromStr for HostPort {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (host, port) = text.rsplit_once(':').ok_or(AddressError::NoPort)?;
        let host = match host.strip_prefix('[').and_then(|h| h.strip_suffix(']')) {
            Some(v6) if v6.contains(':') => v6,
            None if !host.contains([':', '[', ']']) => host,
            _ => return Err(AddressError::Brackets),
        };
        if host.is_empty() {
            return Err(AddressError::NoHost);
        }
        // `u16::from_str` takes a leading plus sign, which no address has.
        let number = port
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| port.parse());
        match number {
            Some(Ok(port)) => Ok(Self {
                host: host.to_owned(),
                port,
            }),
            _ => Err(AddressError::Port(port.to_owned())),
        }
    }
}

impl fmt::Display for HostPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, port } = self;
        if host.contains(':') {
            write!(f, "[{host}]:{port}")
        } else {
            write!(f, "{host}:{port}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reads_names_and_both_families() {
        for (text, host, port) in [
            ("127.0.0.1:14550", "127.0.0.1", 14550),
            ("localhost:0", "localhost", 0),
            ("[::1]:65535", "::1", 65535),
        ] {
            let address: HostPort = text.parse().unwrap();
            assert_eq!((address.host.as_str(), address.port), (host, port));
            assert_eq!(address.to_string(), text);
            assert!(address.resolve().unwrap().ip().is_loopback());
        }
    }

    #[test]
    fn says_what_is_wrong() {
        let error = |text: &str| text.parse::<HostPort>().unwrap_err();
        assert_eq!(error("127.0.0.1"), AddressError::NoPort);
        assert_eq!(error(":14550"), AddressError::NoHost);
        assert_eq!(error("h:65536"), AddressError::Port("65536".into()));
        assert_eq!(error("h:+1"), AddressError::Port("+1".into()));
        assert_eq!(error("h:"), AddressError::Port(String::new()));
        assert_eq!(error("::1:14550"), AddressError::Brackets);
        assert_eq!(error("[h]:1"), AddressError::Brackets);
        assert_eq!(error("[::1:1"), AddressError::Brackets);
    }

    proptest! {
        #[test]
        fn what_is_read_is_written(text in ".{0,40}") {
            if let Ok(address) = text.parse::<HostPort>() {
                prop_assert_eq!(address.to_string().parse(), Ok(address));
            }
        }
    }
}
