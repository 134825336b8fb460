//! What TCP and UDP have in common.

use std::io;
use std::net::SocketAddr;

use super::endpoint::Endpoint;
use super::error::LinkError;
use siskin_scope::HostPort;

/// What refuses a socket: a port that is taken has another remedy than an address that is wrong.
pub(super) fn socket_error(endpoint: &Endpoint, source: io::Error) -> LinkError {
    let endpoint = endpoint.clone();
    match source.kind() {
        io::ErrorKind::AddrInUse => LinkError::Taken { endpoint },
        _ => LinkError::Socket { endpoint, source },
    }
}

pub(super) fn resolve(endpoint: &Endpoint, address: &HostPort) -> Result<SocketAddr, LinkError> {
    address.resolve().map_err(|source| LinkError::Host {
        endpoint: endpoint.clone(),
        source,
    })
}
