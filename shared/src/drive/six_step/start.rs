//! The start: Ramp's current, and another attempt if the rotor was not tracked.

use siskin_units::Current;

use super::duty::most;
use super::state::State;
use crate::drive::config::six_step::Config;
use crate::drive::io::Setpoint;
use crate::drive::phase::Phase;
use crate::drive::shared::Shared;
use crate::drive::transitions::Why;
use crate::protection::Fault;

/// Returns the current of Ramp: half more after each failed start, up to the bound.
pub(super) fn current(
    six_step: &Config,
    (s, shared): (&State, &Shared),
    setpoint: &Setpoint,
) -> Current {
    let more = |current: Current, _| current.saturating_add(current / 2);
    let current = (0..shared.failed_starts).fold(six_step.start_current, more);
    let current = current.min(most(s, shared));
    match setpoint {
        Setpoint::Test(_) => current.min(six_step.test_current),
        _ => current,
    }
}

/// Handles loss of synchronism: another start, or none. A motor that is being stopped loses nothing and coasts.
#[cold]
pub(super) fn lost(six_step: &Config, (s, shared): (&State, &mut Shared), phase: Phase) -> Why {
    let starting = phase == Phase::Ramp || s.tracking.omega_bar <= six_step.run_speed;
    if phase == Phase::Stopping {
        Why::Coasts
    } else if starting {
        shared.start_failed()
    } else {
        Why::Tripped(Fault::ObserverLost)
    }
}
