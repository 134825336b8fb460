//! `siskin scope`: the page in the browser, for an ESC on a link.
//!
//! The page is a MAVLink client, and this a bridge between its socket and the link. Nothing else goes over it, so
//! that a page can do no more than a ground station can.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;
use std::time::{Duration, Instant};

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};
use serde::Deserialize;
use siskin_control::mavlink::{Address, Receiver};
use siskin_control::telemetry::SIGNALS;
use siskin_scope::{ORDERS, Order, Show, Site, ViewerId, What};

use crate::cli::ScopeArgs;
use crate::error::Error;
use crate::session::Session;

/// How long the link is waited for, and so what waits for a page.
const LOOK: Duration = Duration::from_millis(5);

/// Our own heartbeat, without which some links forget us.
const GREETING_PERIOD: Duration = Duration::from_secs(1);

/// Where COMMAND_LONG has the command, and the two ids that it is for.
const COMMAND_AT: usize = 28;

/// All goes by MAVLink.
struct LinkAlone;

/// What else a page may ask for: nothing.
#[derive(Deserialize)]
enum Asked {}

impl Show for LinkAlone {
    type Asked = Asked;
    type Held = ();

    fn answer(&self, (): &mut (), asked: Asked) -> Result<Vec<u8>, Asked> {
        Err(asked)
    }

    fn viewed(&self, _: bool) {}
}

/// Serves the page until the link is lost.
///
/// # Errors
/// [`Error::Page`] where it cannot be served; any of the link.
pub(crate) fn run(
    mut session: Session,
    args: &ScopeArgs,
    component: Option<u8>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let mut hello = serde_json::Map::new();
    hello.insert("simulated".into(), false.into());
    hello.insert("signals".into(), SIGNALS.to_vec().into());
    // Without it every ESC of the system is there to be chosen.
    hello.insert("component".into(), component.into());
    let site = Site::open(
        &args.web,
        Arc::new(LinkAlone),
        siskin_scope::greeting(hello),
        Vec::new(),
    )?;
    writeln!(out, "open {} in a browser; Ctrl-C ends it", site.url())?;
    out.flush()?;
    let mut tests = Tests::default();
    let mut greeted = Instant::now();
    loop {
        if greeted.elapsed() >= GREETING_PERIOD {
            session.greet()?;
            greeted = Instant::now();
        }
        let mut frames = Vec::new();
        session.relay(LOOK, |frame| frames.extend_from_slice(frame))?;
        site.send(&frames);
        // No more than the queue has held: pages that go on sending hold nothing up.
        for Order { viewer, what, .. } in (0..ORDERS).map_while(|_| site.order()) {
            match what {
                What::Mavlink(bytes) => {
                    tests.look(viewer, &bytes);
                    session.pass(&bytes)?;
                }
                What::Ended => {
                    if let Some(end) = tests.end(viewer) {
                        session.send(&end)?;
                    }
                }
                What::Asked(asked) => match asked {},
            }
        }
    }
}

/// Who turns a motor by a test: a page that is gone must not go on with it.
#[derive(Default)]
struct Tests(BTreeMap<ViewerId, Address>);

impl Tests {
    /// Looks at the frames that a page sends.
    fn look(&mut self, viewer: ViewerId, bytes: &[u8]) {
        // A page sends whole frames.
        Receiver::new().push(0, bytes, |frame| {
            let Some(&[low, high, system, component]) =
                frame.payload.get(COMMAND_AT..COMMAND_AT + 4)
            else {
                return;
            };
            let command = u32::from(u16::from_le_bytes([low, high]));
            if frame.id == COMMAND_LONG_DATA::ID && command == MavCmd::MAV_CMD_ACTUATOR_TEST as u32
            {
                self.0.insert(viewer, Address { system, component });
            }
        });
    }

    /// What ends the test of a page that is gone.
    fn end(&mut self, viewer: ViewerId) -> Option<COMMAND_LONG_DATA> {
        let of = self.0.remove(&viewer)?;
        Some(COMMAND_LONG_DATA {
            // No value.
            param1: f32::NAN,
            command: MavCmd::MAV_CMD_ACTUATOR_TEST,
            target_system: of.system,
            target_component: of.component,
            ..COMMAND_LONG_DATA::DEFAULT
        })
    }
}

#[cfg(test)]
mod tests {
    use mavlink::{MAVLinkV2MessageRaw, MavHeader};

    use super::*;

    fn frame(message: &impl MessageData) -> Vec<u8> {
        let mut frame = MAVLinkV2MessageRaw::new();
        frame.serialize_message_data(MavHeader::default(), message);
        frame.raw_bytes().to_vec()
    }

    #[test]
    fn only_a_page_that_has_begun_a_test_ends_one_by_going() {
        let command = |command| COMMAND_LONG_DATA {
            param1: 0.5,
            param2: 3.0,
            command,
            target_system: 7,
            target_component: 142,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        let mut tests = Tests::default();
        tests.look(1, &frame(&command(MavCmd::MAV_CMD_ACTUATOR_TEST)));
        tests.look(2, &frame(&command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS)));
        tests.look(3, b"no frame");
        assert!(tests.end(2).is_none() && tests.end(3).is_none());
        let end = tests.end(1).expect("it has begun one");
        assert!(end.param1.is_nan() && end.command == MavCmd::MAV_CMD_ACTUATOR_TEST);
        assert_eq!((end.target_system, end.target_component), (7, 142));
        assert!(tests.end(1).is_none());
    }
}
