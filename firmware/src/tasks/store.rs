//! Requests of the ESC that concern storage.

use siskin_control::mavlink::Request;
use siskin_control::params::Params;
use siskin_control::store::{self, Integrity, StoreError};

use crate::storage::{Storage, range};

/// The parameters as stored, and what a person must know of them.
#[inline(never)]
pub(crate) fn load(flash: &mut Storage) -> (Params, Option<&'static str>) {
    let (params, integrity) = store::load(flash, range());
    let trouble = match integrity {
        Integrity::Sound | Integrity::Empty => None,
        Integrity::Incomplete => Some("storage: not whole, an earlier save is in force"),
        Integrity::Corrupt => Some("storage: corrupt, all values are the defaults"),
        Integrity::Unreadable => Some("storage: unreadable, all values are the defaults"),
    };
    (params, trouble)
}

/// Does what a request for storage asks for, with the parameters in force. Returns others that shall
/// be in force from now on.
///
/// # Errors
/// A few words on why what it promises would not survive the loss of power.
#[inline(never)]
pub(crate) fn obey(
    request: Request,
    flash: &mut Storage,
    params: &Params,
) -> Result<Option<Params>, &'static str> {
    match request {
        Request::Save => {
            store::save(flash, range(), params).map_err(StoreError::text)?;
            Ok(None)
        }
        Request::Load => match load(flash) {
            (params, None) => Ok(Some(params)),
            (_, Some(trouble)) => Err(trouble),
        },
        Request::FactoryReset => {
            store::erase(flash, range()).map_err(StoreError::text)?;
            Ok(Some(Params::default()))
        }
        Request::ParamsChanged | Request::Reboot => Ok(None),
    }
}
