//! Turns the bridge off, and bounds the current so that it need not.

mod condition;
mod ntc;

pub use condition::{Condition, Fault, Faults, Limit, Limits, Raised};
pub use ntc::Ntc;

use crate::control::speed::Bounds;
use crate::control::transform::Dq;
use crate::math::{Gain, Held, Multiplier, magnitude};
use crate::trace::traced;
use crate::units::{AdcCounts, Current, Voltage};

/// Periods by which the supply's voltage is looked ahead while the motor brakes: eight that the filter is behind, and
/// as many as it takes until a bound is looked at again and the current has followed.
const AHEAD_PERIODS: i32 = 32;

/// Samples in a row above the trip level that are an over-current, so that one disturbed reading
/// is not.
const OVER_CURRENT_SAMPLES: u8 = 2;

/// Thresholds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Magnitude of a phase's reading that trips: 1.4 times `LIM_PHASE_A`. If that was lowered, the
    /// trip in force is [`State::trip`].
    pub trip: AdcCounts,
    /// Least supply voltage.
    pub bus_min: Voltage,
    /// Greatest supply voltage.
    pub bus_max: Voltage,
    /// Bound of i_q, `LIM_PHASE_A`.
    pub phase: Current,
    /// Bound of the current from the supply, `LIM_BUS_A`.
    pub bus_draw: Current,
    /// Bound of the current to the supply, `LIM_REGEN_A`.
    pub bus_return: Current,
    /// Supply voltage from which less is returned.
    pub bus_return_v: Voltage,
    /// Volts above that to current.
    pub bus_return_slope: Gain<Voltage, Current>,
    /// Volts above that to i_d, which turns into heat what would raise them.
    pub burn_slope: Gain<Voltage, Current>,
    /// Bus current's excess to the bound's change in a period.
    pub bound_rate: Multiplier<Current, Current>,
}

traced! {
    /// State from sample to sample.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// Magnitude of a phase's reading that trips now: [`Config::trip`], or that of the limit before,
        /// until the current has come down to one that was lowered, or a drive or a tone begins.
        pub trip: AdcCounts,
        /// Samples in a row above the trip.
        pub over_current_samples: u8,
        /// Supply voltage behind a low-pass filter.
        pub bus: Voltage,
        /// By how much that has risen in the last period.
        pub rise: Voltage,
        /// Bounds of i_q*, moved by what the supply gives and takes.
        pub bounds: Bounds,
    }
}

impl State {
    /// At power-up: full bounds, and a supply in the middle of its range until there are samples.
    pub fn new(config: &Config) -> Self {
        Self {
            trip: config.trip,
            over_current_samples: 0,
            bus: config.bus_min / 2 + config.bus_max / 2,
            rise: Voltage::ZERO,
            bounds: config.full_bounds(),
        }
    }
}

impl Config {
    fn full_bounds(&self) -> Bounds {
        Bounds {
            min: -self.phase,
            max: self.phase,
        }
    }
}

/// Takes a sample's supply voltage into the filter and looks for a reason to turn the bridge off.
///
/// `currents` is `None` if the readings are those of no current.
#[inline(always)] // in each period
pub fn check(
    config: &Config,
    state: &mut State,
    currents: Option<[AdcCounts; 3]>,
    bus: Voltage,
) -> Option<Fault> {
    // An eighth of the difference a period: one reading that is off moves it by little.
    // Both are from 0 to 8, the type is of ±8: nothing here wraps.
    state.rise = bus.wrapping_sub(state.bus) >> 3;
    state.bus = state.bus.wrapping_add(state.rise);

    if currents.is_some_and(|currents| beyond(state.trip, currents)) {
        state.over_current_samples = state.over_current_samples.saturating_add(1);
        if state.over_current_samples >= OVER_CURRENT_SAMPLES {
            return Some(Fault::OverCurrent);
        }
    } else if state.over_current_samples != 0 {
        state.over_current_samples = 0;
    }
    // Below the least wraps round to above the greatest: one comparison.
    let above = state.bus.wrapping_sub(config.bus_min).to_bits() as u32;
    if above <= config.bus_max.wrapping_sub(config.bus_min).to_bits() as u32 {
        None
    } else if state.bus > config.bus_max {
        Some(Fault::OverVoltage)
    } else {
        Some(Fault::UnderVoltage)
    }
}

/// Returns true if a phase's current is beyond ±`trip`.
fn beyond(trip: AdcCounts, currents: [AdcCounts; 3]) -> bool {
    let trip = trip.to_bits();
    // Below −trip wraps round to above 2·trip: one comparison a phase.
    let far = |current: AdcCounts| current.to_bits().wrapping_add(trip) as u32 > 2 * trip as u32;
    let [a, b, c] = currents;
    far(a) || far(b) || far(c)
}

/// Lets the trip follow `LIM_PHASE_A`: at once if that was raised, and if it was lowered when
/// the current vector `i` has come down to within a quarter above it. Else to lower a limit would be a
/// reason to trip.
pub fn follow_limit(config: &Config, state: &mut State, i: Dq<Current>) {
    if state.trip == config.trip {
        return;
    }
    let down = magnitude(i.d, i.q) <= config.phase.plus(config.phase / 4);
    if down || state.trip < config.trip {
        state.trip = config.trip;
    }
}

/// `i_d`, or what turns more of the supply's power into heat, as its voltage nears the limit: no bound of i_q,
/// and no current that is measured, is exact enough for a supply that takes nothing at all.
#[inline(always)] // a comparison, in the longest period of the control
pub fn burn(config: &Config, state: &State, i_d: Current) -> Current {
    if state.bus <= config.bus_return_v {
        i_d
    } else {
        burnt(config, state).max(i_d)
    }
}

#[cold]
#[inline(never)] // what is rare is no part of the longest period
fn burnt(config: &Config, state: &State) -> Current {
    let above = state.bus.minus(config.bus_return_v);
    config.burn_slope.saturating_apply(above)
}

/// Moves the bounds of i_q, after so many `periods`, so that the supply gives no more than `bus_draw`
/// and takes no more than `bus_return`, and less of that as its voltage nears the limit.
///
/// A supply that takes nothing back any more rises by volts a millisecond: what it comes to if it goes on so counts as its
/// voltage, and where that is beyond the limit nothing is returned at once.
///
/// Braking begins at a bound that returns no more than that at any speed; only then is it moved by
/// what is returned. From the full bound it would return too much for some milliseconds.
pub fn bound(
    config: &Config,
    state: &mut State,
    (bus_current, i_q): (Current, Current),
    periods: u32,
) {
    let rate = |excess| {
        let change: Current = config.bound_rate.of(excess);
        change.saturating_mul_int(periods as i32)
    };
    let bounds = &mut state.bounds;
    let too_much_drawn = bus_current.minus(config.bus_draw);
    if too_much_drawn.is_positive() || bounds.max != config.phase {
        let lowered = bounds.max.minus(rate(too_much_drawn));
        bounds.max = lowered.min(config.phase).max(Current::ZERO);
    }
    let ahead = state.bus.plus(state.rise.saturating_mul_int(AHEAD_PERIODS));
    let above = ahead.minus(config.bus_return_v);
    let may_return = if above.is_positive() {
        let less = config.bus_return_slope.saturating_apply(above);
        config.bus_return.minus(less)
    } else {
        config.bus_return
    };
    let min = bounds.min;
    let raised = if may_return.is_negative() {
        Current::ZERO
    } else if i_q.is_negative() {
        let too_much_returned = bus_current.saturating_neg().minus(may_return);
        // While the current is on its way to the bound there is nothing to say that more may be had.
        let arrived = i_q < min - (min >> 3);
        if arrived || too_much_returned.is_positive() {
            min.plus(rate(too_much_returned))
        } else {
            min
        }
    } else {
        // The bus current is at most 1.5/√3 of i_q, at full modulation: 1 + 1/8 + 1/32 is 2/√3.
        let most = may_return.max(Current::ZERO);
        most.plus((most >> 3) + (most >> 5)).saturating_neg()
    };
    bounds.min = raised.max(-config.phase).min(Current::ZERO);
}
