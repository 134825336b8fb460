//! Time, counted in cycles of the chip's 170 MHz.

/// Cycles since power-up. While the processor runs slower, one of its own is several of these.
pub type Cycles = u64;

/// Cycles per second.
pub const CLOCK_HZ: u64 = 170_000_000;

/// A time that never comes.
pub const NEVER: Cycles = Cycles::MAX;

/// Converts ns to cycles, rounded up.
pub fn of_ns(time_ns: u64) -> Cycles {
    (u128::from(time_ns) * u128::from(CLOCK_HZ)).div_ceil(1_000_000_000) as Cycles
}

/// Converts cycles to ns, rounded down.
pub fn ns(cycles: Cycles) -> u64 {
    (u128::from(cycles) * 1_000_000_000 / u128::from(CLOCK_HZ)) as u64
}

/// Converts cycles to s.
pub fn seconds(cycles: Cycles) -> f64 {
    cycles as f64 / CLOCK_HZ as f64
}
