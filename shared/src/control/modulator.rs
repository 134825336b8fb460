//! Modulation: from a voltage vector to three duties by space vector or sine, with a minimum low-side on-time
//! and dead-time compensation.

use crate::control::dead_time::Share;
use fixed::types::extra::U20;
use fixed::types::{I0F32, I1F31, I8F24};
use siskin_params::{Shunts, parts};
use siskin_units::dimension::Volt;
use siskin_units::math::{Held, Multiplier, Quantity, Real, SQRT_3, TopProduct, TopSum, other_leg};
use siskin_units::{
    Duty, InverseVoltage, Speed, TurnedVoltage, Voltage, VoltageSquare, WideVoltage,
    WideVoltageSquare, traced, wide,
};

use super::dead_time;
use super::transform::{AlphaBeta, Dq, PhaseOrder, phases_in};

/// The choice of common-mode voltage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Modulation {
    /// Midway between the highest and the lowest phase: full line-to-line voltage.
    SpaceVector,
    /// Half the supply: 15 % less voltage, and less harmonic content in the common mode.
    Sine(parts::Sine),
}

/// How far vectors may go beyond those that all phases can switch.
#[derive(Clone, Debug, PartialEq)]
pub struct Overmodulation {
    /// Largest length of the voltage vector, as a share of the supply. The hexagon cuts it.
    pub vector_max: I1F31,
    /// Speed from which vectors may be that long: a driver whose phase stays high loses its supply slowly.
    pub from: Speed,
    /// Share of the supply that the highest phase has; zero without overmodulation.
    pub(super) highest: I1F31,
    /// Its duty.
    pub(super) full: Duty,
    /// Largest duty of the others, so that both can be read.
    pub(super) second: I1F31,
}

impl Default for Overmodulation {
    /// None.
    fn default() -> Self {
        Self {
            vector_max: I1F31::ZERO,
            from: Speed::MAX,
            highest: I1F31::ZERO,
            full: Duty::ZERO,
            second: I1F31::ZERO,
        }
    }
}

/// Longest vector over the highest phase's share: to the hexagon's corners. It leaves a fundamental of 0.609, where a
/// six-step's is 0.637; a longer one has more of the harmonics that the current regulator counters, and turned no bench's
/// motor faster.
const LONGEST: f32 = 2.0 / 3.0;

/// The modulator's limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// All ones where the common mode follows the phases, else zero.
    centred: I1F31,
    /// Largest duty of a phase that switches; the remainder is the low-side on-time that reading the shunts and supplying
    /// the high side's driver take.
    pub duty_max: I1F31,
    /// Largest length of the voltage vector while every phase switches, as a share of the supply.
    pub vector_max: I1F31,
    /// Length up to which every phase can be read, as a share of the supply; negative if there is none.
    pub readable: I1F31,
    /// Length up to which the duties make every vector, as a share of the supply.
    pub linear: I1F31,
    /// How far beyond.
    pub over: Overmodulation,
}

impl Config {
    /// Creates the modulator with a largest duty. A phase can be read up to the duty `window`, at most the largest, all of
    /// them while the vector is short enough.
    pub fn new(modulation: Modulation, duty_max: f32, window: f32) -> Self {
        let (longest, readable, centred): (f32, f32, i32) = match modulation {
            // The highest phase is at half the largest duty plus at most √3/2 of the vector.
            Modulation::SpaceVector => (1.0 / SQRT_3, (2.0 * window - duty_max) / SQRT_3, -1),
            Modulation::Sine(_) => (0.5, window - 0.5 * duty_max, 0),
        };
        Self {
            centred: I1F31::from_bits(centred),
            duty_max: I1F31::from_f32(duty_max),
            vector_max: I1F31::from_f32(longest * duty_max),
            readable: I1F31::from_f32(readable),
            linear: I1F31::from_f32(longest * duty_max),
            over: Overmodulation {
                vector_max: I1F31::from_f32(longest * duty_max),
                ..Overmodulation::default()
            },
        }
    }

    /// Returns this modulator with overmodulation from a speed on. With three shunts the highest phase need not switch
    /// while the others can be read, up to the duty `window`; with two it keeps the largest duty.
    #[must_use]
    pub fn overmodulating(mut self, shunts: Shunts, window: f32, from: Speed) -> Self {
        let (highest, full) = match shunts {
            // More than the period.
            Shunts::Three => (I1F31::MAX, Duty::MAX),
            Shunts::Two => (self.duty_max, whole_duty(self.duty_max)),
        };
        let share = highest.to_f32();
        self.linear = I1F31::from_f32(share / SQRT_3);
        self.over = Overmodulation {
            vector_max: I1F31::from_f32(LONGEST * share),
            from,
            highest,
            full,
            second: self.duty_max.min(I1F31::from_f32(window)),
        };
        self
    }

    /// Returns the half of the range plus half of the middle phase: the duty of a phase without voltage.
    #[inline(always)] // in each period
    pub(super) fn common(&self, [a, b, c]: [Share; 3]) -> I1F31 {
        // Without the common mode the phases sum to zero, so highest plus lowest is minus the middle phase.
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        let middle = c.max(low).min(high);
        let half: I1F31 = whole(middle) >> 1;
        (self.duty_max >> 1) + (half & self.centred)
    }
}

traced! {
    /// The supply and its reciprocal, updated every few periods.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Supply {
        /// Supply voltage.
        pub bus: Voltage,
        /// 1/V with 28 fraction bits, saturating at 8.
        pub reciprocal: InverseVoltage,
        /// Length up to which every phase switches: the scale of the throttle in voltage mode.
        pub switched: Voltage,
        /// Longest available voltage vector.
        pub longest: VectorLimit,
        /// Square of the length up to which every phase can be read.
        pub readable_square: WideVoltageSquare,
    }
}

traced! {
    /// The longest available voltage vector, and its q component linearised around a d component.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct VectorLimit {
        length: Voltage,
        square: WideVoltageSquare,
        /// Square of that d component.
        d_square: VoltageSquare,
        /// Largest q component beside it.
        q: WideVoltage,
        /// Loss of q per change of d's square, 1/(2·q).
        slope: Multiplier<VoltageSquare, Quantity<Volt, U20>>,
    }
}

impl VectorLimit {
    /// No vector at all.
    const NONE: Self = Self {
        length: Voltage::ZERO,
        square: WideVoltageSquare::ZERO,
        d_square: VoltageSquare::ZERO,
        q: WideVoltage::ZERO,
        slope: Multiplier::from_bits(0),
    };

    /// Creates one of this length, linearised around this d component.
    pub fn new(length: Voltage, d: Voltage) -> Self {
        let d = d.min(length).max(-length);
        let q = other_leg(length, d);
        // 2^55 over q's bits; the floor is a sixteenth, below which there is little left to lose.
        let q_upper = (q.to_bits() >> 16).max(257) as u32;
        Self {
            length,
            square: square(wide(length)),
            d_square: d.top(d),
            q: wide(q),
            slope: Multiplier::from_bits((((1 << 31) / q_upper) << 8) as i32),
        }
    }

    /// Returns the length.
    pub fn length(self) -> Voltage {
        self.length
    }

    /// Returns the largest q component beside this d component.
    #[inline(always)] // in each period
    pub(super) fn q_max_beside(&self, d: Voltage) -> WideVoltage {
        // Both squares are below 12, the slope below 8.
        let less = self.slope.of(d.top(d) - self.d_square).scaled();
        (self.q - less).max(WideVoltage::ZERO)
    }
}

impl Supply {
    /// Creates the supply at this voltage, for commands with a d component near `d`.
    pub fn new(config: &Config, bus: Voltage, d: Voltage) -> Self {
        let mut supply = Self {
            bus,
            reciprocal: InverseVoltage::ZERO,
            switched: Voltage::ZERO,
            longest: VectorLimit::NONE,
            readable_square: WideVoltageSquare::ZERO,
        };
        supply.set_bus(bus);
        supply.update_limits(config, d);
        supply
    }

    /// Updates the voltage; [`update_limits`](Self::update_limits) updates the lengths it allows.
    #[inline(never)] // only some periods
    pub fn set_bus(&mut self, bus: Voltage) {
        // 2^56/bus: a 32-bit division by the voltage's upper bits, accurate to 2^-11 at worst, and one Newton
        // step. A bus below 1/8 unit counts as 1/8, which bounds the reciprocal.
        let bits = bus.to_bits().max(1 << 25);
        let rough = ((u32::MAX / (bits >> 10) as u32) << 14).min(i32::MAX as u32);
        let rough = InverseVoltage::from_bits(rough as i32);
        let product = i64::from(bits) * i64::from(rough.to_bits());
        let error = I0F32::from_bits((((1 << 56) - product) >> 24) as i32);
        self.bus = bus;
        self.reciprocal = rough.plus(rough.top(error));
    }

    /// Updates the lengths a vector may have, for commands with a d component near `d`.
    #[inline(never)] // only some periods
    pub fn update_limits(&mut self, config: &Config, d: Voltage) {
        self.limit_to(config, config.vector_max, d);
    }

    /// The same, where the rotor's speed lets vectors be longer.
    #[inline(never)] // only some periods
    pub fn update_limits_at(&mut self, config: &Config, d: Voltage, speed: Speed) {
        let over = &config.over;
        let longest = if speed < over.from {
            config.vector_max
        } else {
            over.vector_max
        };
        self.limit_to(config, longest, d);
    }

    fn limit_to(&mut self, config: &Config, longest: I1F31, d: Voltage) {
        self.longest = VectorLimit::new(longest.top(self.bus).scaled(), d);
        self.switched = config.vector_max.top(self.bus).scaled();
        self.readable_square = if config.readable.is_negative() {
            -WideVoltageSquare::DELTA
        } else {
            square(config.readable.top(wide(self.bus)).scaled())
        };
    }

    /// Limits vectors as if the supply were at most this, until [`update_limits`](Self::update_limits) is called.
    pub fn limit_as_from(&mut self, config: &Config, bus: Voltage) {
        let present = self.bus;
        self.bus = present.min(bus);
        self.update_limits(config, Voltage::ZERO);
        self.bus = present;
    }
}

/// The d component leaves 2^-this of the length.
const D_RESERVE: u32 = 4;

/// A limited vector's square may exceed the limit by 2^-this: 0.05 % of its length.
const TOO_LONG: u32 = 10;

/// Shortens a voltage vector to what the supply allows. Keeps the d component, which cancels what current and speed
/// induce, up to 15/16 of the length. With all of the length in d nothing would regulate i_q, which would stay beyond
/// its bound: ω·L·i_q is then what the d component cancels.
///
/// Returns the vector, and the part cut off if it was shortened.
#[inline(always)] // in each period
pub fn limit(u: Dq<WideVoltage>, longest: &VectorLimit) -> (Dq<Voltage>, Option<Dq<WideVoltage>>) {
    if square_of(u) <= longest.square {
        return (short(u), None);
    }
    let most = wide(longest.length - (longest.length >> D_RESERVE));
    let d = u.d.min(most).max(-most);
    let narrow_d = d.scaled();
    let mut q_max = longest.q_max_beside(narrow_d);
    // Far from its operating point the linearisation is too generous, never too strict.
    if square_of(Dq { d, q: q_max }) > longest.square + (longest.square >> TOO_LONG) {
        q_max = wide(other_leg(longest.length, narrow_d));
    }
    let q = u.q.min(q_max).max(-q_max);
    let cut = Dq {
        d: u.d.wrapping_sub(d),
        q: u.q.wrapping_sub(q),
    };
    (short(Dq { d, q }), Some(cut))
}

/// Returns the square of a vector's length. No component exceeds 128, so the sum is below 2^15.
#[inline(always)] // in each period
pub fn square_of(u: Dq<WideVoltage>) -> WideVoltageSquare {
    square(u.d).plus_top(u.q, u.q)
}

#[inline(always)] // in each period
fn square(u: WideVoltage) -> WideVoltageSquare {
    u.top(u)
}

/// Narrows a vector that is known to be within ±8.
#[inline(always)] // in each period
pub fn short(u: Dq<WideVoltage>) -> Dq<Voltage> {
    Dq {
        d: u.d.scaled(),
        q: u.q.scaled(),
    }
}

/// A voltage vector as phases, each as a share of the supply.
pub struct Phases {
    /// What each phase has above their mean.
    pub(super) shares: [Share; 3],
    /// The same, and what the dead time takes away: `dead_time` times the certainty of the phase current's sign.
    pub(super) compensated: [Share; 3],
}

impl Phases {
    /// Returns the phases of a vector.
    #[inline(always)] // in each period
    pub fn new(
        supply: &Supply,
        v: AlphaBeta<TurnedVoltage>,
        order: PhaseOrder,
        dead_time: &dead_time::Config,
        certainty: AlphaBeta<I8F24>,
    ) -> Self {
        let share: AlphaBeta<Share> = AlphaBeta {
            alpha: v.alpha.top(supply.reciprocal),
            beta: v.beta.top(supply.reciprocal),
        };
        let shares @ [a, b, c] = phases_in(order, share);
        let [ca, cb, cc] = phases_in(order, certainty);
        Self {
            shares,
            // Not by `map` or a closure, which become a loop or calls in a build optimised for size.
            compensated: [
                dead_time.compensated(a, ca),
                dead_time.compensated(b, cb),
                dead_time.compensated(c, cc),
            ],
        }
    }
}

/// Returns the three duties of a voltage vector within which every phase can be read, with what the dead time takes away.
#[inline(always)] // in each period
pub fn duties(config: &Config, phases: &Phases) -> [Duty; 3] {
    let common = config.common(phases.shares);
    let [a, b, c] = phases.compensated;
    [duty(common, a), duty(common, b), duty(common, c)]
}

/// Returns the three duties of a vector that makes every phase switch, without compensation of the dead time: at
/// standstill.
#[inline(always)] // as a call it costs 48 bytes more on the chip
pub fn uncompensated(config: &Config, supply: &Supply, v: AlphaBeta<TurnedVoltage>) -> [Duty; 3] {
    let (order, none) = (PhaseOrder::NORMAL, &dead_time::Config::NONE);
    let phases = Phases::new(supply, v, order, none, AlphaBeta::default());
    duties(config, &phases)
}

/// Returns a phase's duty, which is below 1.
#[inline(always)] // in each period
fn duty(common: I1F31, share: Share) -> Duty {
    whole_duty(common.wrapping_add(whole(share)).max(I1F31::ZERO))
}

/// Returns a share that is not negative as a duty.
#[inline(always)] // in each period
pub fn whole_duty(share: I1F31) -> Duty {
    Duty::from_bits(share.to_bits() as u32)
}

/// Converts the share to a duty: no phase of a vector has more than 3/4 of the supply.
#[inline(always)] // in each period
pub(super) fn whole(share: Share) -> I1F31 {
    I1F31::from_bits(share.to_bits() << 9)
}

#[cfg(test)]
mod tests;
