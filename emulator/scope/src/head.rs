//! The head of an HTTP request, as far as a page needs it.
//!
//! The page is a few files and one WebSocket. `httparse` and `tungstenite` are what is needed for that, and build
//! in seconds; a web framework with its runtime takes longer to build than the emulator's other crates together.

use std::io::{self, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// The longest head that is read.
const MAX_BYTES: usize = 8192;

/// The most lines in it.
const MAX_HEADERS: usize = 64;

/// In this time a head must be there, however it trickles in: a browser sends it in one piece.
const DEADLINE: Duration = Duration::from_secs(2);

/// What a request asks for, and who asks.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Head {
    pub(crate) path: String,
    query: String,
    pub(crate) host: Option<String>,
    pub(crate) origin: Option<String>,
    /// Of a request for a WebSocket.
    pub(crate) websocket_key: Option<String>,
    cookie: Option<String>,
    /// Its length.
    bytes: usize,
}

impl Head {
    /// Reads a head; what has been read behind it comes with it. One read may take up to `stuck`.
    ///
    /// # Errors
    /// It is none, or does not come in time.
    pub(crate) fn read(stream: &mut TcpStream, stuck: Duration) -> io::Result<(Self, Vec<u8>)> {
        let wrong = |what| io::Error::new(io::ErrorKind::InvalidData, what);
        let begun = Instant::now();
        let mut bytes = Vec::new();
        let mut buffer = [0; 1024];
        loop {
            let left = DEADLINE.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return Err(wrong("the head of the request has not come in time"));
            }
            stream.set_read_timeout(Some(stuck.min(left)))?;
            let count = stream.read(&mut buffer)?;
            bytes.extend_from_slice(&buffer[..count]);
            if let Some(head) = Self::parse(&bytes).map_err(wrong)? {
                let rest = bytes.split_off(head.bytes);
                return Ok((head, rest));
            }
            if count == 0 || bytes.len() > MAX_BYTES {
                return Err(wrong("the head of the request is not whole"));
            }
        }
    }

    /// The head at the start of these bytes; nothing while it is not whole.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Option<Self>, &'static str> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        let parsed = request.parse(bytes);
        let httparse::Status::Complete(bytes) = parsed.map_err(|_| "this is no HTTP request")?
        else {
            return Ok(None);
        };
        if request.method != Some("GET") {
            return Err("only GET is served");
        }
        let target = request.path.unwrap_or_default();
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let mut head = Self {
            path: path.to_owned(),
            query: query.to_owned(),
            host: None,
            origin: None,
            websocket_key: None,
            cookie: None,
            bytes,
        };
        for header in &*request.headers {
            let place = match header.name.to_ascii_lowercase().as_str() {
                "host" => &mut head.host,
                "origin" => &mut head.origin,
                "sec-websocket-key" => &mut head.websocket_key,
                "cookie" => &mut head.cookie,
                _ => continue,
            };
            let value = std::str::from_utf8(header.value).map_err(|_| "a header is no text")?;
            if place.replace(value.to_owned()).is_some() {
                return Err("a header stands there twice");
            }
        }
        Ok(Some(head))
    }

    /// The token that came along in the address, or nothing.
    pub(crate) fn token(&self) -> &str {
        field(self.query.split('&'), "token")
    }

    /// A cookie, or nothing.
    pub(crate) fn cookie(&self, name: &str) -> &str {
        let cookies = self.cookie.as_deref().unwrap_or_default();
        field(cookies.split(';').map(str::trim), name)
    }
}

/// The first value of a name, or nothing.
fn field<'a>(fields: impl Iterator<Item = &'a str>, name: &str) -> &'a str {
    let mut pairs = fields.filter_map(|field| field.split_once('='));
    let found = pairs.find(|(key, _)| *key == name);
    found.map(|(_, value)| value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_taken_when_it_is_whole_and_only_if_it_is_plain() {
        let whole = b"GET /a?x=1&token=t HTTP/1.1\r\nHost: h:1\r\nOrigin: http://h:1\r\nCookie: a=b; c=d\r\n\r\n";
        let head = Head::parse(whole).unwrap().unwrap();
        assert_eq!((head.path.as_str(), head.token()), ("/a", "t"));
        assert_eq!(head.host.as_deref(), Some("h:1"));
        assert_eq!(
            ["a", "c", "d"].map(|name| head.cookie(name)),
            ["b", "d", ""]
        );
        assert_eq!(head.bytes, whole.len());
        for length in 0..whole.len() {
            assert_eq!(Head::parse(&whole[..length]), Ok(None), "{length}");
        }
        for wrong in [
            &b"POST / HTTP/1.1\r\n\r\n"[..],
            b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost: \xFF\r\n\r\n",
            b"\x16\x03\x01\x02\x00\x01\x00\x01",
        ] {
            assert!(Head::parse(wrong).is_err());
        }
    }
}
