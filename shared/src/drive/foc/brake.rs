//! Brake: all low sides are on, and the observer keeps running.

use siskin_units::{AdcCounts, Current, Speed};

use super::current_loop::input;
use super::outer_loop::{self, PREPARATION_PIECES};
use super::state::State;
use crate::control::transform::{AlphaBeta, Dq, clarke_in, park};
use crate::drive::config::Config;
use crate::drive::io::Sample;
use crate::drive::phase::Phase;
use crate::drive::schedule::{CYCLE, Slot};
use crate::drive::seen::Seen;
use crate::drive::shared::Shared;

/// Slots between two pieces of preparation.
const PREPARATION_SLOTS: u32 = 4;

/// Returns true if the rotor turns and the observer knows how: something drives it against the short circuit.
pub(in crate::drive) fn knows(config: &Config, foc: &State, shared: &Shared) -> bool {
    let lost = config.observer.follows_park() || foc.observer.slow_estimate.lost;
    shared.seen.speed != Speed::ZERO && !lost
}

/// Runs the observer on. With the low sides on the voltage is known to be zero, so the speed can be
/// reported until the back-EMF drowns in noise.
#[inline(never)] // only some periods
pub(in crate::drive) fn watch(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    currents: [AdcCounts; 3],
) {
    let loops = &mut foc.loops;
    loops.slot = (loops.slot + 1) % CYCLE as Slot;
    let stator = clarke_in(loops.phase_order, currents);
    loops.commanded_voltages = [AlphaBeta::default(), loops.commanded_voltages[0]];
    let input = input(loops, config.delay, sample, stator);
    let observer = &config.observer;
    let estimate = observer.estimate(&mut foc.observer, &input, None);
    let i = park(stator, estimate.frame);
    let u = Dq::default();
    let slot = u32::from(foc.loops.slot);
    if slot == 0 {
        outer_loop::observer_gains(config, foc);
    } else if slot.is_multiple_of(PREPARATION_SLOTS)
        && slot <= PREPARATION_SLOTS * PREPARATION_PIECES
    {
        // A drive may resume at any time.
        outer_loop::prepare(config, foc, shared, slot / PREPARATION_SLOTS);
    }
    let loops = &foc.loops;
    if observer.works_in_frame() {
        let factor = loops.inductance.factor;
        let fb = observer.feedback(&foc.observer, (estimate.omega, i), factor);
        observer.advance(&mut foc.observer, &fb, u);
    }
    // An eighth of the speed at which Run ends: 19 rpm with the defaults.
    let turns = estimate.omega_bar.saturating_abs() > config.slow >> 3;
    shared.seen = Seen {
        phase: Phase::Brake,
        angle: loops.phase_order.angle(estimate.theta),
        speed: if turns {
            estimate.omega_bar
        } else {
            Speed::ZERO
        },
        i,
        u,
        bus_current: Current::ZERO,
    };
}
