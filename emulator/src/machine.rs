//! What runs on the bench: an ESC in any form, as seen by the links, the clock and onlookers.

use siskin_control::telemetry::Telemetry;
use thiserror::Error;

use crate::fault::Fault;
use crate::link::LinkId;
use crate::plant::Gate;
use crate::rig::{Bench, Period, Rig};
use crate::summary::Rejected;
use crate::surroundings::Passage;
use crate::wire::Wire;

/// An ESC with its surroundings.
pub trait Machine {
    /// Returns the simulated time since the start, ns.
    fn now_ns(&self) -> u64;

    /// Returns true if it has something left to do until this time.
    fn is_before(&self, until_ns: u64) -> bool;

    /// Returns the number of ESCs: the methods below count them from 0.
    fn escs(&self) -> usize {
        1
    }

    /// Returns the throttle wire of an ESC, to be polled or played.
    fn wire(&mut self, esc: usize) -> &mut Wire;

    /// Takes bytes received on a MAVLink stream.
    fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker);

    /// Forgets a MAVLink stream that has ended.
    fn forget(&mut self, stream: LinkId);

    /// Runs until `until_ns`; `send` receives every MAVLink frame.
    ///
    /// # Errors
    /// It cannot go on.
    fn advance(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Stopped>;

    /// Injects a fault that acts from its time on, replacing one of its kind.
    ///
    /// # Errors
    /// A line on why nothing can be broken here.
    fn inject(&mut self, esc: usize, fault: Fault) -> Result<(), &'static str>;

    /// Repairs everything that faults have broken so far.
    ///
    /// # Errors
    /// Likewise.
    fn mend(&mut self, esc: usize) -> Result<(), &'static str>;

    /// Replaces the motor and load, at rest, with those of a bench, and the supply too if no other ESC shares it. The
    /// ESC's knowledge of its motor is up to whoever tells it.
    ///
    /// # Errors
    /// A line on why not.
    fn fit(&mut self, esc: usize, bench: &Bench) -> Result<(), &'static str> {
        let _ = (esc, bench);
        Err("another motor cannot be put here")
    }

    /// Returns what was received for an ESC since the start and refused.
    fn rejected(&self, esc: usize) -> Rejected;
}

/// Why a machine cannot start or go on: one line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct Stopped(pub String);

/// Observes a machine as it runs. A closure sees the periods.
pub trait Onlooker {
    /// Says which of several ESCs the following calls are about.
    fn esc(&mut self, esc: usize) {
        let _ = esc;
    }

    /// A control period began at `t_s`, on a machine whose control is accessible.
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig);

    /// A PWM period began at `t_s`, on a machine whose control is not visible.
    fn passage(&mut self, t_s: f64, passage: &Passage) {
        let _ = (t_s, passage);
    }

    /// A leg's gates changed at `time_ns`, in the next reported period of such a machine.
    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        let _ = (time_ns, leg, gate);
    }

    /// After a round of an ESC's tasks: its state as they report it.
    fn tasks(&mut self, telemetry: &Telemetry) {
        let _ = telemetry;
    }

    /// The throttle wire's level changed at `time_ns`, before the next period and after everything earlier.
    fn edge(&mut self, time_ns: u64, level: bool) {
        let _ = (time_ns, level);
    }

    /// The ESC has answered the edges so far with this datagram, on the throttle wire or its serial line; the
    /// requesting frame began at `asked_ns`.
    fn answer(&mut self, asked_ns: u64, datagram: &[u8]) {
        let _ = (asked_ns, datagram);
    }

    /// A whole MAVLink frame was sent, or received and understood.
    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        let _ = (time_ns, frame);
    }
}

impl<F: FnMut(f64, &Period, &Rig)> Onlooker for F {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self(t_s, period, rig);
    }
}
