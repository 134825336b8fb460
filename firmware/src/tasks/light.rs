//! The light, which shows trouble to a user without a ground station.

use embassy_stm32::gpio::Output;
use embassy_time::{Duration, Instant};
use siskin_control::drive::Snapshot;

/// Flashes once when all is well, or as often as the lowest-numbered fault requires, followed by a pause. Dark
/// means that the control is not running. Even blinking comes from [`crate::damaged`]. While the throttle wire carries
/// nothing that is known, light and dark change places.
pub(crate) struct Light {
    pin: Output<'static>,
    due: Instant,
    /// Light and dark times left until the pattern repeats.
    steps: u8,
}

impl Light {
    /// Creates a dark light.
    pub(crate) fn new(pin: Output<'static>) -> Self {
        Self {
            pin,
            due: Instant::MIN,
            steps: 0,
        }
    }

    /// Shows the pattern that is due. If all is well, a flight controller may have ordered the light on.
    pub(crate) fn poll(
        &mut self,
        now: Instant,
        snapshot: Option<&Snapshot>,
        ordered: bool,
        unknown: bool,
    ) {
        if now < self.due {
            return;
        }
        if self.steps == 0 {
            self.steps = match snapshot.map(|s| s.faults.iter().next()) {
                None => 0,
                Some(None) if ordered => 0,
                Some(None) => 2,
                Some(Some(fault)) => 2 * fault.flashes(),
            };
        }
        let (lit, time_ms) = match self.steps {
            0 => (snapshot.is_some(), 100),
            1 => (false, 1950),
            steps if steps.is_multiple_of(2) => (true, 50),
            _ => (false, 200),
        };
        let inverts = unknown && snapshot.is_some();
        self.pin.set_level((lit != inverts).into());
        self.steps = self.steps.saturating_sub(1);
        self.due = now + Duration::from_millis(time_ms);
    }
}
