//! What runs on the bench: an ESC in any form, as the links, the clock and those who look on see it.

use siskin_control::drive::Limits;
use thiserror::Error;

use crate::fault::Fault;
use crate::link::LinkId;
use crate::plant::Gate;
use crate::rig::{Bench, Period, Rig};
use crate::summary::Rejected;
use crate::surroundings::Passage;
use crate::wire::Wire;

/// An ESC with all that is around it.
pub trait Machine {
    /// Simulated time since the start, ns.
    fn now_ns(&self) -> u64;

    /// Whether it has something left to do until this time.
    fn is_before(&self, until_ns: u64) -> bool;

    /// How many ESCs there are: what follows counts them from 0.
    fn escs(&self) -> usize {
        1
    }

    /// The throttle wire of an ESC, to be polled or played.
    fn wire(&mut self, esc: usize) -> &mut Wire;

    /// Bytes that came in on a MAVLink stream.
    fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker);

    /// A MAVLink stream that has ended.
    fn forget(&mut self, stream: LinkId);

    /// Runs until `until_ns`; `send` gets every MAVLink frame.
    ///
    /// # Errors
    /// It cannot go on.
    fn advance(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Stopped>;

    /// Lets a fault act from its time on, in place of one of its kind.
    ///
    /// # Errors
    /// A line on why nothing can be broken here.
    fn inject(&mut self, esc: usize, fault: Fault) -> Result<(), &'static str>;

    /// Makes whole again all that faults have broken by now.
    ///
    /// # Errors
    /// Likewise.
    fn mend(&mut self, esc: usize) -> Result<(), &'static str>;

    /// Puts the motor of a bench and its load in place of those that stand there, at rest, and its supply in place of
    /// one that no other ESC shares. What the ESC knows of its motor is left to whoever tells it.
    ///
    /// # Errors
    /// A line on why not.
    fn fit(&mut self, esc: usize, bench: &Bench) -> Result<(), &'static str> {
        let _ = (esc, bench);
        Err("another motor cannot be put here")
    }

    /// What came in for an ESC since the start and was refused.
    fn rejected(&self, esc: usize) -> Rejected;
}

/// Why a machine cannot start or go on: one line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct Stopped(pub String);

/// Who looks on as a machine runs. A closure sees the periods.
pub trait Onlooker {
    /// What follows is of this ESC, of several.
    fn esc(&mut self, esc: usize) {
        let _ = esc;
    }

    /// A control period that began at `t_s`, of a machine whose control is at hand.
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig);

    /// A period of the PWM that began at `t_s`, of a machine whose control nobody sees.
    fn passage(&mut self, t_s: f64, passage: &Passage) {
        let _ = (t_s, passage);
    }

    /// A leg's gates changed at `time_ns`, in the period that is told next, of such a machine.
    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        let _ = (time_ns, leg, gate);
    }

    /// After a round of an ESC's tasks: the limits that bind, and what the motor goes on with.
    fn limits(&mut self, limits: Limits) {
        let _ = limits;
    }

    /// The throttle wire's level changed at `time_ns`, before the next period and after all that
    /// came before.
    fn edge(&mut self, time_ns: u64, level: bool) {
        let _ = (time_ns, level);
    }

    /// The ESC has answered the edges so far on the throttle wire or on its serial line, with this datagram; the
    /// frame that asked for it began at `asked_ns`.
    fn answer(&mut self, asked_ns: u64, datagram: &[u8]) {
        let _ = (asked_ns, datagram);
    }

    /// A whole MAVLink frame was sent, or was received and understood.
    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        let _ = (time_ns, frame);
    }
}

impl<F: FnMut(f64, &Period, &Rig)> Onlooker for F {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self(t_s, period, rig);
    }
}
