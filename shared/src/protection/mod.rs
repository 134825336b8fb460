//! Protection: faults that turn the bridge off, and current bounds that make that unnecessary.

mod condition;
mod ntc;

pub use condition::{Condition, Fault, Faults, Limit, Limits, Raised};
pub use ntc::Ntc;

use crate::control::speed::Bounds;
use crate::control::transform::Dq;
use siskin_units::math::{Gain, Held, Multiplier, magnitude};
use siskin_units::{AdcCounts, Current, Voltage, traced};

/// Periods by which the supply voltage is extrapolated: 8 for the filter's lag, 16 until a bound is updated
/// again, and 24 for the current to follow, three time constants of a current loop with a 48th of the PWM's frequency.
const AHEAD_PERIODS: i32 = 48;

/// log2 of how much more slowly a sagging supply moves the bound of i_q than `LIM_BUS_A` does. There the voltage closes a
/// second loop around the bound, whose gain is the source's resistance times [`Config::bus_draw_slope`]: 6 where the
/// full current takes 35 % of the supply's voltage.
const SAG_SHIFT: u32 = 3;

/// Consecutive samples above the trip level that count as over-current; a single disturbed reading does not.
const OVER_CURRENT_SAMPLES: u8 = 2;

/// Thresholds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Trip level of a phase current reading: 1.4 times `LIM_PHASE_A`. After that limit was lowered,
    /// [`State::trip`] is the level in force.
    pub trip: AdcCounts,
    /// Smallest supply voltage.
    pub bus_min: Voltage,
    /// Largest supply voltage.
    pub bus_max: Voltage,
    /// Bound on i_q, `LIM_PHASE_A`.
    pub phase: Current,
    /// Bound on the current from the supply, `LIM_BUS_A`.
    pub bus_draw: Current,
    /// Supply voltage below which less is drawn.
    pub bus_draw_v: Voltage,
    /// Supply voltage at which nothing more is drawn.
    pub bus_empty_v: Voltage,
    /// From volts above that to the current that may be drawn.
    pub bus_draw_slope: Gain<Voltage, Current>,
    /// Bound on the current into the supply, `LIM_REGEN_A`.
    pub bus_return: Current,
    /// Supply voltage above which less is returned.
    pub bus_return_v: Voltage,
    /// From volts above that to the reduction of the returned current.
    pub bus_return_slope: Gain<Voltage, Current>,
    /// From volts above that to i_d, which burns the power that would raise the voltage.
    pub burn_slope: Gain<Voltage, Current>,
    /// From the bus current's excess to the change of the bound per period.
    pub bound_rate: Multiplier<Current, Current>,
}

traced! {
    /// State from sample to sample.
    #[derive(Clone, Debug, PartialEq)]
    pub struct State {
        /// Trip level in force: [`Config::trip`], or that of the previous limit until the current has come down to
        /// a lowered one, or a drive or a tone begins.
        pub trip: AdcCounts,
        /// Consecutive samples above the trip level.
        pub over_current_samples: u8,
        /// Supply voltage after a low-pass.
        pub bus: Voltage,
        /// Rise of that voltage in the last period.
        pub rise: Voltage,
        /// Bounds of i_q*, moved by the supply's current in either direction.
        pub bounds: Bounds,
    }
}

impl State {
    /// Creates the power-up state: full bounds, and mid-range supply until there are samples.
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

/// Filters a sample's supply voltage and checks for a reason to turn the bridge off.
///
/// `currents` is `None` if the bridge is off and the readings show no current.
#[inline(always)] // in each period
pub fn check(
    config: &Config,
    state: &mut State,
    currents: Option<[AdcCounts; 3]>,
    bus: Voltage,
) -> Option<Fault> {
    // An eighth of the difference per period, so that a single bad reading has little effect.
    // Both are from 0 to 8 and the type covers ±8: nothing wraps.
    state.rise = bus.wrapping_sub(state.bus) >> 3;
    state.bus = state.bus.wrapping_add(state.rise);

    if currents.is_some_and(|currents| exceeds_trip(state.trip, currents)) {
        state.over_current_samples = state.over_current_samples.saturating_add(1);
        if state.over_current_samples >= OVER_CURRENT_SAMPLES {
            return Some(Fault::OverCurrent);
        }
    } else if state.over_current_samples != 0 {
        state.over_current_samples = 0;
    }
    // Below the minimum wraps around to above the maximum: one comparison.
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
fn exceeds_trip(trip: AdcCounts, currents: [AdcCounts; 3]) -> bool {
    let trip = trip.to_bits();
    // Below −trip wraps around to above 2·trip: one comparison per phase.
    let exceeds =
        |current: AdcCounts| current.to_bits().wrapping_add(trip) as u32 > 2 * trip as u32;
    let [a, b, c] = currents;
    exceeds(a) || exceeds(b) || exceeds(c)
}

/// Makes the trip follow `LIM_PHASE_A`: at once if raised; if lowered, when the current vector `i` is down to
/// within a quarter above it. Otherwise lowering the limit would itself trip.
pub fn follow_limit(config: &Config, state: &mut State, i: Dq<Current>) {
    if state.trip == config.trip {
        return;
    }
    let down = magnitude(i.d, i.q) <= config.phase.plus(config.phase / 4);
    if down || state.trip < config.trip {
        state.trip = config.trip;
    }
}

/// Returns `i_d`, or a larger one that burns more of the supply's power as its voltage nears the limit: no bound on
/// i_q and no current measurement is exact enough for a supply that sinks no current at all.
#[inline(always)] // a comparison, in the longest period of the control
pub fn burning_i_d(config: &Config, state: &State, i_d: Current) -> Current {
    if state.bus <= config.bus_return_v {
        i_d
    } else {
        burning_current(config, state).max(i_d)
    }
}

#[cold]
#[inline(never)] // rare, so not part of the longest period
fn burning_current(config: &Config, state: &State) -> Current {
    let above = state.bus.minus(config.bus_return_v);
    config.burn_slope.held(above)
}

/// Moves the bounds of i_q, every `periods` periods, so that the supply delivers at most `bus_draw` and sinks at
/// most `bus_return`, each of them less as its voltage nears the limit on that side.
///
/// A source that sags does so as fast as the current grows, in a few milliseconds. Where it would soon deliver too much
/// for its voltage, the current therefore grows no further; from there the bound moves as slowly as the loop through
/// the source's resistance needs.
///
/// A supply that no longer sinks current rises by volts per millisecond. The bound therefore uses the extrapolated
/// voltage; where that exceeds the limit, return stops at once.
///
/// Braking begins at a bound that returns no more than allowed at any speed, and only then follows the measured
/// return. Starting from the full bound would return too much for some milliseconds.
pub fn bound(
    config: &Config,
    state: &mut State,
    (bus_current, i_q): (Current, Current),
    periods: u32,
) {
    let ahead = state.bus.plus(state.rise.saturating_mul_int(AHEAD_PERIODS));
    let may_return = may_return(config, ahead);
    let too_much_drawn = if ahead.min(state.bus) >= config.bus_draw_v {
        bus_current.minus(config.bus_draw)
    } else {
        too_much_for_sag(config, state, ahead, (bus_current, i_q))
    };
    let bounds = &mut state.bounds;
    if too_much_drawn.is_positive() || bounds.max != config.phase {
        let lowered = bounds.max.minus(change(config, too_much_drawn, periods));
        bounds.max = lowered.min(config.phase).max(Current::ZERO);
    }
    let raised = if may_return.is_negative() {
        Current::ZERO
    } else if i_q.is_negative() {
        let too_much_returned = bus_current.saturating_neg().minus(may_return);
        // Until the current has reached the bound, nothing shows that more is available.
        let arrived = i_q < bounds.min - (bounds.min >> 3);
        if arrived || too_much_returned.is_positive() {
            bounds.min.plus(change(config, too_much_returned, periods))
        } else {
            bounds.min
        }
    } else {
        // The bus current is at most 1.5/√3 of i_q, at full modulation: 1 + 1/8 + 1/32 approximates 2/√3.
        may_return
            .plus((may_return >> 3) + (may_return >> 5))
            .saturating_neg()
    };
    bounds.min = raised.max(-config.phase).min(Current::ZERO);
}

/// Bounds the current of a supply that sags to the present one, if it is too much for the voltage `ahead`; returns by how
/// much the drawn current is too much for the present voltage, as far as the bound is to follow it.
#[cold]
#[inline(never)] // rare, so not part of the longest period
fn too_much_for_sag(
    config: &Config,
    state: &mut State,
    ahead: Voltage,
    (bus_current, i_q): (Current, Current),
) -> Current {
    let bounds = &mut state.bounds;
    if bus_current > may_draw(config, ahead) {
        bounds.max = bounds.max.min(i_q.max(Current::ZERO));
    }
    let too_much = bus_current.minus(may_draw(config, state.bus)) >> SAG_SHIFT;
    too_much.max(bus_current.minus(config.bus_draw))
}

/// Returns the change of a bound in `periods` for a bus current that exceeds its own bound by this.
fn change(config: &Config, excess: Current, periods: u32) -> Current {
    let change: Current = config.bound_rate.of(excess);
    change.saturating_mul_int(periods as i32)
}

/// Returns the current that the supply may deliver at this voltage; negative near the lower limit.
#[inline(never)] // two callers
fn may_draw(config: &Config, bus: Voltage) -> Current {
    config.bus_draw_slope.held(bus.minus(config.bus_empty_v))
}

/// Returns the current that the supply may sink at its extrapolated voltage; negative beyond the limit.
fn may_return(config: &Config, ahead: Voltage) -> Current {
    let above = ahead.minus(config.bus_return_v);
    if above.is_positive() {
        let less = config.bus_return_slope.held(above);
        config.bus_return.minus(less)
    } else {
        config.bus_return
    }
}
