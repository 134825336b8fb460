//! Several ESCs on one clock, one supply and one MAVLink link, advanced by calls.
//!
//! No socket and no wall clock: the program and other languages' modules run this. The ESCs advance one control period
//! at a time, the one furthest behind first, each at the voltage to which all have brought their supply. Each behaves
//! as it would alone, bit for bit, if the supply is stiff.

mod environment;
mod group;
mod heard;
mod pack;
mod state;

use siskin_params::ParamId;

use crate::device::{Device, Start, StartError};
use crate::fault::Fault;
use crate::link::LinkId;
use crate::machine::{Machine, Onlooker, Stopped};
use crate::plant::{Air, Source};
use crate::rig::Bench;
use crate::summary::Rejected;
use crate::wire::{self, Wire};
use group::Part;
use heard::Heard;
use pack::Pack;
use state::Means;

pub use environment::{Environment, OutOfRange, Shaft};
pub use heard::Answer;
pub use state::{EscState, Reported};

/// Most ESCs: the number of bits in `ESC_INFO`.
pub const ESCS_MAX: usize = 8;

/// The component id of the first of several ESCs, if none is given.
const FIRST_COMPONENT: f32 = 140.0;

/// The highest component id that `MAV_COMP_ID` takes.
const LAST_COMPONENT: f32 = 250.0;

/// ESCs that run together.
pub struct Rack {
    escs: Vec<Device>,
    /// What they share; a single one has its own supply.
    pack: Option<Pack>,
    parts: Vec<Part>,
    means: Vec<Means>,
    answers: Vec<Answer>,
    /// True if nothing has run in the latest advance: the means are of the one before.
    means_are_old: bool,
    now_ns: u64,
}

impl Rack {
    /// Powers the ESCs up. Several are peripherals on MAVLink, with component ids that count from the first one's
    /// `MAV_COMP_ID`, or from 140; the supply is the first one's.
    ///
    /// Returns them with a warning for each whose stored parameters are not intact.
    ///
    /// # Errors
    /// As for [`Device::start`].
    pub fn start(mut starts: Vec<Start>) -> Result<(Self, Vec<&'static str>), StartError> {
        let several = starts.len() > 1;
        if several {
            number(&mut starts)?;
        }
        let supplies: Vec<_> = starts.iter().map(|start| start.bench.supply).collect();
        let started = starts.into_iter().map(Device::start);
        let started = started.collect::<Result<Vec<_>, _>>()?;
        let (mut escs, warnings): (Vec<_>, Vec<_>) = started.into_iter().unzip();
        let parts = group::parts(&escs);
        for (esc, part) in escs.iter_mut().zip(&parts) {
            if matches!(part, Part::Follows) {
                esc.esc_mut().follow();
            }
        }
        let rack = Self {
            pack: several.then(|| Pack::new(&supplies)).flatten(),
            means: vec![Means::default(); escs.len()],
            answers: Vec::new(),
            means_are_old: true,
            now_ns: 0,
            parts,
            escs,
        };
        Ok((rack, warnings.into_iter().flatten().collect()))
    }

    /// Returns the ESCs.
    pub fn escs(&self) -> &[Device] {
        &self.escs
    }

    /// Returns how far [`Rack::go_on_to`] has advanced, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Plays a throttle-wire datagram on an ESC's wire, from `start_ns` on or after what still plays.
    ///
    /// # Errors
    /// It is malformed, or too much is pending.
    pub fn play(
        &mut self,
        esc: usize,
        start_ns: u64,
        datagram: &[u8],
    ) -> Result<(), wire::Rejected> {
        self.escs[esc].wire().play(start_ns, datagram)
    }

    /// Changes the ESCs' surroundings, from their next control periods on.
    pub fn surround(&mut self, change: &Environment) {
        let pack = self.pack.as_mut().map(Pack::bus_mut);
        let own = self.escs.first_mut().map(|esc| esc.around_mut().bus_mut());
        if let Some(bus) = pack.or(own) {
            let mut supply = bus.supply();
            if let Some(volts) = change.supply_v {
                let sinks = supply.sinks();
                supply.source = Source::Fixed { volts, sinks };
            }
            supply.resistance_ohm = change.supply_ohm.unwrap_or(supply.resistance_ohm);
            bus.set_supply(supply);
        }
        for (index, esc) in self.escs.iter_mut().enumerate() {
            let around = esc.around_mut();
            let before = around.air();
            let shaft = change.shafts.get(index).copied().unwrap_or_default();
            around.surround(Air {
                torque_nm: shaft.torque_nm.unwrap_or(before.torque_nm),
                wind_rad_s: shaft.wind_rad_s().unwrap_or(before.wind_rad_s),
                ambient_c: change.ambient_c.unwrap_or(before.ambient_c),
            });
        }
    }

    /// Begins an advance that [`Rack::go_on_to`] makes in several strides: answers and means cover all of them.
    pub fn begin(&mut self) {
        self.answers.clear();
        self.means_are_old = true;
    }

    /// Runs all control periods that begin before `until_ns`; the result does not depend on how a time is divided into
    /// calls. `send` receives every MAVLink frame.
    pub fn go_on_to(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) {
        self.run(|esc| esc.now_ns() < until_ns, onlooker, send);
        self.now_ns = self.now_ns.max(until_ns);
    }

    /// Returns the ESCs' answers in the latest advance, in order.
    pub fn answers(&self) -> &[Answer] {
        &self.answers
    }

    /// Returns the present state of the ESCs and their motors.
    pub fn states(&self) -> impl Iterator<Item = EscState> {
        let escs = self.escs.iter().zip(&self.means);
        escs.map(|(esc, means)| state::state(esc, means))
    }

    /// Passes bytes received on a MAVLink stream to all of them.
    pub fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker) {
        for esc in 0..self.escs.len() {
            self.receive_for(esc, stream, bytes, onlooker);
        }
    }

    /// Passes them to one ESC.
    pub fn receive_for(
        &mut self,
        esc: usize,
        stream: LinkId,
        bytes: &[u8],
        onlooker: &mut impl Onlooker,
    ) {
        onlooker.esc(esc);
        self.escs[esc].receive(stream, bytes, onlooker);
    }

    /// Forgets a MAVLink stream that has ended.
    pub fn forget(&mut self, stream: LinkId) {
        self.escs.iter_mut().for_each(|esc| esc.forget(stream));
    }

    fn run(
        &mut self,
        is_left: impl Fn(&Device) -> bool,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) {
        let mut begin_s: Vec<_> = self.escs.iter().map(Device::begins_s).collect();
        while let Some(esc) = first(&begin_s) {
            if !is_left(&self.escs[esc]) {
                begin_s[esc] = f64::INFINITY;
                continue;
            }
            if std::mem::take(&mut self.means_are_old) {
                self.means.fill(Means::default());
            }
            self.step(esc, onlooker, send);
            begin_s[esc] = self.escs[esc].begins_s();
        }
        let next = self.escs.iter().map(Device::begins_s).reduce(f64::min);
        if let (Some(pack), Some(next_s)) = (&mut self.pack, next) {
            // As the next period would find it.
            let volts = pack.volts_at(next_s);
            for esc in &mut self.escs {
                esc.around_mut().bus_mut().feed(volts);
            }
        }
    }

    fn step(&mut self, index: usize, onlooker: &mut impl Onlooker, send: &mut dyn FnMut(&[u8])) {
        if let Part::Leads(slots, count) = self.parts[index]
            && self.escs[index].task_is_due()
        {
            let four = group::four(&self.escs, slots, count);
            self.escs[index].esc_mut().lead(four);
        }
        onlooker.esc(index);
        let mut heard = Heard {
            onlooker,
            answers: &mut self.answers,
            esc: index,
        };
        let esc = &mut self.escs[index];
        if let Some(pack) = &mut self.pack {
            let volts = pack.volts_at(esc.begins_s());
            esc.around_mut().bus_mut().feed(volts);
        }
        let motion = esc.step(&|_, _| None, &mut heard, send);
        self.means[index].add(&motion, esc.rig().period_s());
        if let Some(pack) = &mut self.pack {
            let is_connected = esc.around_mut().bus_mut().is_connected();
            pack.draw(index, if is_connected { motion.bus_a } else { 0.0 });
        }
    }
}

/// Returns the ESC whose period begins first, if any begins.
fn first(begin_s: &[f64]) -> Option<usize> {
    let (mut first, mut first_s) = (None, f64::INFINITY);
    for (esc, begins_s) in begin_s.iter().enumerate() {
        if *begins_s < first_s {
            (first, first_s) = (Some(esc), *begins_s);
        }
    }
    first
}

/// Gives each its component id, and its share of the link.
fn number(starts: &mut [Start]) -> Result<(), StartError> {
    let escs = starts.len();
    let given = starts[0].overrides.iter().rev();
    let mut given = given.filter(|(id, _)| *id == ParamId::MavCompId);
    let first = given.next().map_or(FIRST_COMPONENT, |(_, value)| *value);
    if first + (escs - 1) as f32 > LAST_COMPONENT {
        return Err(StartError::Params {
            name: ParamId::MavCompId.entry().name,
            reason: "leaves no component id up to 250 for the last ESC; give a lower one",
        });
    }
    for (index, start) in starts.iter_mut().enumerate() {
        start.overrides.extend([
            (ParamId::MavRole, 1.0),
            (ParamId::MavCompId, first + index as f32),
        ]);
        start.link_bytes_per_s /= escs as u32;
    }
    Ok(())
}

impl Machine for Rack {
    fn now_ns(&self) -> u64 {
        self.escs.iter().map(Device::now_ns).min().unwrap_or(0)
    }

    fn is_before(&self, until_ns: u64) -> bool {
        self.escs.iter().any(|esc| esc.is_before(until_ns))
    }

    fn escs(&self) -> usize {
        self.escs.len()
    }

    fn wire(&mut self, esc: usize) -> &mut Wire {
        self.escs[esc].wire()
    }

    fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker) {
        self.receive(stream, bytes, onlooker);
    }

    fn forget(&mut self, stream: LinkId) {
        self.forget(stream);
    }

    fn advance(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Stopped> {
        self.begin();
        self.run(|esc| esc.is_before(until_ns), onlooker, send);
        Ok(())
    }

    fn inject(&mut self, esc: usize, fault: Fault) -> Result<(), &'static str> {
        self.escs[esc].inject(fault);
        Ok(())
    }

    fn mend(&mut self, esc: usize) -> Result<(), &'static str> {
        self.escs[esc].mend();
        Ok(())
    }

    fn fit(&mut self, esc: usize, bench: &Bench) -> Result<(), &'static str> {
        let device = &mut self.escs[esc];
        device.fit(bench)?;
        if self.pack.is_none() {
            device.around_mut().bus_mut().set_supply(bench.supply);
        }
        Ok(())
    }

    fn rejected(&self, esc: usize) -> Rejected {
        self.escs[esc].rejected()
    }
}
