//! Selects the current loop's parts: the default observer and regulator compile into dedicated code, the
//! configuration selects any others at each call.

use super::any::any;
use super::current_loop::{current_loop, imposed, observed};
use super::state::State;
use crate::control::delay::Delay;
use crate::control::observer::{self, compensated};
use crate::control::regulator::{self, synchronous};
use crate::control::transform::{AlphaBeta, clarke_in};
use crate::drive::config::Config;
use crate::drive::io::{Bridge, Sample};
use crate::drive::schedule;
use crate::drive::shared::Shared;
use crate::units::{AdcCounts, Current};

/// Runs a period of Park, Ramp, Run or Stopping. The default observer and regulator have dedicated code; all others
/// share one path.
#[inline(always)] // in each period
pub(in crate::drive) fn period(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    currents: [AdcCounts; 3],
) -> Bridge {
    let stator = clarke_in(foc.loops.phase_order, currents);
    match (&config.observer, &config.regulator) {
        (observer::Config::Compensated(observer), regulator::Config::Synchronous(regulator))
            if config.delay == Delay::One && config.adapt_l.is_none() =>
        {
            if schedule::is_start(foc.loops.slot) {
                return start(observer, regulator, config, foc, shared, sample, stator);
            }
            let frame = observed(observer, Delay::One, foc, shared, sample, stator);
            current_loop(observer, regulator, config, foc, shared, frame, stator)
        }
        _ => any(config, foc, shared, sample, stator),
    }
}

/// Runs a period of an open-loop start with the default parts.
#[inline(never)] // only a start
fn start(
    observer: &compensated::Config,
    regulator: &synchronous::Config,
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Bridge {
    let frame = imposed(observer, Delay::One, foc, shared, sample, stator);
    current_loop(observer, regulator, config, foc, shared, frame, stator)
}
