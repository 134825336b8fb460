//! Parts of the drive that an image may leave out: each is a feature of this crate.
//!
//! What needs a part holds its token, in an enum's variant or a configuration's field. Where a build lacks the part the
//! token's type has no values, so neither has what holds it, and the compiler leaves out the code that serves it.

/// Defines each part's token and its entry in [`Part`].
macro_rules! parts {
    ($($(#[doc = $doc:literal])+ $part:ident $feature:literal;)+) => {
        $(
            $(#[doc = $doc])+
            #[cfg(feature = $feature)]
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub struct $part(());

            #[cfg(feature = $feature)]
            impl $part {
                /// The token; a build without the part has none.
                pub const HERE: Self = Self(());

                /// Returns the token, if this build has the part.
                pub const fn get() -> Option<Self> {
                    Some(Self::HERE)
                }
            }

            $(#[doc = $doc])+
            #[cfg(not(feature = $feature))]
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub enum $part {}

            #[cfg(not(feature = $feature))]
            impl $part {
                /// Returns the token, if this build has the part.
                pub const fn get() -> Option<Self> {
                    None
                }
            }
        )+

        /// Names a part.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Part {
            $($(#[doc = $doc])+ $part,)+
        }

        impl Part {
            /// All parts.
            pub const ALL: &[Self] = &[$(Self::$part),+];

            /// Returns its name: the feature's.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$part => $feature,)+
                }
            }

            /// Returns true if this build has it.
            pub const fn is_here(self) -> bool {
                match self {
                    $(Self::$part => cfg!(feature = $feature),)+
                }
            }
        }
    };
}

parts! {
    /// The adaptive back-EMF observer and the observer-based regulator: `CTL_OBSERVER` 0, `CTL_REGULATOR` 0.
    BackEmf "back-emf";
    /// The observer by flux crossings: `CTL_OBSERVER` 1.
    FluxCrossings "flux-crossings";
    /// Hall sensors: `CTL_OBSERVER` 2.
    Hall "hall";
    /// The modified synchronous regulator: `CTL_REGULATOR` 2.
    Modified "modified";
    /// The speed loop with the propeller's current fed forward: `CTL_SPEED` 1.
    Propeller "propeller";
    /// The adaptation of the inductance: `CTL_ADAPT_L` 1.
    AdaptL "adapt-l";
    /// Sine modulation: `CTL_MODULATION` 1.
    Sine "sine";
    /// What only a simulated bench has: a rotor whose position is given, and a delay of less than a period.
    Bench "bench";
    /// What ground stations show beside the parameters: descriptions, units, ranges and choices.
    Metadata "metadata";
    /// The identification of the motor.
    Identification "identification";
    /// The record of the last faults.
    Record "record";
    /// Resistance and flux that are followed while the motor turns.
    Drift "drift";
}

/// The parts of an image for flying.
const FLIGHT: &[Part] = &[
    Part::Metadata,
    Part::Identification,
    Part::Record,
    Part::Drift,
];

/// The parts of an image with all of both papers.
const PAPERS: &[Part] = &[
    Part::BackEmf,
    Part::FluxCrossings,
    Part::Hall,
    Part::Modified,
    Part::Propeller,
    Part::AdaptL,
    Part::Sine,
];

/// Which parts a build has, in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Those for flying and those of the papers.
    All,
    /// Those for flying alone.
    Flight,
    /// Those of the papers alone.
    Papers,
    /// Any other choice.
    Custom,
}

/// This build's parts.
pub const CHOICE: Choice = match (has(FLIGHT), has(PAPERS)) {
    ((_, true), (_, true)) => Choice::All,
    ((_, true), (false, _)) => Choice::Flight,
    ((false, _), (_, true)) => Choice::Papers,
    _ => Choice::Custom,
};

/// Returns whether this build has any of these parts, and whether it has all.
const fn has(parts: &[Part]) -> (bool, bool) {
    let (mut any, mut all) = (false, true);
    let mut i = 0;
    while i < parts.len() {
        any |= parts[i].is_here();
        all &= parts[i].is_here();
        i += 1;
    }
    (any, all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_but_the_bench_s_belongs_to_one_image() {
        for part in Part::ALL {
            let images = [FLIGHT, PAPERS];
            let images = images.iter().filter(|parts| parts.contains(part)).count();
            assert_eq!(images, usize::from(*part != Part::Bench), "{}", part.name());
        }
    }
}
