//! Who may have the page and its socket: a page from elsewhere, open in the same browser, may not.
//!
//! A browser sends requests to loopback for any page that asks it to. It tells in `Origin` for which, and in `Host`
//! by which name it came here: a name that its owner has turned to this machine is not one of this machine's. Beyond
//! loopback there are other people too, so there a token is wanted besides, which the first screen tells: it comes with
//! the address of the page, and from then on as a cookie with whatever the page loads.

use std::fmt::Write as _;
use std::io;
use std::net::{IpAddr, SocketAddr};

use crate::head::Head;

/// Bytes of a token: too many to be tried.
const TOKEN_BYTES: usize = 16;

/// What is looked at before anything is answered.
pub(crate) struct Guard {
    local: SocketAddr,
    token: Option<String>,
}

impl Guard {
    /// For a server at this address.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub(crate) fn new(local: SocketAddr) -> io::Result<Self> {
        let token = if local.ip().is_loopback() {
            None
        } else {
            let mut bytes = [0; TOKEN_BYTES];
            getrandom::fill(&mut bytes).map_err(io::Error::other)?;
            let mut text = String::new();
            for byte in bytes {
                // A String takes all that is written to it.
                let _ = write!(text, "{byte:02x}");
            }
            Some(text)
        };
        Ok(Self { local, token })
    }

    /// What a person opens.
    pub(crate) fn url(&self) -> String {
        let local = self.local;
        match &self.token {
            Some(token) => format!("http://{local}/?token={token}"),
            None => format!("http://{local}/"),
        }
    }

    /// Whether a request may be answered.
    ///
    /// # Errors
    /// A line on why not.
    pub(crate) fn admits(&self, head: &Head) -> Result<(), &'static str> {
        let Some(host) = head.host.as_deref().filter(|host| self.is_own(host)) else {
            return Err("this name is not served: open the page by its IP address or as localhost");
        };
        match &head.origin {
            Some(origin) if origin.strip_prefix("http://") != Some(host) => {
                return Err("pages from elsewhere are not served");
            }
            None if head.websocket_key.is_some() => {
                return Err("the socket is for the page, and a page tells its origin");
            }
            _ => {}
        }
        match &self.token {
            Some(token)
                if !same(token, head.token()) && !same(token, head.cookie(&self.name())) =>
            {
                Err("the token is missing or wrong: open the address that the program has printed")
            }
            _ => Ok(()),
        }
    }

    /// A line of the answer to a request that brings the token in its address: the browser keeps it for this port.
    pub(crate) fn cookie(&self, head: &Head) -> String {
        match &self.token {
            Some(token) if !head.token().is_empty() => {
                let name = self.name();
                format!("Set-Cookie: {name}={token}; Path=/; HttpOnly; SameSite=Strict\r\n")
            }
            _ => String::new(),
        }
    }

    /// The cookie's name: a browser gives a host's cookies to all of its ports.
    fn name(&self) -> String {
        format!("siskin-{}", self.local.port())
    }

    /// Whether a `Host` is a name of this machine that nobody else can turn to it.
    fn is_own(&self, host: &str) -> bool {
        let suffix = format!(":{}", self.local.port());
        // Browsers leave out the port that is HTTP's own.
        let usual = (self.local.port() == 80).then_some(host);
        let Some(name) = host.strip_suffix(&suffix).or(usual) else {
            return false;
        };
        if name.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let literal = name
            .strip_prefix('[')
            .and_then(|name| name.strip_suffix(']'));
        let Ok(address) = literal.unwrap_or(name).parse::<IpAddr>() else {
            return false;
        };
        address.is_loopback() || !self.local.ip().is_loopback()
    }
}

/// Whether two texts are the same, found out in a time that tells nothing of where they part.
fn same(wanted: &str, given: &str) -> bool {
    let pairs = wanted.bytes().zip(given.bytes());
    wanted.len() == given.len() && pairs.fold(0, |sum, (a, b)| sum | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(text: &str) -> Head {
        Head::parse(text.as_bytes()).unwrap().unwrap()
    }

    fn admits(guard: &Guard, target: &str, lines: &str) -> bool {
        let text = format!("GET {target} HTTP/1.1\r\n{lines}\r\n");
        guard.admits(&head(&text)).is_ok()
    }

    const SOCKET: &str =
        "Upgrade: websocket\r\nSec-WebSocket-Key: aGVsbG8=\r\nSec-WebSocket-Version: 13\r\n";

    #[test]
    fn on_loopback_only_its_own_names_and_its_own_page_are_served() {
        let guard = Guard::new("127.0.0.1:8080".parse().unwrap()).unwrap();
        assert_eq!(guard.url(), "http://127.0.0.1:8080/");
        for (host, is_own) in [
            ("127.0.0.1:8080", true),
            ("localhost:8080", true),
            ("LOCALHOST:8080", true),
            ("[::1]:8080", true),
            ("127.0.0.1:8081", false),
            ("127.0.0.1", false),
            ("192.168.1.2:8080", false),
            ("rebound.example:8080", false),
            ("localhost.example:8080", false),
            ("", false),
        ] {
            assert_eq!(
                admits(&guard, "/", &format!("Host: {host}\r\n")),
                is_own,
                "{host}"
            );
        }
        assert!(!admits(&guard, "/", ""), "no host");
        let host = "Host: localhost:8080\r\n";
        for (origin, is_own) in [
            ("http://localhost:8080", true),
            ("https://localhost:8080", false),
            ("http://127.0.0.1:8080", false),
            ("http://evil.example", false),
            ("null", false),
        ] {
            let origin = format!("{host}Origin: {origin}\r\n");
            assert_eq!(admits(&guard, "/", &origin), is_own, "{origin}");
            assert_eq!(admits(&guard, "/socket", &(origin + SOCKET)), is_own);
        }
        assert!(
            !admits(&guard, "/socket", &format!("{host}{SOCKET}")),
            "no origin"
        );
    }

    #[test]
    fn beyond_loopback_a_token_is_wanted() {
        let guard = Guard::new("0.0.0.0:8080".parse().unwrap()).unwrap();
        let url = guard.url();
        let token = url.strip_prefix("http://0.0.0.0:8080/?token=").unwrap();
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        let host = "Host: 192.168.1.2:8080\r\n";
        let socket = format!("{host}Origin: http://192.168.1.2:8080\r\n{SOCKET}");
        for (query, is_right) in [
            (format!("?token={token}"), true),
            (format!("?token={token}0"), false),
            (format!("?token={}", "0".repeat(token.len())), false),
            (String::new(), false),
        ] {
            assert_eq!(
                admits(&guard, &format!("/{query}"), host),
                is_right,
                "{query}"
            );
            assert_eq!(
                admits(&guard, &format!("/socket{query}"), &socket),
                is_right
            );
            for path in ["/recording/0", "/scope.js", "/parameters.json"] {
                assert_eq!(admits(&guard, &format!("{path}{query}"), host), is_right);
            }
        }
        let opened = head(&format!("GET /?token={token} HTTP/1.1\r\n{host}\r\n"));
        let cookie =
            format!("Set-Cookie: siskin-8080={token}; Path=/; HttpOnly; SameSite=Strict\r\n");
        assert_eq!(guard.cookie(&opened), cookie);
        for (name, is_right) in [("siskin-8080", true), ("siskin-8081", false)] {
            let host = format!("{host}Cookie: a=b; {name}={token}\r\n");
            assert_eq!(admits(&guard, "/scope.js", &host), is_right, "{name}");
        }
        assert!(!admits(
            &guard,
            &format!("/?token={token}"),
            "Host: my.example:8080\r\n"
        ));
    }
}
