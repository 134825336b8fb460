//! Slow protection: transistor temperature. Supply voltage and currents are the control's.

use embassy_time::{Duration, Instant};

use siskin_control::check::{Item, Own, Probe};
use siskin_control::drive::Sample;

use crate::board::{self, NTC, Temperature};
use crate::interrupt::sample::sample;
use crate::interrupt::{self, Registers};

/// Time between two readings: the board's copper takes seconds to warm up.
const EVERY: Duration = Duration::from_millis(10);

/// The readings.
pub(crate) struct Health {
    sensor: Temperature,
    due: Instant,
    temperature_c: f32,
}

impl Health {
    /// Creates it without a reading.
    pub(crate) fn new(sensor: Temperature) -> Self {
        Self {
            sensor,
            due: Instant::MIN,
            temperature_c: f32::NAN,
        }
    }

    /// Takes a reading when due.
    pub(crate) fn poll(&mut self, now: Instant) {
        if now >= self.due {
            self.due = now + EVERY;
            self.temperature_c = NTC.celsius(self.sensor.read(interrupt::periods));
        }
    }

    /// Returns the transistor temperature, °C; NaN if the sensor is disconnected or not read yet.
    pub(crate) fn temperature_c(&self) -> f32 {
        self.temperature_c
    }
}

/// For the self-test.
impl Probe for Health {
    fn sample(&mut self) -> Sample {
        // The converters read again every period, possibly between two of these reads.
        sample(&Registers::CHIP)
    }

    fn own(&mut self, item: Item) -> Own {
        board::own(item)
    }
}
