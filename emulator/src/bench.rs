//! What can be put on the bench: motors, loads and supplies by name, from a file or inline.

mod choice;
mod error;
pub mod library;
mod load;
mod motor;
mod set_up;
mod supply;
mod text;
mod word;

pub use choice::Choice;
pub use error::BenchError;
pub use load::LoadTable;
pub use motor::MotorTable;
pub use set_up::{Bench, DEFAULT_LOAD, DEFAULT_MOTOR, Position};
pub use supply::SupplyTable;
pub use text::line_of_byte;

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::text::toml_reason;
    use super::*;
    use crate::plant::Extras;

    fn motor(text: &str) -> Result<Choice<MotorTable>, toml::de::Error> {
        #[derive(Deserialize)]
        struct Holder {
            motor: Choice<MotorTable>,
        }
        toml::from_str::<Holder>(text).map(|holder| holder.motor)
    }

    #[test]
    fn built_in_names_are_found_and_others_say_what_there_is() {
        let named = |name: &str| Choice::<MotorTable>::Named(name.to_owned());
        let (motor, extras) = named(DEFAULT_MOTOR).motor().unwrap();
        assert_eq!((motor.pole_pairs, motor.resistance_ohm), (12, 0.108));
        assert_eq!(extras, Extras::default());
        let error = named("nosuch").motor().unwrap_err().to_string();
        assert!(
            error.contains("nosuch") && error.contains("antigravity"),
            "{error}"
        );
        let load = |name: &str| Choice::<LoadTable>::Named(name.to_owned()).load();
        assert_eq!(load(DEFAULT_LOAD).unwrap().c2, 0.3e-6);
        assert_eq!(load("none").unwrap().inertia_kgm2, 8e-6);
    }

    #[test]
    fn tables_are_checked() {
        let round = motor("motor = { R = 0.1, L = 2e-5, flux = 1e-3, pole_pairs = 7 }").unwrap();
        let (round, extras) = round.motor().unwrap();
        assert_eq!((round.pole_pairs, round.inductance_h), (7, 2e-5));
        assert_eq!(extras, Extras::default());
        let rest = "flux = 1e-3, pole_pairs = 7";
        let salient = format!("motor = {{ R = 0.1, L_d = 2e-5, L_q = 3e-5, {rest} }}");
        let (salient, extras) = motor(&salient).unwrap().motor().unwrap();
        assert!((salient.inductance_h - 2.5e-5).abs() < 1e-18 && extras.saliency == 1.5);
        for (keys, word) in [
            ("R = -1.0, L = 2e-5", "R = -1"),
            ("R = 0.1", "L_d"),
            ("R = 0.1, L = 2e-5, L_q = 2e-5", "L_d"),
            ("R = 0.1, L = 2e-5, cogging_nm = 1e-3", "cogging_order = 0"),
            (
                "R = 0.1, L = 2e-5, harmonics = [{ order = 1, share = 0.1 }]",
                "order = 1",
            ),
            (
                "R = 0.1, L = 2e-5, winding = { k_per_w = 0.0, j_per_k = 1.0 }",
                "k_per_w = 0",
            ),
            (
                "R = 0.1, L = 2e-5, saturation_a = 0.5",
                "saturation_a = 0.5",
            ),
        ] {
            let choice = motor(&format!("motor = {{ {keys}, {rest} }}")).unwrap();
            let error = choice.motor().unwrap_err().to_string();
            assert!(error.contains(word), "{keys}: {error}");
        }
        let text = "\nmotor = { R = 0.1, K = 1 }";
        let error = motor(text).unwrap_err();
        let reason = toml_reason(text, &error);
        assert!(
            reason.contains("line 2") && reason.contains('K'),
            "{reason}"
        );
    }
}
