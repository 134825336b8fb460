//! A period of field-oriented control.

use siskin_units::{AdcCounts, Current};

use super::current_loop::{current_loop, imposed, observed};
use super::state::State;
use crate::control::transform::{AlphaBeta, clarke_in};
use crate::control::{inductance, observer};
use crate::drive::config::Config;
use crate::drive::io::{Bridge, Sample};
use crate::drive::schedule;
use crate::drive::shared::Shared;

/// Runs a period of Park, Ramp, Run or Stopping.
#[inline(always)] // in each period
pub(in crate::drive) fn period(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    currents: [AdcCounts; 3],
) -> Bridge {
    let stator = clarke_in(foc.loops.phase_order, currents);
    if schedule::is_start(foc.loops.slot) {
        return start(config, foc, shared, sample, stator);
    }
    adapt(config, foc, shared);
    let frame = observed(config, foc, shared, sample, stator);
    current_loop(config, foc, shared, frame, stator)
}

/// Runs a period of an open-loop start.
#[inline(never)] // only a start
fn start(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Bridge {
    let frame = imposed(config, foc, shared, sample, stator);
    current_loop(config, foc, shared, frame, stator)
}

/// Runs the inductance adaptation, if configured: i_d* carries its wave.
#[inline(always)] // in each period
fn adapt(config: &Config, foc: &mut State, shared: &Shared) {
    if let Some(adapt) = &config.adapt_l {
        let flux = observer::flux(&config.observer, &foc.observer);
        let i_d = shared.seen.i.d;
        let wave = inductance::step(adapt, &mut foc.loops.inductance, i_d, flux);
        foc.loops.reference.i.d = foc.loops.i_d_reference + wave;
    }
}
