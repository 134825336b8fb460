//! What TCP and UDP have in common.

use std::io;
use std::net::SocketAddr;

use super::endpoint::Endpoint;
use super::error::LinkError;
use siskin_scope::HostPort;

/// Returns the error of a refused socket: a port in use has another remedy than a wrong address.
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
