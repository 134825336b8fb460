//! The values of the parameters, and why one is rejected.

use siskin_units::math::{SQRT_3, round};

use super::board::Board;
use super::preset::Preset;
use super::table::{Choice, Kind, ParamId, TABLE};

/// Why a value was rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetError {
    /// NaN or infinite.
    NotFinite,
    /// Outside `min..=max` of the table.
    OutOfRange,
    /// Has a fraction where a whole number is needed.
    NotWhole,
    /// The parameter is derived.
    ReadOnly,
}

/// The value of every parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    values: [f32; TABLE.len()],
}

impl Default for Params {
    fn default() -> Self {
        let mut params = Self {
            values: ParamId::ALL.map(ParamId::default_value),
        };
        params.derive();
        params
    }
}

impl ParamId {
    /// Finds a parameter by its MAVLink name.
    pub fn find(name: &str) -> Option<Self> {
        Self::find_bytes(name.as_bytes())
    }

    /// Finds a parameter by its MAVLink name, which need not be text.
    pub fn find_bytes(name: &[u8]) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|id| id.entry().name.as_bytes() == name)
    }

    /// Returns the factory value on this board.
    pub fn factory(self, board: &Board) -> f32 {
        let default = self.default_value();
        match self {
            Self::PwmDeadtimeNs => default.max(board.least_dead_time.ns),
            _ => default,
        }
    }
}

impl Params {
    /// Applies a preset over the defaults.
    pub fn of(preset: &Preset) -> Self {
        let mut params = Self::default();
        for (id, value) in preset.settings {
            params.values[*id as usize] = *value;
        }
        params.derive();
        params
    }

    /// Returns the value of a parameter, in its entry's unit.
    pub fn get(&self, id: ParamId) -> f32 {
        self.values[id as usize]
    }

    /// Returns the choice in force of a parameter: the value, or what stands in for one whose part this build lacks.
    pub fn choice<C: Choice>(&self) -> C {
        C::of(self.number(C::PARAM))
    }

    /// Returns true if a parameter has this choice in force.
    pub fn chosen<C: Choice>(&self, choice: C) -> bool {
        self.choice::<C>().number() == choice.number()
    }

    /// Returns the first parameter whose choice, not the factory's, this build lacks: another image has stored it, and
    /// it is kept.
    pub fn lacking(&self) -> Option<ParamId> {
        let mut all = ParamId::ALL.into_iter();
        all.find(|id| id.lacks(self.get(*id)) && !self.is_default(*id))
    }

    /// Returns a small whole number. Never inlined: the conversion would be repeated at every choice.
    #[inline(never)]
    pub fn number(&self, id: ParamId) -> u8 {
        self.get(id) as u8
    }

    /// Sets a value, or says why not and changes nothing.
    ///
    /// # Errors
    /// Any [`SetError`].
    pub fn set(&mut self, id: ParamId, value: f32) -> Result<(), SetError> {
        let entry = id.entry();
        if entry.kind == Kind::Derived {
            return Err(SetError::ReadOnly);
        }
        if !value.is_finite() {
            return Err(SetError::NotFinite);
        }
        if !entry.allows(value) {
            return Err(SetError::OutOfRange);
        }
        if matches!(entry.kind, Kind::Whole | Kind::Order) && round(value) != value {
            return Err(SetError::NotWhole);
        }
        self.values[id as usize] = value;
        self.derive();
        Ok(())
    }

    /// Returns true if a parameter has the table's default.
    pub fn is_default(&self, id: ParamId) -> bool {
        self.get(id) == id.default_value()
    }

    /// Sets a value that may be outside the table's range; nothing is derived from it.
    pub fn assume(&mut self, id: ParamId, value: f32) {
        self.values[id as usize] = value;
    }

    fn derive(&mut self) {
        let pole_pairs = self.get(ParamId::MotPolePairs);
        let flux_wb = self.get(ParamId::MotFluxMwb) * 1e-3;
        let linkage_wb = pole_pairs * flux_wb;
        self.values[ParamId::MotKv as usize] = if linkage_wb == 0.0 {
            0.0
        } else {
            60.0 / (core::f32::consts::TAU * SQRT_3 * linkage_wb)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BOSSO_MOTOR;

    #[test]
    fn a_refused_value_changes_nothing() {
        let mut params = Params::default();
        let before = params.clone();
        assert_eq!(params.set(ParamId::MotKv, 100.0), Err(SetError::ReadOnly));
        assert_eq!(
            params.set(ParamId::LimPhaseA, f32::NAN),
            Err(SetError::NotFinite)
        );
        assert_eq!(
            params.set(ParamId::LimPhaseA, 1e9),
            Err(SetError::OutOfRange)
        );
        assert_eq!(
            params.set(ParamId::MotPolePairs, 6.5),
            Err(SetError::NotWhole)
        );
        assert_eq!(params, before);
    }

    #[test]
    fn kv_follows_pole_pairs_and_flux() {
        let mut params = Params::of(&BOSSO_MOTOR);
        assert!((params.get(ParamId::MotKv) - 353.0).abs() < 0.5);
        params.set(ParamId::MotPolePairs, 6.0).expect("in range");
        assert!((params.get(ParamId::MotKv) - 706.0).abs() < 1.0);
    }

    #[test]
    fn a_choice_is_the_one_that_was_set() {
        use crate::choice::{CtlAdaptL, CtlObserver};

        let mut params = Params::default();
        for choice in [
            CtlObserver::BackEmf,
            CtlObserver::FluxCrossings,
            CtlObserver::Hall,
            CtlObserver::Compensated,
        ] {
            let (id, value) = choice.setting();
            params.set(id, value).expect("in range");
            assert_eq!(params.choice::<CtlObserver>(), choice);
            assert!(params.chosen(choice) && params.chosen(CtlAdaptL::Off));
        }
        assert!(!params.chosen(CtlObserver::Hall));
    }

    #[test]
    fn every_name_is_found() {
        for id in ParamId::ALL {
            assert_eq!(ParamId::find(id.entry().name), Some(id));
        }
        assert_eq!(ParamId::find("NO_SUCH"), None);
    }
}
