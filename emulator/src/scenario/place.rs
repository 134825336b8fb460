//! Identifies one of several runs, so that it can be repeated alone.

use std::fmt;

use serde::{Serialize, Serializer};
use toml::Value;

use super::error::ScenarioError;

/// One of several runs. As text, the options that reproduce it.
#[derive(Clone, Debug, Serialize)]
pub struct Place {
    /// The seed of noise and draws.
    pub seed: u64,
    /// Swept keys and those set on the command line, with their values.
    #[serde(serialize_with = "map")]
    pub set: Vec<(String, Value)>,
    /// What the seed drew.
    #[serde(serialize_with = "map", skip_serializing_if = "Vec::is_empty")]
    pub drawn: Vec<(String, Value)>,
}

impl Place {
    /// Adds to an error the run that has it, if that differs from the file.
    pub(super) fn blame(&self, error: ScenarioError) -> ScenarioError {
        if self.set.is_empty() && self.drawn.is_empty() {
            return error;
        }
        ScenarioError::Case {
            error: Box::new(error),
            place: self.to_string(),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "--seed {}", self.seed)?;
        for (key, value) in &self.set {
            let text = format!("{key}={value}");
            // What a shell would split or expand.
            if text.contains([' ', '[', '{', '"', '\'']) {
                write!(f, " --set '{}'", text.replace('\'', "'\\''"))?;
            } else {
                write!(f, " --set {text}")?;
            }
        }
        Ok(())
    }
}

/// Serialises pairs as a JSON object, in order.
pub(super) fn map<S: Serializer>(
    pairs: &[(String, Value)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(key, value)| (key, value)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_options_of_a_run_pass_a_shell() {
        let place = Place {
            seed: 7,
            set: vec![
                ("bench.scale.R".to_owned(), Value::Float(0.7)),
                ("bench.motor".to_owned(), Value::String("it's".to_owned())),
            ],
            drawn: Vec::new(),
        };
        assert_eq!(
            place.to_string(),
            r#"--seed 7 --set bench.scale.R=0.7 --set 'bench.motor="it'\''s"'"#
        );
    }
}
