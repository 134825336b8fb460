//! Where the page is served.

use std::str::FromStr;

use thiserror::Error;

use crate::link::{AddressError, HostPort};

/// The argument of `--web`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum WebAddress {
    /// Not given: at [`WebAddress::usual`], or nowhere if that is taken.
    #[default]
    Usual,
    /// There, or it is an error.
    At(HostPort),
    /// Nowhere.
    None,
}

/// Why a text is not a page's address.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "'{text}' is no address for the page: {reason}; use HOST:PORT, such as 127.0.0.1:8080, or none"
)]
pub struct WebAddressError {
    /// What was given.
    pub text: String,
    /// What is wrong with it.
    pub reason: AddressError,
}

impl WebAddress {
    /// Returns the default address of the page.
    pub fn usual() -> HostPort {
        HostPort {
            host: "127.0.0.1".to_owned(),
            port: 8080,
        }
    }
}

impl FromStr for WebAddress {
    type Err = WebAddressError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "none" {
            return Ok(Self::None);
        }
        text.parse()
            .map(Self::At)
            .map_err(|reason| WebAddressError {
                text: text.to_owned(),
                reason,
            })
    }
}
