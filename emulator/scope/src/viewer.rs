//! One viewer's WebSocket, on a thread of its own.

use std::io;
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message as Socket, WebSocket};

use crate::MAVLINK;
use crate::hub::{Hub, Message, Order, Seat, What};
use crate::show::Show;

/// How long one look for messages from the page waits, and so what waits for the page.
const LOOK: Duration = Duration::from_millis(10);

/// The longest message from a page.
const MAX_BYTES: usize = 1 << 16;

/// What may wait in the socket: a view of all channels on a wide screen has 1.1 MB.
const MAX_WRITE_BYTES: usize = 1 << 22;

/// Serves a viewer until it goes, or does not read. `greeting` comes first.
pub(crate) fn serve<S: Show>(
    stream: TcpStream,
    rest: Vec<u8>,
    hub: &Hub<S>,
    seat: &Seat<S::Asked>,
    greeting: String,
) {
    // Why it has ended concerns nobody: the page says so, and connects anew.
    let _ = converse(stream, rest, hub, seat, greeting);
    hub.leave(seat.id);
    // Where the program has ended, nobody takes it.
    let _ = tell(seat, What::Ended);
}

fn converse<S: Show>(
    stream: TcpStream,
    rest: Vec<u8>,
    hub: &Hub<S>,
    seat: &Seat<S::Asked>,
    greeting: String,
) -> Result<(), Error> {
    stream.set_read_timeout(Some(LOOK))?;
    let limits = WebSocketConfig::default()
        .max_message_size(Some(MAX_BYTES))
        .max_frame_size(Some(MAX_BYTES))
        .max_write_buffer_size(MAX_WRITE_BYTES);
    let mut socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(limits));
    socket.send(Socket::text(greeting))?;
    let mut held = S::Held::default();
    while !seat.dropped.load(Ordering::Relaxed) {
        match socket.read() {
            Ok(Socket::Binary(bytes)) => match bytes.split_first() {
                Some((&MAVLINK, bytes)) => tell(seat, What::Mavlink(bytes.to_vec()))?,
                _ => return Ok(()),
            },
            Ok(Socket::Text(text)) => match serde_json::from_str(&text) {
                Ok(asked) => match hub.show().answer(&mut held, asked) {
                    Ok(bytes) => socket.write(Socket::binary(bytes))?,
                    Err(asked) => tell(seat, What::Asked(asked))?,
                },
                // Of another version, or no page.
                Err(_) => return Ok(()),
            },
            Ok(_) => {}
            Err(Error::Io(error)) if is_pending(&error) => {}
            Err(error) => return Err(error),
        }
        deliver(&mut socket, seat)?;
    }
    Ok(())
}

/// Sends what waits, MAVLink in one piece.
fn deliver<A>(socket: &mut WebSocket<TcpStream>, seat: &Seat<A>) -> Result<(), Error> {
    let mut frames = vec![MAVLINK];
    for message in seat.inbox.try_iter() {
        match message {
            Message::Mavlink(frame) => frames.extend(frame),
            Message::Text(text) => socket.write(Socket::text(text))?,
        }
    }
    if frames.len() > 1 {
        socket.write(Socket::binary(frames))?;
    }
    socket.flush()
}

fn tell<A>(seat: &Seat<A>, what: What<A>) -> Result<(), Error> {
    let order = Order {
        viewer: seat.id,
        came: Instant::now(),
        what,
    };
    seat.orders.send(order).map_err(|_| Error::ConnectionClosed)
}

fn is_pending(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
    )
}
