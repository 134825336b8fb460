//! Which parts of the drive an image gets.

use std::str::FromStr;

use siskin_params::parts::Part;

/// What a list may hold besides single parts: the firmware's features.
const CHOICES: [&str; 2] = ["flight", "papers"];

/// A choice of parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Parts(Vec<String>);

impl FromStr for Parts {
    type Err = String;

    fn from_str(list: &str) -> Result<Self, String> {
        let names = || CHOICES.into_iter().chain(single().map(Part::name));
        let wanted: Vec<_> = list.split(',').map(str::trim).map(str::to_owned).collect();
        match wanted
            .iter()
            .find(|wanted| !names().any(|name| name == *wanted))
        {
            None => Ok(Self(wanted)),
            Some(unknown) => {
                let known: Vec<_> = names().collect();
                Err(format!(
                    "no part '{unknown}'; give some of {}",
                    known.join(", ")
                ))
            }
        }
    }
}

impl Parts {
    /// Returns cargo's names of their features, for the firmware's package.
    pub(super) fn features(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|name| {
            if CHOICES.contains(&name.as_str()) {
                name.clone()
            } else {
                format!("siskin-control/{name}")
            }
        })
    }
}

/// The parts that a board may have.
fn single() -> impl Iterator<Item = Part> {
    let all = Part::ALL.iter().copied();
    all.filter(|part| *part != Part::Bench)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn features(list: &str) -> Result<String, String> {
        let parts: Parts = list.parse()?;
        Ok(parts.features().collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn a_list_is_of_choices_and_parts() {
        assert_eq!(features("papers").as_deref(), Ok("papers"));
        assert_eq!(
            features("record, hall").as_deref(),
            Ok("siskin-control/record siskin-control/hall")
        );
    }

    #[test]
    fn what_no_board_has_is_refused_with_what_there_is() {
        for name in ["bench", "", "flight,whistle"] {
            let error = features(name).expect_err("it is no part of a board");
            assert!(
                error.contains("give some of flight, papers, back-emf"),
                "{error}"
            );
        }
    }
}
