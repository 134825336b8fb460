//! `siskin scope`: the browser page for an ESC on a link.
//!
//! The page is a MAVLink client, and this module bridges its socket to the link. Nothing else passes, so a page
//! can do no more than a ground station can.

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, PARAM_SET_DATA};
use mavlink::{MavlinkVersion, MessageData};
use serde::Deserialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use siskin_control::mavlink::{Address, Receiver};
use siskin_control::telemetry::SIGNALS;
use siskin_params::ParamId;
use siskin_scope::{ORDERS, Order, Show, Site, ViewerId, What};

use crate::cli::ScopeArgs;
use crate::error::Error;
use crate::session::Session;

/// How long to wait on the link, and so how long a page may wait.
const LOOK: Duration = Duration::from_millis(5);

/// How often the end of a test or an identification is sent: nobody waits for an answer, and a frame may be lost.
const ENDS: usize = 3;

/// Interval of our own heartbeat, without which some links forget us.
const GREETING_PERIOD: Duration = Duration::from_secs(1);

/// Identification of the motor: `param1` 1 begins it, 0 ends it.
const IDENTIFY: MavCmd = MavCmd::MAV_CMD_USER_1;

/// Everything goes by MAVLink.
struct LinkAlone;

/// What else a page may request: nothing.
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
/// [`Error::Page`] if it cannot be served; any error of the link.
pub(crate) fn run(
    mut session: Session,
    args: &ScopeArgs,
    component: Option<u8>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let mut hello = serde_json::Map::new();
    hello.insert("simulated".into(), false.into());
    hello.insert("signals".into(), SIGNALS.to_vec().into());
    // Without it, every ESC of the system can be selected.
    hello.insert("component".into(), component.into());
    let site = Site::open(
        &args.web,
        Arc::new(LinkAlone),
        siskin_scope::greeting(hello),
        Vec::new(),
    )?;
    writeln!(out, "open {} in a browser; Ctrl-C ends it", site.url())?;
    out.flush()?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let mut turners = Turners::default();
    let served = serve(&mut session, &site, &mut turners, &stop);
    // However it ends, nobody holds a button any more.
    let ends = turners.end(|_| true);
    for _ in 0..ENDS {
        for end in &ends {
            // If the link is lost, the ESC's own three seconds end a test.
            let _ = session.send(end);
        }
        let heard = Instant::now() + LOOK;
        while let Ok(Some(_)) = session.next(heard) {}
    }
    if !ends.is_empty() {
        writeln!(out, "ended what a page had a motor do")?;
    }
    served
}

/// Serves until told to stop, which happens when the program is interrupted.
fn serve(
    session: &mut Session,
    site: &Site<LinkAlone>,
    turners: &mut Turners,
    stop: &AtomicBool,
) -> Result<(), Error> {
    let mut greeted = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        if greeted.elapsed() >= GREETING_PERIOD {
            session.greet()?;
            greeted = Instant::now();
        }
        let mut frames = Vec::new();
        session.relay(LOOK, |frame| frames.extend_from_slice(frame))?;
        site.send(&frames);
        // No more than the queue held, so that pages that keep sending block nothing.
        for Order { viewer, what, .. } in (0..ORDERS).map_while(|_| site.order()) {
            match what {
                What::Mavlink(bytes) => {
                    turners.look(viewer, &bytes);
                    session.pass(&bytes)?;
                }
                What::Ended => {
                    for end in turners.end(|of| of == viewer) {
                        session.send(&end)?;
                    }
                }
                What::Asked(asked) => match asked {},
            }
        }
    }
    Ok(())
}

/// Pages, and the ESCs whose motors they turn by a test or an identification, which must not outlive the page.
#[derive(Default)]
struct Turners(Vec<(ViewerId, Address)>);

impl Turners {
    /// Inspects the frames that a page sends.
    fn look(&mut self, viewer: ViewerId, bytes: &[u8]) {
        // A page sends whole frames.
        Receiver::new().push(0, bytes, |frame| {
            let version = MavlinkVersion::V2;
            let (system, component) = match frame.id {
                COMMAND_LONG_DATA::ID => match COMMAND_LONG_DATA::deser(version, frame.payload) {
                    Ok(long)
                        if [MavCmd::MAV_CMD_ACTUATOR_TEST, IDENTIFY].contains(&long.command) =>
                    {
                        (long.target_system, long.target_component)
                    }
                    _ => return,
                },
                PARAM_SET_DATA::ID => match PARAM_SET_DATA::deser(version, frame.payload) {
                    Ok(set) if set.param_id == ParamId::MotIdentify.entry().name.into() => {
                        (set.target_system, set.target_component)
                    }
                    _ => return,
                },
                _ => return,
            };
            let turner = (viewer, Address { system, component });
            if !self.0.contains(&turner) {
                self.0.push(turner);
            }
        });
    }

    /// Returns what ends these pages' tests and identifications.
    fn end(&mut self, these: impl Fn(ViewerId) -> bool) -> Vec<COMMAND_LONG_DATA> {
        let ended = self.0.extract_if(.., |(viewer, _)| these(*viewer));
        // A test without a value, and the end of the identification.
        let ends = [(MavCmd::MAV_CMD_ACTUATOR_TEST, f32::NAN), (IDENTIFY, 0.0)];
        let both = |(_, of): (ViewerId, Address)| {
            ends.map(|(command, param1)| COMMAND_LONG_DATA {
                param1,
                command,
                target_system: of.system,
                target_component: of.component,
                ..COMMAND_LONG_DATA::DEFAULT
            })
        };
        ended.flat_map(both).collect()
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
    fn only_a_page_that_has_had_a_motor_turned_ends_that_by_going() {
        let command = |command| COMMAND_LONG_DATA {
            param1: 1.0,
            command,
            target_system: 7,
            target_component: 142,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        let parameter = PARAM_SET_DATA {
            param_value: 1.0,
            target_system: 7,
            target_component: 142,
            param_id: "MOT_IDENTIFY".into(),
            ..PARAM_SET_DATA::DEFAULT
        };
        let other = PARAM_SET_DATA {
            param_id: "MOT_DIR".into(),
            ..parameter.clone()
        };
        let mut turners = Turners::default();
        for (viewer, frame) in [
            (1, frame(&command(MavCmd::MAV_CMD_ACTUATOR_TEST))),
            (2, frame(&command(IDENTIFY))),
            (3, frame(&parameter)),
            (4, frame(&command(MavCmd::MAV_CMD_RUN_PREARM_CHECKS))),
            (5, frame(&other)),
            (6, b"no frame".to_vec()),
        ] {
            turners.look(viewer, &frame);
            turners.look(viewer, &frame);
        }
        for viewer in [1, 2, 3] {
            let ends = turners.end(|of| of == viewer);
            let [test, identification] = &ends[..] else {
                panic!("{ends:?}");
            };
            assert!(test.param1.is_nan() && test.command == MavCmd::MAV_CMD_ACTUATOR_TEST);
            assert_eq!(
                (identification.param1, identification.command),
                (0.0, IDENTIFY)
            );
            assert!(
                ends.iter()
                    .all(|end| (end.target_system, end.target_component) == (7, 142))
            );
        }
        assert!(turners.end(|_| true).is_empty());
    }
}
