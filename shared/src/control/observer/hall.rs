//! Hall sensors (second paper, section 2.3.1, figure 22): the sector from three bits, and whether they can be
//! trusted.

use siskin_units::traced;

use super::sector::Sector;

/// Check of the sensor codes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Periods for which all three may be equal, which no rotor position produces.
    pub patience: u32,
}

traced! {
    /// State of the sensors.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// Code of the last sample.
        pub code: u8,
        /// Last code seen in two consecutive samples.
        pub stable_code: u8,
        /// Sector of the last valid one.
        pub sector: Option<Sector>,
        /// Periods for which it has been invalid.
        pub invalid: u32,
        /// Evidence against the sensors.
        pub evidence: u8,
        /// A sensor has failed; latched.
        pub fault: bool,
    }
}

/// A change of sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The first valid sector.
    Found(Sector),
    /// The next sector: an edge at its start.
    Forward(Sector),
    /// Back over the edge.
    Back(Sector),
    /// A sector that cannot be reached in one step.
    Jump(Sector),
}

/// Samples that a code must last. A single one may be a spike on the wires.
pub const SAMPLES: u32 = 2;

/// Evidence added per contradiction; a regular edge removes one.
const CONTRADICTION: u8 = 8;
/// Evidence that makes a fault: three contradictions within a turn or two. A stuck sensor causes two or three a
/// turn, a spike on the wires one.
const FAULT: u8 = 20;

/// Processes this sample's code.
pub fn read(config: &Config, state: &mut State, code: u8) -> Option<Step> {
    let code = code & 7;
    let lasts = code == state.code;
    state.code = code;
    let step = if lasts && code != state.stable_code {
        step_to(state, code)
    } else {
        None
    };
    if Sector::of_code(state.stable_code).is_some() {
        state.invalid = 0;
    } else {
        state.invalid = state.invalid.saturating_add(1);
        state.fault |= state.invalid >= config.patience;
    }
    step
}

/// Returns the sector, from this sample's code, of a rotor not tracked since the last drive, if the sensors can be
/// trusted. Keeps the evidence against them, but drops the position from before, as the rotor may have been turned.
pub fn read_at_rest(state: &mut State, code: u8) -> Option<Sector> {
    let code = code & 7;
    *state = State {
        code,
        stable_code: code,
        sector: Sector::of_code(code),
        invalid: 0,
        ..*state
    };
    state.trusted_sector()
}

fn step_to(state: &mut State, code: u8) -> Option<Step> {
    state.stable_code = code;
    let Some(sector) = Sector::of_code(code) else {
        contradict(state);
        return None;
    };
    let Some(before) = state.sector.replace(sector) else {
        return Some(Step::Found(sector));
    };
    match before.steps_to(sector) {
        0 => None,
        1 => {
            state.evidence = state.evidence.saturating_sub(1);
            Some(Step::Forward(sector))
        }
        5 => Some(Step::Back(sector)),
        _ => {
            contradict(state);
            Some(Step::Jump(sector))
        }
    }
}

/// Records something that working sensors would not show.
pub fn contradict(state: &mut State) {
    state.evidence = state.evidence.saturating_add(CONTRADICTION);
    state.fault |= state.evidence >= FAULT;
}

impl State {
    /// Returns the sector while the sensors can be trusted.
    pub fn trusted_sector(&self) -> Option<Sector> {
        self.sector.filter(|_| !self.fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CONFIG: Config = Config { patience: 24 };

    /// Shows ten samples of each code; returns the step of the sample that confirms it.
    fn show(state: &mut State, code: u8) -> Option<Step> {
        let steps = [0; 10].map(|_| read(&CONFIG, state, code));
        assert_eq!(
            steps.iter().flatten().count(),
            usize::from(steps[1].is_some())
        );
        steps[1]
    }

    const FORWARDS: [u8; 6] = [0b001, 0b011, 0b010, 0b110, 0b100, 0b101];

    fn turn(state: &mut State, stuck: impl Fn(u8) -> u8) {
        for code in FORWARDS {
            show(state, stuck(code));
        }
    }

    #[test]
    fn the_sector_is_known_at_once_and_followed_both_ways() {
        let mut state = State::default();
        let sector = |code| Sector::of_code(code).expect("valid");
        assert_eq!(show(&mut state, 0b011), Some(Step::Found(sector(0b011))));
        assert_eq!(show(&mut state, 0b010), Some(Step::Forward(sector(0b010))));
        assert_eq!(show(&mut state, 0b011), Some(Step::Back(sector(0b011))));
        assert_eq!(show(&mut state, 0b100), Some(Step::Jump(sector(0b100))));
    }

    #[test]
    fn a_rotor_that_has_been_turned_at_rest_is_found_without_a_contradiction() {
        let mut state = State::default();
        let sector = |code| Sector::of_code(code).expect("valid");
        show(&mut state, 0b011);
        for code in [0b011, 0b100] {
            assert_eq!(read_at_rest(&mut state, code), Some(sector(code)));
            assert_eq!(show(&mut state, code), None);
        }
        assert_eq!(state.evidence, 0);
        assert_eq!(read_at_rest(&mut state, 0b111), None);
        assert!(!state.fault);
    }

    #[test]
    fn good_sensors_are_never_at_fault() {
        let mut state = State::default();
        for _ in 0..100 {
            turn(&mut state, |code| code);
        }
        assert!(!state.fault && state.evidence == 0);
    }

    #[test]
    fn a_spike_of_one_sample_is_nothing() {
        let mut state = State::default();
        show(&mut state, 0b011);
        for spike in 0..8 {
            assert_eq!(read(&CONFIG, &mut state, spike), None);
            assert_eq!(show(&mut state, 0b011), None);
        }
        assert!(!state.fault && state.evidence == 0);
    }

    #[test]
    fn a_sensor_that_is_stuck_is_at_fault_within_two_turns() {
        for bit in 0..3 {
            for high in [false, true] {
                let mut state = State::default();
                for _ in 0..5 {
                    turn(&mut state, |code| code);
                }
                for _ in 0..2 {
                    turn(&mut state, |code| {
                        if high {
                            code | 1 << bit
                        } else {
                            code & !(1 << bit)
                        }
                    });
                }
                assert!(state.fault, "{bit} {high}");
                assert_eq!(state.trusted_sector(), None);
            }
        }
    }

    #[test]
    fn codes_that_no_rotor_makes_are_a_fault_where_they_last() {
        for code in [0, 7] {
            let mut state = State::default();
            show(&mut state, 0b001);
            let samples = (0..200).find(|_| {
                read(&CONFIG, &mut state, code);
                state.fault
            });
            // 24 periods, plus one to confirm the code.
            assert_eq!(samples, Some(24));
        }
        let mut open = State::default();
        (0..24).for_each(|_| assert_eq!(read(&CONFIG, &mut open, 7), None));
        assert!(open.fault);
    }

    proptest! {
        #[test]
        fn any_input_is_survived(codes in prop::collection::vec(any::<u8>(), 0..500)) {
            let mut state = State::default();
            let mut before = 0;
            for code in codes {
                let (code_before, was_faulty) = (before & 7, state.fault);
                let step = read(&CONFIG, &mut state, code);
                prop_assert!(step.is_none() || code & 7 == code_before, "a spike is no step");
                prop_assert!(state.fault || !was_faulty, "a fault stays");
                before = code;
            }
        }
    }
}
