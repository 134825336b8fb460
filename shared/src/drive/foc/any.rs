//! The current loop with any observer and regulator, including open-loop starts.

use super::current_loop::{Frame, current_loop, imposed, observed};
use super::state::State;
use crate::control::transform::AlphaBeta;
use crate::control::{inductance, observer};
use crate::drive::config::Config;
use crate::drive::io::{Bridge, Sample};
use crate::drive::schedule;
use crate::drive::shared::Shared;
use crate::units::Current;

/// Runs a period with any observer, regulator and delay, and with inductance adaptation if configured.
#[inline(never)] // not the default drive
pub(in crate::drive) fn any(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Bridge {
    let frame = frame(config, foc, shared, sample, stator);
    let (observer, regulator) = (&config.observer, &config.regulator);
    current_loop(observer, regulator, config, foc, shared, frame, stator)
}

/// Returns the frame, imposed by a start or from the observer.
// Not inlined: the two branches would merge values whose width the compiler then forgets, leading to 64-bit
// multiplications.
#[inline(never)]
fn frame(
    config: &Config,
    foc: &mut State,
    shared: &mut Shared,
    sample: &Sample,
    stator: AlphaBeta<Current>,
) -> Frame {
    let (observer, delay) = (&config.observer, config.delay);
    if schedule::is_start(foc.loops.slot) {
        return imposed(observer, delay, foc, shared, sample, stator);
    }
    adapt(config, foc, shared);
    observed(observer, delay, foc, shared, sample, stator)
}

/// Runs the inductance adaptation, if configured: i_d* carries its wave.
fn adapt(config: &Config, foc: &mut State, shared: &Shared) {
    if let Some(adapt) = &config.adapt_l {
        let flux = observer::flux(&config.observer, &foc.observer);
        let i_d = shared.seen.i.d;
        let wave = inductance::step(adapt, &mut foc.loops.inductance, i_d, flux);
        foc.loops.reference.i.d = foc.loops.i_d_reference + wave;
    }
}
