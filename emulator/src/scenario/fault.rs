//! A fault as given by a scenario.
//!
//! The kinds and their keys are in the reference of `emulator/README.md`.

use std::f64::consts::TAU;

use serde::Deserialize;

use crate::fault::{CHIP_V, Fault, Kind, Side};

/// The wrong key, and what it needs.
type Problem = (&'static str, String);

/// Range of the shares by which one fault lets a motor's resistance or flux grow.
const DRIFT_MIN: f64 = -0.45;
const DRIFT_MAX: f64 = 5.0;

/// An entry of the time line.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaultTable {
    at_s: f64,
    for_s: Option<f64>,
    kind: Name,
    phase: Option<usize>,
    side: Option<Side>,
    value: Option<f64>,
}

/// The kinds' names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Name {
    RotorBlocked,
    RotorKick,
    Gust,
    Strike,
    PhaseOpen,
    MosfetOpen,
    MosfetShort,
    SensorStuck,
    OffsetDrift,
    ResistanceDrift,
    FluxDrift,
    Noise,
    HallStuck,
    BusSag,
    BusDisconnect,
    BrownOut,
    Reset,
    FlashFail,
    SignalLoss,
    BitErrors,
    Jitter,
}

/// Parses a fault from a command line: its keys and values, acting from the start unless it states a time.
pub fn from_text(text: &str) -> Result<Fault, String> {
    let how = |reason: &str| format!("{reason}; give a fault as kind = \"mosfet_open\", phase = 1");
    let wrong = |error: toml::de::Error| how(error.message());
    let mut table: toml::Table = toml::from_str(&format!("fault = {{ {text} }}")).map_err(wrong)?;
    let fault = table.get_mut("fault").and_then(toml::Value::as_table_mut);
    let fault = fault.ok_or_else(|| how("this is no fault"))?;
    fault.entry("at_s").or_insert(toml::Value::Float(0.0));
    let fault: FaultTable = fault.clone().try_into().map_err(wrong)?;
    fault
        .fault()
        .map_err(|(key, what)| format!("{key}: {what}"))
}

impl FaultTable {
    /// Returns the fault that it describes.
    pub(super) fn fault(&self) -> Result<Fault, Problem> {
        if !(0.0..=1e5).contains(&self.at_s) {
            return Err(("at_s", "give 0 to 100000".to_owned()));
        }
        if self
            .for_s
            .is_some_and(|for_s| !(0.0..=1e5).contains(&for_s))
        {
            return Err(("for_s", "give 0 to 100000".to_owned()));
        }
        Ok(Fault {
            at_s: self.at_s,
            for_s: self.for_s,
            kind: self.kind()?,
        })
    }

    fn kind(&self) -> Result<Kind, Problem> {
        self.takes_no_other_keys()?;
        let rad_s = |rpm: f64| rpm * TAU / 60.0;
        Ok(match self.kind {
            Name::RotorBlocked => Kind::RotorBlocked,
            Name::RotorKick => Kind::RotorKick(rad_s(self.value("rpm", -2e5, 2e5)?)),
            Name::Gust => Kind::Gust(rad_s(self.value("rpm", -2e5, 2e5)?)),
            Name::Strike => Kind::Strike(self.value("Nm", -1e3, 1e3)?),
            Name::PhaseOpen => Kind::PhaseOpen(self.phase()?),
            Name::MosfetOpen => Kind::MosfetOpen(self.phase()?, self.side.unwrap_or(Side::High)),
            Name::MosfetShort => Kind::MosfetShort(self.phase()?, self.side()?),
            Name::SensorStuck => Kind::SensorStuck(self.phase()?, self.value("A", -1e3, 1e3)?),
            Name::OffsetDrift => Kind::OffsetDrift(self.phase()?, self.value("A", -1e3, 1e3)?),
            Name::ResistanceDrift => {
                Kind::ResistanceDrift(self.value("a share", DRIFT_MIN, DRIFT_MAX)?)
            }
            Name::FluxDrift => Kind::FluxDrift(self.value("a share", DRIFT_MIN, DRIFT_MAX)?),
            Name::Noise => Kind::Noise(self.value("A rms", 0.0, 1e3)?),
            Name::HallStuck => Kind::HallStuck(self.phase()?, self.level()?),
            Name::BusSag => Kind::BusSag(self.value("V", -70.0, 70.0)?),
            Name::BusDisconnect => Kind::BusDisconnect,
            Name::BrownOut => Kind::BrownOut(self.value("V", 0.0, CHIP_V)?),
            Name::Reset => Kind::Reset,
            Name::FlashFail => Kind::FlashFail,
            Name::SignalLoss => Kind::SignalLoss,
            Name::BitErrors => Kind::BitErrors(self.value("a probability", 0.0, 1.0)?),
            Name::Jitter => Kind::Jitter(self.value("ns rms", 0.0, 1e6)?),
        })
    }

    /// A key without effect is a mistake.
    fn takes_no_other_keys(&self) -> Result<(), Problem> {
        let switch = matches!(self.kind, Name::MosfetOpen | Name::MosfetShort);
        let sensor = matches!(
            self.kind,
            Name::SensorStuck | Name::OffsetDrift | Name::HallStuck
        );
        let bare = matches!(
            self.kind,
            Name::RotorBlocked
                | Name::PhaseOpen
                | Name::BusDisconnect
                | Name::Reset
                | Name::FlashFail
                | Name::SignalLoss
        );
        for (key, given, taken) in [
            (
                "phase",
                self.phase.is_some(),
                switch || sensor || self.kind == Name::PhaseOpen,
            ),
            ("side", self.side.is_some(), switch),
            ("value", self.value.is_some(), !(switch || bare)),
        ] {
            if given && !taken {
                return Err((key, format!("the fault takes no {key}; leave it out")));
            }
        }
        Ok(())
    }

    fn phase(&self) -> Result<usize, Problem> {
        let phase = self.phase.filter(|phase| *phase < 3);
        phase.ok_or_else(|| ("phase", "give phase = 0, 1 or 2".to_owned()))
    }

    fn side(&self) -> Result<Side, Problem> {
        let wrong = || ("side", "give side = \"high\" or \"low\"".to_owned());
        self.side.ok_or_else(wrong)
    }

    fn value(&self, unit: &str, least: f64, most: f64) -> Result<f64, Problem> {
        let value = self.value.filter(|value| (least..=most).contains(value));
        value.ok_or_else(|| ("value", format!("give value = {least} to {most}, {unit}")))
    }

    fn level(&self) -> Result<bool, Problem> {
        match self.value {
            Some(0.0) => Ok(false),
            Some(1.0) => Ok(true),
            _ => Err((
                "value",
                "give value = 0 or 1, the sensor's level".to_owned(),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{assert_has_all, code, rows};

    fn read(entry: &str) -> Result<Fault, String> {
        let table = toml::from_str::<FaultTable>(&entry.replace("; ", "\n"));
        let table = table.map_err(|error| error.message().to_owned())?;
        let wrong = |(key, problem)| format!("{key}: {problem}");
        table.fault().map_err(wrong)
    }

    #[test]
    fn entries_mean_what_they_say() {
        let fault =
            read("at_s = 1.0; for_s = 0.5; kind = 'mosfet_short'; phase = 2; side = 'high'");
        let wanted = Fault {
            at_s: 1.0,
            for_s: Some(0.5),
            kind: Kind::MosfetShort(2, Side::High),
        };
        assert_eq!(fault, Ok(wanted));
        let kind = |entry: &str| read(&format!("at_s = 0.0; {entry}")).map(|fault| fault.kind);
        assert_eq!(
            kind("kind = 'rotor_kick'; value = 60.0"),
            Ok(Kind::RotorKick(60.0 * TAU / 60.0))
        );
        assert_eq!(
            kind("kind = 'hall_stuck'; phase = 0; value = 1"),
            Ok(Kind::HallStuck(0, true))
        );
        assert_eq!(kind("kind = 'signal_loss'"), Ok(Kind::SignalLoss));
        assert_eq!(
            kind("kind = 'mosfet_open'; phase = 1"),
            Ok(Kind::MosfetOpen(1, Side::High))
        );
    }

    #[test]
    fn what_is_wrong_is_said_in_a_line() {
        for (entry, said) in [
            ("at_s = 1.0; kind = 'gremlin'", "gremlin"),
            ("at_s = 1.0; kind = 'phase_open'", "phase = 0, 1 or 2"),
            (
                "at_s = 1.0; kind = 'phase_open'; phase = 3",
                "phase = 0, 1 or 2",
            ),
            ("at_s = 1.0; kind = 'mosfet_short'; phase = 1", "side"),
            ("at_s = 1.0; kind = 'sensor_stuck'; phase = 1", "value"),
            (
                "at_s = 1.0; kind = 'bit_errors'; value = 1.5",
                "value = 0 to 1",
            ),
            (
                "at_s = 1.0; kind = 'hall_stuck'; phase = 1; value = 0.5",
                "0 or 1",
            ),
            ("at_s = 1.0; kind = 'reset'; value = 1.0", "takes no value"),
            (
                "at_s = 1.0; kind = 'noise'; value = 1.0; phase = 1",
                "takes no phase",
            ),
            ("at_s = -1.0; kind = 'reset'", "at_s"),
            ("at_s = 1.0; for_s = nan; kind = 'reset'", "for_s"),
        ] {
            let error = read(entry).unwrap_err();
            assert!(
                error.contains(said) && !error.contains('\n'),
                "{entry}: {error}"
            );
        }
    }

    #[test]
    fn the_reference_has_every_kind() {
        assert_has_all::<FaultTable>("`[[fault]]`");
        assert_has_all::<Name>("Kinds of faults");
    }

    #[test]
    fn a_kind_takes_the_keys_that_the_reference_lists_and_no_other() {
        for row in rows("Kinds of faults") {
            let kind = code(&row[0]).unwrap();
            for given in 0..8_u8 {
                let keys = [("phase", "1"), ("side", "'low'"), ("value", "1.0")];
                let mut entry = format!("at_s = 0.0; kind = '{kind}'");
                let mut wanted = true;
                for (bit, (key, value)) in keys.into_iter().enumerate() {
                    let listed = row[1].contains(&format!("`{key}`"));
                    let given = given & 1 << bit != 0;
                    if given {
                        entry += &format!("; {key} = {value}");
                    }
                    let has_default = kind == "mosfet_open" && key == "side";
                    wanted &= given == listed || listed && has_default;
                }
                assert_eq!(read(&entry).is_ok(), wanted, "{entry}");
            }
        }
    }
}
