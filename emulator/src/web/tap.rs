//! Records the traces of a running simulation while someone views them.

use std::sync::Arc;

use siskin_control::telemetry::Telemetry;
use siskin_scope::ViewerId;

use super::channel::{Control, Point};
use super::ring::Chunk;
use super::rings::Rings;
use super::switching::{Look, Switching};
use crate::machine::Onlooker;
use crate::plant::Gate;
use crate::rig::{Period, Rig};
use crate::summary::Summary;
use crate::surroundings::{Motion, Passage};

/// The tap of one ESC.
pub(super) struct Tap {
    rings: Arc<Rings>,
    esc: usize,
    /// `None` while nobody views.
    chunk: Option<Chunk>,
    throttle: f32,
    look: Look,
    /// The figures of what is played, and when that began, s.
    measured: Option<(Summary, f64)>,
    /// The requested periods, with their requesters; `None` if unknown.
    seen: Vec<(Vec<ViewerId>, Option<Switching>)>,
}

impl Tap {
    pub(super) fn new(rings: Arc<Rings>, esc: usize) -> Self {
        Self {
            rings,
            esc,
            chunk: None,
            throttle: 0.0,
            look: Look::default(),
            measured: None,
            seen: Vec::new(),
        }
    }

    /// Checks whether anyone views; `throttle` is on the wire.
    pub(super) fn look(&mut self, throttle: f64) {
        self.throttle = throttle as f32;
        match (self.rings.is_viewed(), &self.chunk) {
            (true, None) => self.chunk = Some(Chunk::new()),
            (false, Some(_)) => self.chunk = None,
            _ => {}
        }
    }

    fn take(&mut self, t_s: f64, motion: &Motion, control: Option<Control>) {
        let Some(chunk) = &mut self.chunk else { return };
        chunk.push(Point {
            t_s,
            motion: *motion,
            throttle: self.throttle,
            control,
        });
        if chunk.is_full()
            && let Some(full) = self.chunk.take()
        {
            self.chunk = self.rings.push(self.esc, full);
        }
    }

    /// Captures a period edge by edge.
    #[cold]
    fn see(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        if let Some((viewers, seen)) = self.look.period(t_s, period, rig) {
            self.seen.push((viewers, Some(seen)));
        }
    }

    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        if let Some((summary, begun_s)) = &mut self.measured {
            summary.add(t_s - *begun_s, period, rig);
        }
        if self.chunk.is_some() {
            if self.look.is_asked() {
                self.see(t_s, period, rig);
            }
            let config = rig.config();
            let control = Control {
                bridge: period.bridge,
                snapshot: rig.snapshot(),
                scale: config.scale,
                direction: config.direction,
                flux: rig.state().flux_linkages(),
            };
            self.take(t_s, &period.motion, Some(control));
        }
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        if let Some((summary, begun_s)) = &mut self.measured {
            summary.pass(t_s - *begun_s, passage);
        }
        if let Some(viewers) = self.look.unknown() {
            self.seen.push((viewers, None));
        }
        self.take(t_s, &passage.motion, None);
    }
}

/// The taps of all ESCs.
pub(super) struct Taps {
    each: Vec<Tap>,
    /// The ESC whose periods follow.
    esc: usize,
}

impl Taps {
    /// Creates one for each of this many ESCs.
    pub(super) fn new(rings: &Arc<Rings>, escs: usize) -> Self {
        let each = (0..escs).map(|esc| Tap::new(Arc::clone(rings), esc));
        Self {
            each: each.collect(),
            esc: 0,
        }
    }

    /// Calls [`Tap::look`] of one.
    pub(super) fn look(&mut self, esc: usize, throttle: f64) {
        self.each[esc].look(throttle);
    }

    /// Measures what is played on an ESC from `begun_s` on.
    pub(super) fn measure(&mut self, esc: usize, summary: Summary, begun_s: f64) {
        self.each[esc].measured = Some((summary, begun_s));
    }

    /// Takes what was measured.
    pub(super) fn measured(&mut self, esc: usize) -> Option<Summary> {
        self.each[esc].measured.take().map(|(summary, _)| summary)
    }

    /// Requests a PWM period of an ESC for a viewer.
    pub(super) fn ask(&mut self, esc: usize, viewer: ViewerId) {
        self.each[esc].look.ask(viewer);
    }

    /// Takes the requested periods, with their requesters.
    pub(super) fn seen(&mut self, esc: usize) -> Vec<(Vec<ViewerId>, Option<Switching>)> {
        std::mem::take(&mut self.each[esc].seen)
    }
}

/// An onlooker and the taps, if there are any.
pub struct Tapped<'a, O> {
    pub(super) onlooker: &'a mut O,
    pub(super) taps: Option<&'a mut Taps>,
}

impl<O: Onlooker> Onlooker for Tapped<'_, O> {
    fn esc(&mut self, esc: usize) {
        self.onlooker.esc(esc);
        if let Some(taps) = &mut self.taps {
            taps.esc = esc;
        }
    }

    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.onlooker.period(t_s, period, rig);
        if let Some(taps) = &mut self.taps {
            taps.each[taps.esc].period(t_s, period, rig);
        }
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.onlooker.passage(t_s, passage);
        if let Some(taps) = &mut self.taps {
            taps.each[taps.esc].passage(t_s, passage);
        }
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        self.onlooker.gates(time_ns, leg, gate);
    }

    fn tasks(&mut self, telemetry: &Telemetry) {
        self.onlooker.tasks(telemetry);
        if let Some(taps) = &mut self.taps
            && let Some((summary, _)) = &mut taps.each[taps.esc].measured
        {
            summary.told(telemetry);
        }
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.onlooker.edge(time_ns, level);
    }

    fn answer(&mut self, asked_ns: u64, datagram: &[u8]) {
        self.onlooker.answer(asked_ns, datagram);
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.onlooker.frame(time_ns, frame);
    }
}
