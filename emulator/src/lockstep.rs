#![doc = include_str!("../LOCKSTEP.md")]

mod clock;
mod request;
mod state;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::live::{LiveError, Opened, Session};
use crate::machine::Machine;
use crate::rack::Rack;
use crate::summary::Report;
use clock::Clock;
use request::is_request;

/// How long to wait for a client at a time; interrupts and new MAVLink streams are checked in between.
const WAIT: Duration = Duration::from_millis(10);

/// Runs a session clocked by a client on the first throttle wire, until its duration or an interrupt: it ends with the
/// advance that reaches its end. Calls `opened` once everything is open, and `warn` with a line that the user should
/// know.
///
/// # Errors
/// The session cannot begin or go on.
pub fn serve(
    session: Session,
    opened: impl FnOnce(&Opened, &Rack),
    warn: impl Fn(&str),
) -> Result<Report, LiveError> {
    let (mut open, starts) = session.open()?;
    let (mut rack, warnings) = Rack::start(starts)?;
    warnings.into_iter().for_each(&warn);
    opened(&open.about, &rack);

    let mut clock = Clock::new(Arc::clone(&open.stop));
    let mut request = Vec::new();
    while open.goes_on() && rack.now_ns() < open.end_ns {
        let now_ns = rack.now_ns();
        let sender = rack.wire(0).wait(now_ns, WAIT, is_request, &mut request);
        open.receive(&mut rack);
        for esc in 1..rack.escs().len() {
            rack.wire(esc).poll(now_ns);
        }
        let Some(sender) = sender else {
            continue;
        };
        let links = &mut open.links;
        let mut send = |frame: &[u8]| {
            // A peer without room loses the frame, as on any datagram link.
            links.send(frame);
        };
        let obeyed = clock.obey(&request, &mut rack, &mut open.watches, &mut send);
        if open.stop.load(Ordering::Relaxed) {
            break;
        }
        if let Err(malformed) = obeyed
            && clock.refused() == 1
        {
            warn(&format!(
                "a request in lockstep is malformed: {malformed}; others are counted only"
            ));
        }
        rack.wire(0).send_to(sender, clock.answer());
    }
    let mut report = open.finish(&rack)?;
    if let Some(rejected) = &mut report.rejected {
        rejected.lockstep_requests = Some(clock.refused());
    }
    Ok(report)
}
