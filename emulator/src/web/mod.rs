//! The scope: a browser page that shows a running ESC and lets the user play with it.
//!
//! The page and its server are those of every ESC ([`siskin_scope`]), by MAVLink. In addition there is what only a
//! simulation has: traces at the control rate, a throttle wire, and faults.

mod address;
mod channel;
mod message;
mod playing;
mod ring;
mod rings;
mod switching;
mod tap;
#[cfg(test)]
mod tests;
mod throttle;
mod view;

pub use address::{WebAddress, WebAddressError};
pub use tap::Tapped;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use siskin_control::drive::Phase;
use siskin_params::ParamId;
use siskin_scope::{ORDERS, Order, Site, ViewerId, What};

use crate::bench::library;
use crate::link::{HostPort, LinkId, Links};
use crate::machine::{Machine, Onlooker};
use crate::scenario::{self, Script};
use message::FromPage;
use playing::{Playing, Stage};
use rings::Rings;
use tap::Taps;
use throttle::Throttle;

pub use siskin_scope::SiteError as WebError;

/// The page's interface to a running simulation.
pub struct Web {
    site: Site<Rings>,
    links: BTreeMap<ViewerId, LinkId>,
    taps: Taps,
    /// One per ESC: the names of its motor and load.
    names: Vec<[String; 2]>,
    /// One per ESC.
    throttles: Vec<Throttle>,
    /// One per ESC: what is played on it.
    playing: Vec<Option<Playing>>,
}

impl Web {
    /// Serves the page of this many ESCs if wanted, which have a motor and a load of these names, with each one's
    /// recording, if any; returns a line for the user if the usual port is taken.
    ///
    /// # Errors
    /// It cannot be served where the user wants it.
    pub fn open(
        address: &WebAddress,
        stands: (&[String; 2], usize),
        recordings: &[PathBuf],
    ) -> Result<(Option<Self>, Option<String>), WebError> {
        match address {
            WebAddress::None => Ok((None, None)),
            WebAddress::At(address) => Ok((Some(Self::listen(address, stands, recordings)?), None)),
            WebAddress::Usual => match Self::listen(&WebAddress::usual(), stands, recordings) {
                Ok(web) => Ok((Some(web), None)),
                Err(error) => Ok((None, Some(format!("no page: {error}")))),
            },
        }
    }

    fn listen(
        address: &HostPort,
        (names, escs): (&[String; 2], usize),
        recordings: &[PathBuf],
    ) -> Result<Self, WebError> {
        let rings = Arc::new(Rings::new(escs));
        Ok(Self {
            taps: Taps::new(&rings, escs),
            site: Site::open(
                address,
                rings,
                greeting(escs, recordings),
                recordings.to_vec(),
            )?,
            links: BTreeMap::new(),
            names: vec![names.clone(); escs],
            throttles: (0..escs).map(|_| Throttle::default()).collect(),
            playing: (0..escs).map(|_| None).collect(),
        })
    }

    /// Returns where it is served, and what the user opens.
    pub fn place(&self) -> (SocketAddr, String) {
        (self.site.local(), self.site.url().to_owned())
    }

    /// Carries out the pages' requests, and drives the throttle wire for its holder. Never waits.
    pub fn receive<M: Machine>(
        &mut self,
        links: &mut Links,
        machine: &mut M,
        onlooker: &mut impl Onlooker,
    ) {
        // No more than the queue has held, so that pages that keep sending delay nothing.
        for _ in 0..ORDERS {
            let Some(Order { viewer, came, what }) = self.site.order() else {
                break;
            };
            match what {
                What::Mavlink(bytes) => {
                    let stream = self.links.entry(viewer).or_insert_with(|| links.stream());
                    machine.receive(*stream, &bytes, onlooker);
                }
                What::Ended => {
                    for esc in 0..self.throttles.len() {
                        self.release(esc, (viewer, came));
                    }
                    if let Some(stream) = self.links.remove(&viewer) {
                        machine.forget(stream);
                    }
                }
                What::Asked(asked) => {
                    if let Err(reason) = self.obey((viewer, came), asked, machine) {
                        let text = serde_json::json!({ "refused": reason }).to_string();
                        self.site.tell(Some(viewer), &text);
                    }
                }
            }
        }
        let (now, now_ns) = (Instant::now(), machine.now_ns());
        self.go_on(now, machine);
        for (esc, throttle) in self.throttles.iter_mut().enumerate() {
            let wire = machine.wire(esc);
            throttle.play(now, wire, now_ns);
            self.taps.look(esc, wire.throttle());
            for (viewers, seen) in self.taps.seen(esc) {
                let text = serde_json::json!({ "switching": seen }).to_string();
                for viewer in viewers {
                    self.site.tell(Some(viewer), &text);
                }
            }
        }
    }

    /// Releases the throttle of a viewer that wants none any more, or is gone.
    fn release(&mut self, esc: usize, (viewer, came): (ViewerId, Instant)) {
        self.playing[esc].take_if(|playing| playing.viewer() == viewer);
        self.throttles[esc].release(viewer, came);
    }

    /// Advances what is being played.
    fn go_on(&mut self, now: Instant, machine: &mut impl Machine) {
        for (esc, place) in self.playing.iter_mut().enumerate() {
            let Some(playing) = place else {
                self.taps.measured(esc);
                continue;
            };
            let told = match playing.play(now, &mut self.throttles[esc], esc, machine) {
                Stage::GoesOn => continue,
                Stage::Over => {
                    let script = playing.script();
                    let summary = self.taps.measured(esc);
                    match script.ending(&summary.unwrap_or_else(|| script.summary())) {
                        Ok(ending) => serde_json::json!({ "scenario": ending }),
                        Err(reason) => serde_json::json!({ "refused": reason }),
                    }
                }
                Stage::Refused(reason) => serde_json::json!({ "refused": reason }),
            };
            self.site.tell(Some(playing.viewer()), &told.to_string());
            self.taps.measured(esc);
            *place = None;
        }
    }

    fn obey(
        &mut self,
        from: (ViewerId, Instant),
        asked: FromPage,
        machine: &mut impl Machine,
    ) -> Result<(), String> {
        let now_ns = machine.now_ns();
        let (FromPage::Throttle { esc, .. }
        | FromPage::Silence { esc }
        | FromPage::Switching { esc }
        | FromPage::Standing { esc }
        | FromPage::Fit { esc, .. }
        | FromPage::Scenario { esc, .. }
        | FromPage::Fault { esc, .. }
        | FromPage::Mend { esc }) = asked
        else {
            // A viewer's own views are handled there.
            return Ok(());
        };
        let throttle = self.throttles.get_mut(esc);
        let throttle = throttle.ok_or_else(|| "there is no such ESC".to_owned())?;
        match asked {
            FromPage::Throttle { value, signal, .. } => {
                self.playing[esc].take_if(|playing| playing.viewer() == from.0);
                let asked = throttle.ask(from, (value, signal), machine.wire(esc), now_ns);
                asked.map_err(|refused| refused.line().to_owned())
            }
            FromPage::Silence { .. } => {
                self.release(esc, from);
                Ok(())
            }
            FromPage::Standing { .. } => {
                self.site
                    .tell(Some(from.0), &standing(esc, &self.names[esc]));
                Ok(())
            }
            FromPage::Fit { bench, .. } => {
                let (names, params) = fit(esc, &bench, machine)?;
                self.site.tell(None, &standing(esc, &names));
                let fitted = serde_json::json!({ "names": names, "params": params });
                let told = serde_json::json!({ "fitted": fitted });
                self.site.tell(Some(from.0), &told.to_string());
                self.names[esc] = names;
                Ok(())
            }
            FromPage::Scenario { text, .. } => {
                let script = Script::read(&text)?;
                self.taps
                    .measure(esc, script.summary(), now_ns as f64 * 1e-9);
                self.playing[esc] = Some(Playing::new(from.0, script, now_ns));
                Ok(())
            }
            FromPage::Switching { .. } => {
                self.taps.ask(esc, from.0);
                Ok(())
            }
            FromPage::Fault { keys, .. } => {
                let mut fault = scenario::fault(&keys)?;
                fault.at_s = now_ns as f64 * 1e-9;
                machine.inject(esc, fault).map_err(str::to_owned)
            }
            FromPage::Mend { .. } => machine.mend(esc).map_err(str::to_owned),
            FromPage::View(_) => Ok(()),
        }
    }

    /// Sends MAVLink frames to every page.
    pub fn send(&self, frames: &[u8]) {
        self.site.send(frames);
    }

    /// Returns an onlooker that records the traces beside `onlooker`, if there is a page.
    pub fn tapped<'a, O>(web: Option<&'a mut Self>, onlooker: &'a mut O) -> Tapped<'a, O> {
        Tapped {
            onlooker,
            taps: web.map(|web| &mut web.taps),
        }
    }
}

/// Parameters by name.
type Named = Vec<(&'static str, f32)>;

/// Fits a bench of the library; returns the names of its motor and load, and what the ESC would have to know: whatever
/// any of these benches sets, from the factory if this one does not, so that nothing of another is left.
fn fit(
    esc: usize,
    bench: &str,
    machine: &mut impl Machine,
) -> Result<([String; 2], Named), String> {
    if !library::names().any(|known| known == bench) {
        // A page has no right to this machine's files.
        return Err("there is no such bench in the library".to_owned());
    }
    let standing = scenario::stand(bench, toml::Table::new()).map_err(|error| error.to_string())?;
    machine.fit(esc, &standing.bench)?;
    let entries = ParamId::ALL.iter().map(|id| (*id, id.entry()));
    let params = entries.filter(|(_, entry)| library::sets(entry.name));
    let params = params.map(|(id, entry)| {
        let own = standing.params.iter().find(|(of, _)| *of == id);
        (entry.name, own.map_or(entry.default, |(_, value)| *value))
    });
    Ok((standing.names, params.collect()))
}

/// Returns what a page is told of the motor and load that stand there.
fn standing(esc: usize, names: &[String; 2]) -> String {
    serde_json::json!({ "stands": { "esc": esc, "names": names } }).to_string()
}

/// Returns a page's greeting: what is available.
fn greeting(escs: usize, recordings: &[PathBuf]) -> String {
    let phases = Phase::ALL.map(|phase| format!("{phase:?}").to_lowercase());
    let channels: Vec<_> = channel::names().collect();
    let mut hello = serde_json::Map::new();
    hello.insert("simulated".into(), true.into());
    hello.insert("escs".into(), escs.into());
    hello.insert("channels".into(), channels.into());
    hello.insert(
        "benches".into(),
        library::names().collect::<Vec<_>>().into(),
    );
    // A file that is incomplete until its end cannot be fetched.
    let names = recordings.iter().map(|path| match path.extension() {
        Some(extension) if extension == "parquet" => None,
        _ => path.file_name().map(|name| name.to_string_lossy()),
    });
    hello.insert(
        "recordings".into(),
        serde_json::json!(names.collect::<Vec<_>>()),
    );
    hello.insert("phases".into(), phases.to_vec().into());
    siskin_scope::greeting(hello)
}
