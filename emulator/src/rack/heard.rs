//! Keeps the answers of a rack's ESCs as they pass to an onlooker.

use siskin_control::telemetry::Telemetry;

use crate::machine::Onlooker;
use crate::plant::Gate;
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

/// What an ESC has sent on its throttle wire or its serial line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The ESC, from 0.
    pub esc: usize,
    /// When the answered frame began, ns, by the ESC's timer.
    pub asked_ns: u64,
    /// A throttle-wire datagram.
    pub datagram: Vec<u8>,
}

/// Wraps an onlooker and keeps an ESC's answers.
pub(super) struct Heard<'a, O> {
    pub(super) onlooker: &'a mut O,
    pub(super) answers: &'a mut Vec<Answer>,
    pub(super) esc: usize,
}

impl<O: Onlooker> Onlooker for Heard<'_, O> {
    #[inline(always)] // in each period
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.onlooker.period(t_s, period, rig);
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.onlooker.passage(t_s, passage);
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        self.onlooker.gates(time_ns, leg, gate);
    }

    fn tasks(&mut self, telemetry: &Telemetry) {
        self.onlooker.tasks(telemetry);
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.onlooker.edge(time_ns, level);
    }

    fn answer(&mut self, asked_ns: u64, datagram: &[u8]) {
        self.answers.push(Answer {
            esc: self.esc,
            asked_ns,
            datagram: datagram.to_vec(),
        });
        self.onlooker.answer(asked_ns, datagram);
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.onlooker.frame(time_ns, frame);
    }
}
