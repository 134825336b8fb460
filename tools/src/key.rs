//! `siskin key`: makes a signing key, gives it to an ESC, and takes it away.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use mavlink::dialects::ardupilotmega::SETUP_SIGNING_DATA;

use crate::error::Error;
use crate::params::{self, Storage};
use crate::session::{ANSWER_TIMEOUT, ATTEMPTS, Session};
use crate::signing::{self, Key, Signer};

/// What the ESC says of a timestamp that it does not believe.
const REFUSED: &str = "Signing refused: ";

/// Makes a file with a new key.
///
/// # Errors
/// [`Error::File`] if it exists, [`Error::Usage`] without a passphrase where one is to be read.
pub(crate) fn new(path: &Path, of_passphrase: bool, out: &mut dyn Write) -> Result<(), Error> {
    let key = of_passphrase.then(signing::passphrase).transpose()?;
    signing::create(path, key)?;
    writeln!(
        out,
        "{}: a new key; keep a copy where nobody else can read it",
        path.display()
    )?;
    Ok(())
}

/// Gives an ESC the key in a file, over a link that nobody else should hear, and has it stored. A key that it has
/// already must sign that.
///
/// # Errors
/// [`Error::Refused`] with the reason.
pub(crate) fn set(
    session: &mut Session,
    mut signer: Signer,
    path: &Path,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let key = *signer.key();
    if session.is_signed_with(&key) {
        writeln!(out, "the ESC has this key already")?;
        return Ok(());
    }
    if session.lacks_key() {
        return Err(Error::Refused {
            what: "the key".into(),
            reason: "the ESC has another one already; name that one's file with --sign-key".into(),
        });
    }
    set_up(session, &key, signer.stamp(), |session| {
        session.is_signed_with(&key)
    })?;
    session.sign(Some(signer));
    writeln!(
        out,
        "the ESC has the key; from now on give --sign-key {}",
        path.display()
    )?;
    store(session, out)
}

/// Checks that the key to be taken away was named.
///
/// # Errors
/// [`Error::Usage`].
pub(crate) fn check_remove(sign_key: Option<&Path>) -> Result<(), Error> {
    if sign_key.is_some() {
        return Ok(());
    }
    let usage = "key remove: give the key that the ESC has, with --sign-key FILE";
    Err(Error::Usage(usage.into()))
}

/// Takes the key away from an ESC, and has that stored.
///
/// # Errors
/// [`Error::Refused`] with the reason.
pub(crate) fn remove(session: &mut Session, out: &mut dyn Write) -> Result<(), Error> {
    // Checked before: there is a signer.
    let time = session.stamp().unwrap_or_default();
    set_up(session, &[0; 32], time, |session| !session.is_signed())?;
    session.sign(None);
    writeln!(
        out,
        "the ESC has no key any more: whoever reaches it can change it"
    )?;
    store(session, out)
}

/// Sends a key until the ESC's frames show that it has it.
fn set_up(
    session: &mut Session,
    key: &Key,
    initial_timestamp: u64,
    is_set: impl Fn(&Session) -> bool,
) -> Result<(), Error> {
    let target = session.target();
    let refused = |reason: &str| Error::Refused {
        what: "the key".into(),
        reason: reason.into(),
    };
    session.forget_texts();
    for _ in 0..ATTEMPTS {
        session.send(&SETUP_SIGNING_DATA {
            initial_timestamp,
            target_system: target.system,
            target_component: target.component,
            secret_key: *key,
        })?;
        // A heartbeat comes once a second.
        let deadline = Instant::now() + 3 * ANSWER_TIMEOUT;
        while session.hear(deadline)? {
            if is_set(session) {
                return Ok(());
            }
            if let Some(text) = session.texts(&[REFUSED]).first() {
                let hint = "is this computer's clock right? A restart of the ESC makes it believe another one";
                return Err(refused(&format!("{text}; {hint}")));
            }
        }
    }
    Err(Error::NoAnswer {
        what: "the key".into(),
        attempts: ATTEMPTS,
    })
}

fn store(session: &mut Session, out: &mut dyn Write) -> Result<(), Error> {
    out.flush()?;
    // The ESC's text about the key would be taken for one about the storage.
    let told = Instant::now() + ANSWER_TIMEOUT;
    while session.next_of_target(told)?.is_some() {}
    params::storage(session, Storage::Write)?;
    writeln!(out, "stored")?;
    Ok(())
}
