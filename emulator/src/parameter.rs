//! Parameters from a command line, a scenario or a program.

use mavlink::dialects::ardupilotmega::{MavParamType, PARAM_SET_DATA};
use mavlink::{MAVLinkV2MessageRaw, MavHeader};
use siskin_params::{PRESETS, ParamId, Params, Preset, SetError};

/// Finds a parameter by name and checks the value against the table.
///
/// # Errors
/// One line that names the parameter and what would be accepted.
pub fn parameter(name: &str, value: f32) -> Result<(ParamId, f32), String> {
    let id = ParamId::find(name).ok_or_else(|| format!("there is no parameter {name}"))?;
    let entry = id.entry();
    match Params::default().set(id, value) {
        Ok(()) => Ok((id, value)),
        Err(SetError::ReadOnly) => Err(format!("{name} is computed and cannot be set")),
        Err(SetError::NotWhole) => Err(format!("{name} = {value} is not a whole number")),
        Err(SetError::NotFinite | SetError::OutOfRange) => Err(format!(
            "{name} = {value} is out of range; give {} {}",
            entry.range(),
            id.text().unit
        )
        .trim_end()
        .to_owned()),
    }
}

/// Parses `NAME=VALUE`, as on the command line.
///
/// # Errors
/// One line that names what was given and what would be accepted.
pub fn assignment(text: &str) -> Result<(ParamId, f32), String> {
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| format!("{text} is not NAME=VALUE"))?;
    let number = value.parse();
    parameter(
        name,
        number.map_err(|_| format!("{name}: {value} is not a number"))?,
    )
}

/// Finds a named set of parameters.
///
/// # Errors
/// One line that lists the existing ones.
pub fn preset(name: &str) -> Result<&'static Preset, String> {
    PRESETS
        .iter()
        .find(|preset| preset.name == name)
        .ok_or_else(|| {
            let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
            format!("there is no preset {name}; there is {}", names.join(", "))
        })
}

/// A ground station's address.
const OWN: MavHeader = MavHeader {
    system_id: 255,
    component_id: 190,
    sequence: 0,
};

/// Returns the frame by which a ground station sets a parameter.
pub fn set_frame(id: ParamId, value: f32) -> MAVLinkV2MessageRaw {
    let mut frame = MAVLinkV2MessageRaw::new();
    let set = PARAM_SET_DATA {
        param_value: value,
        // Whoever hears it, and that is one.
        target_system: 0,
        target_component: 0,
        param_id: id.entry().name.into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    };
    frame.serialize_message_data(OWN, &set);
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_are_checked_against_the_table() {
        assert_eq!(
            assignment("CTL_RPM_MAX=5000"),
            Ok((ParamId::CtlRpmMax, 5000.0))
        );
        for (wrong, word) in [
            ("CTL_RPM_MAX", "NAME=VALUE"),
            ("CTL_RPM_MAX=fast", "not a number"),
            ("CTL_RPM_MAX=1", "give 100 to 200000 rpm"),
            ("NO_SUCH=1", "no parameter"),
            ("MOT_KV=1", "computed"),
            ("MOT_DIR=0.5", "whole"),
        ] {
            let error = assignment(wrong).unwrap_err();
            assert!(error.contains(word), "{wrong}: {error}");
        }
    }
}
