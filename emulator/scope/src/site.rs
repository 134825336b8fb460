//! A page that is served: what a program does with it.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

use thiserror::Error;

use crate::address::HostPort;
use crate::guard::Guard;
use crate::hub::{Hub, Message, Order, ViewerId};
use crate::server::{self, Server};
use crate::show::Show;

/// Why there is no page; one line, with what to do.
#[derive(Debug, Error)]
pub enum SiteError {
    /// The host's name has no address.
    #[error("--web {0}: the host cannot be resolved ({1}); give an address, such as 127.0.0.1")]
    Host(HostPort, io::Error),
    /// Another program listens there.
    #[error("--web {0}: port {port} is taken; give another port", port = .0.port)]
    Taken(HostPort),
    /// The system refuses the socket.
    #[error("--web {0}: cannot listen ({1}); give an address of this machine")]
    Socket(HostPort, io::Error),
}

/// The program's side of the page.
pub struct Site<S: Show> {
    hub: Arc<Hub<S>>,
    orders: Receiver<Order<S::Asked>>,
    local: SocketAddr,
    url: String,
}

impl<S: Show> Site<S> {
    /// Serves the page from now on; each viewer is told `greeting`, JSON, first. What has been written of recording N
    /// by then is there to be fetched at `/recording/N`.
    ///
    /// # Errors
    /// It cannot be served there.
    pub fn open(
        address: &HostPort,
        show: Arc<S>,
        greeting: String,
        recordings: Vec<PathBuf>,
    ) -> Result<Self, SiteError> {
        let local = address.resolve();
        let local = local.map_err(|error| SiteError::Host(address.clone(), error))?;
        let refused = |error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => SiteError::Taken(address.clone()),
            _ => SiteError::Socket(address.clone(), error),
        };
        let listener = TcpListener::bind(local).map_err(refused)?;
        let local = listener.local_addr().map_err(refused)?;
        let guard = Guard::new(local).map_err(refused)?;
        let url = guard.url();
        let (hub, orders) = Hub::new(show);
        let hub = Arc::new(hub);
        let server = Server {
            guard,
            hub: Arc::clone(&hub),
            greeting,
            recordings,
        };
        server::serve(listener, server);
        Ok(Self {
            hub,
            orders,
            local,
            url,
        })
    }

    /// Where it is served.
    pub fn local(&self) -> SocketAddr {
        self.local
    }

    /// What a person opens.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// How many view.
    pub fn viewers(&self) -> usize {
        self.hub.viewers()
    }

    /// The next message of a page, if there is one.
    pub fn order(&self) -> Option<Order<S::Asked>> {
        self.orders.try_recv().ok()
    }

    /// Sends whole MAVLink frames to every page. Never waits.
    pub fn send(&self, frames: &[u8]) {
        if !frames.is_empty() && self.viewers() > 0 {
            self.hub.send(None, || Message::Mavlink(frames.to_vec()));
        }
    }

    /// Tells a viewer, or all of them, JSON. Never waits.
    pub fn tell(&self, to: Option<ViewerId>, text: &str) {
        self.hub.send(to, || Message::Text(text.to_owned()));
    }
}
