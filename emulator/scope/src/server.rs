//! The page's HTTP server: one request a connection, each on a thread of its own.

use std::io::{self, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use tungstenite::handshake::derive_accept_key;

use crate::assets;
use crate::guard::Guard;
use crate::head::Head;
use crate::hub::Hub;
use crate::recording;
use crate::show::Show;
use crate::viewer;
use crate::waiting::Waiting;

/// Connections at a time; of more, those that have not asked for anything yet are closed.
const MAX_CONNECTIONS: usize = 32;

/// A peer that does not read or write for so long is dropped.
const STUCK: Duration = Duration::from_secs(1);

/// The page may use what is its own, and nothing may use the page.
const HEADERS: &str = "\
Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
Cross-Origin-Opener-Policy: same-origin\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
Referrer-Policy: no-referrer\r\n\
X-Content-Type-Options: nosniff\r\n\
Cache-Control: no-store\r\n\
Connection: close\r\n";

/// What all connections share.
pub(crate) struct Server<S: Show> {
    pub(crate) guard: Guard,
    pub(crate) hub: Arc<Hub<S>>,
    /// The first message to each page.
    pub(crate) greeting: String,
    pub(crate) recordings: Vec<PathBuf>,
}

/// Serves from now on, until the program ends.
pub(crate) fn serve<S: Show>(listener: TcpListener, server: Server<S>) {
    let (server, open) = (Arc::new(server), Arc::new(AtomicUsize::new(0)));
    let waiting = Arc::new(Waiting::default());
    thread::spawn(move || {
        for (number, stream) in (0..).zip(listener.incoming()) {
            let stream = stream.and_then(|stream| Ok((stream.try_clone()?, stream)));
            let Ok((own, mut stream)) = stream else {
                // Too many open files, say: others may close some.
                thread::sleep(STUCK);
                continue;
            };
            if open.load(Ordering::Relaxed) >= MAX_CONNECTIONS && !waiting.end_oldest() {
                continue;
            }
            open.fetch_add(1, Ordering::Relaxed);
            waiting.add(number, own);
            let (server, open) = (Arc::clone(&server), Arc::clone(&open));
            let waiting = Arc::clone(&waiting);
            thread::spawn(move || {
                let read = Head::read(&mut stream, STUCK);
                waiting.remove(number);
                // A peer that is gone hears no reason.
                let _ = answer(stream, read, &server);
                open.fetch_sub(1, Ordering::Relaxed);
            });
        }
    });
}

fn answer<S: Show>(
    mut stream: TcpStream,
    read: io::Result<(Head, Vec<u8>)>,
    server: &Server<S>,
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(STUCK))?;
    let (head, rest) = match read {
        Ok(read) => read,
        Err(error) if error.kind() == io::ErrorKind::InvalidData => {
            return reply(&mut stream, "400 Bad Request", &error.to_string());
        }
        Err(error) => return Err(error),
    };
    if let Err(reason) = server.guard.admits(&head) {
        return reply(&mut stream, "403 Forbidden", reason);
    }
    if head.path == "/socket" {
        let Some(key) = &head.websocket_key else {
            return reply(
                &mut stream,
                "400 Bad Request",
                "this is for the page's socket",
            );
        };
        let Some(seat) = server.hub.join() else {
            return reply(
                &mut stream,
                "503 Service Unavailable",
                "too many pages view already",
            );
        };
        let accept = derive_accept_key(key.as_bytes());
        let upgrade =
            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n";
        // A peer that is gone is found so by the socket.
        let _ = write!(stream, "{upgrade}Sec-WebSocket-Accept: {accept}\r\n\r\n");
        viewer::serve(stream, rest, &server.hub, &seat, server.greeting.clone());
        return Ok(());
    }
    if let Some(path) = recording::named(&server.recordings, &head.path) {
        let Ok((mut file, length)) = recording::open(path) else {
            return reply(&mut stream, "404 Not Found", "it cannot be read any more");
        };
        let kind = "application/octet-stream";
        begin(&mut stream, "200 OK", kind, length, "")?;
        return io::copy(&mut file, &mut stream).map(drop);
    }
    match assets::find(&head.path) {
        Some((kind, content)) => {
            let cookie = server.guard.cookie(&head);
            begin(&mut stream, "200 OK", kind, content.len() as u64, &cookie)?;
            stream.write_all(content.as_bytes())
        }
        None => reply(&mut stream, "404 Not Found", "there is no such file"),
    }
}

fn reply(stream: &mut TcpStream, status: &str, line: &str) -> io::Result<()> {
    let content = format!("{line}\n");
    let kind = "text/plain; charset=utf-8";
    begin(stream, status, kind, content.len() as u64, "")?;
    stream.write_all(content.as_bytes())
}

/// All that stands before the content, with lines of its own.
fn begin(
    stream: &mut TcpStream,
    status: &str,
    kind: &str,
    length: u64,
    own: &str,
) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{HEADERS}{own}\r\n"
    );
    stream.write_all(head.as_bytes())
}
