//! Takes in what the drive and the board show at each poll: temperature, limits, consumption and statistics.

use siskin_params::ParamId;
use siskin_units::math::magnitude;

use super::Esc;
use crate::build::{thresholds, unbalance_max};
use crate::drive::Snapshot;
use crate::statistics::Inputs;

/// How far below `LIM_TEMP_C` an over-temperature clears, °C.
const TEMPERATURE_HYSTERESIS_C: f32 = 5.0;

impl Esc {
    /// Takes in the state of the drive and the board.
    pub(super) fn observe(
        &mut self,
        now_us: u64,
        snapshot: &Snapshot,
        temperature_c: f32,
        time_us: u64,
    ) {
        self.update_temperature(temperature_c);
        #[cfg(feature = "drift")]
        self.follow_motor(snapshot);
        self.telemetry.observe(snapshot, &self.scale, time_us);
        self.update_limits(snapshot);
        self.charge
            .add(self.scale.amperes(snapshot.bus_current), time_us);
        self.telemetry.consumed_mah = self.charge.mah();
        let inputs = Inputs {
            phase: snapshot.phase,
            faults: snapshot.faults,
            temperature_c,
            phase_a: self.scale.amperes(magnitude(snapshot.i.d, snapshot.i.q)),
            time_us: u32::try_from(time_us).unwrap_or(u32::MAX),
        };
        let rests = self.recorder.poll(&mut self.telemetry.statistics, &inputs);
        if rests {
            self.storage.changed(now_us);
        }
    }

    /// Takes in the board's temperature, and whether it is over its limit.
    fn update_temperature(&mut self, temperature_c: f32) {
        let limit_c = self.params.get(ParamId::LimTempC);
        let limit_c = if self.too_hot {
            limit_c - TEMPERATURE_HYSTERESIS_C
        } else {
            limit_c
        };
        // A NaN reading counts as too hot.
        self.too_hot = temperature_c.is_nan() || temperature_c > limit_c;
        self.telemetry.temperature_c = temperature_c;
    }

    /// Takes in which limits are active, and warns of defects that have appeared.
    fn update_limits(&mut self, snapshot: &Snapshot) {
        let defects = self
            .current_monitor
            .update(snapshot, unbalance_max(&self.board));
        for defect in defects.without(self.telemetry.limits).iter() {
            self.warn_of(defect.text());
        }
        let active = thresholds(&self.params, &self.scale).limits(snapshot);
        self.telemetry.limits = active.with(defects);
    }
}
