//! The single table of the drive's phase changes, with their reasons.

use super::config::Stop;
use super::phase::Phase;
use crate::protection::Fault;

/// Why the phase changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Why {
    /// Something that may turn the motor asks for it.
    Drive,
    /// A tone or a self-test is requested while the rotor stands.
    Tone,
    /// Nothing is requested any more, or the other direction is.
    Released,
    /// Nothing is requested any more and the shaft is to coast: without current at once.
    Coasts,
    /// The low sides were on before a tone, and go on again.
    Shorted,
    /// The current offsets are measured, and the rotor is known as far as possible.
    Sensed,
    /// The shaft turns too fast for the six-step drive, which has no flying start, to seek it.
    TooFast,
    /// The drivers are charged and the rotor stands at an unknown angle: align it.
    Stands,
    /// The drivers are charged, and the six-step drive seeks the rotor by turning it.
    Seeks,
    /// The drivers are charged and the rotor is known, by a flying start or position sensors.
    Caught,
    /// The drivers are charged and the rotor turns the other way.
    CaughtBackwards,
    /// The drivers are charged as far as a tone or self-test needs.
    ToneReady,
    /// The rotor has had its time to align.
    Aligned,
    /// The observer has locked on to the rotor.
    HandedOver,
    /// The motor is to turn again, and the observer still tracks it.
    Resumed,
    /// Nothing is left to slow down.
    Stopped,
    /// The rotor turns slowly, or no longer fast the other way, and is known: a ramp begins with it.
    Followed,
    /// Loss of synchronism in a start, or Run too slow for too long: to Idle, where a set-point that still asks to
    /// turn begins another attempt.
    Failed,
    /// Bridge off until zero throttle, or a retry.
    Tripped(Fault),
}

/// Returns the phase that a change leads to; `None` if the phase cannot end for this reason.
pub(super) const fn next(from: Phase, why: Why, stop: Stop) -> Option<Phase> {
    use Phase::{Brake, Charge, Idle, Park, Ramp, Run, Sense, Stopping, Tone};
    Some(match (from, why) {
        (Idle | Brake | Tone, Why::Drive) | (Idle | Brake, Why::Tone) => Sense,
        (Sense, Why::Sensed) => Charge,
        (Sense | Charge, Why::Released | Why::TooFast) | (Tone, Why::Released) => Idle,
        (Idle | Tone, Why::Shorted) => Brake,
        (Charge, Why::ToneReady) => Tone,
        (Charge, Why::Stands) | (Charge | Stopping | Brake, Why::Followed) => Park,
        (Charge, Why::Seeks) => Ramp,
        (Charge, Why::Caught) => Run,
        (Charge, Why::CaughtBackwards) => Stopping,
        (Park, Why::Aligned) => Ramp,
        (Ramp, Why::HandedOver) => Run,
        (Run, Why::Released) => Stopping,
        (Stopping | Brake, Why::Resumed) => Run,
        (Park | Ramp, Why::Released) | (Stopping, Why::Stopped) => match stop {
            Stop::Coast => Idle,
            Stop::Brake => Brake,
        },
        (Run | Stopping, Why::Coasts) => Idle,
        (Ramp | Run | Stopping, Why::Failed) => Idle,
        (_, Why::Tripped(_)) => Idle,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const ALL: [Why; 19] = [
        Why::Drive,
        Why::Tone,
        Why::Released,
        Why::Coasts,
        Why::Shorted,
        Why::Sensed,
        Why::TooFast,
        Why::Stands,
        Why::Seeks,
        Why::Caught,
        Why::CaughtBackwards,
        Why::ToneReady,
        Why::Aligned,
        Why::HandedOver,
        Why::Resumed,
        Why::Stopped,
        Why::Followed,
        Why::Failed,
        Why::Tripped(Fault::OverCurrent),
    ];

    /// Returns the phases that the table reaches from here without a fault, for either stop mode.
    fn led_to(from: Phase) -> Vec<Phase> {
        let stops = [Stop::Coast, Stop::Brake];
        let to = |why| stops.map(|stop| next(from, why, stop));
        ALL.into_iter()
            .filter(|why| !matches!(why, Why::Tripped(_)))
            .flat_map(to)
            .flatten()
            .collect()
    }

    #[test]
    fn nothing_drives_and_nothing_sounds_but_behind_sense_and_charge() {
        for from in [Phase::Idle, Phase::Sense, Phase::Tone] {
            let led_to = led_to(from);
            assert!(!led_to.is_empty());
            assert!(led_to.iter().all(|to| !to.drives()), "{from:?}: {led_to:?}");
            assert!(!led_to.contains(&Phase::Tone), "{from:?}: {led_to:?}");
        }
        // The low sides have kept the drivers charged.
        let driving: Vec<_> = led_to(Phase::Brake);
        let begun = [Phase::Park, Phase::Run];
        assert!(driving.iter().all(|to| !to.drives() || begun.contains(to)));
    }

    #[test]
    fn a_fault_turns_the_bridge_off_in_each_phase() {
        for from in Phase::ALL {
            let to = next(from, Why::Tripped(Fault::Stuck), Stop::Brake);
            assert_eq!(to, Some(Phase::Idle), "{from:?}");
        }
    }

    #[test]
    fn each_phase_is_left_and_each_is_come_to() {
        let all: Vec<_> = Phase::ALL.into_iter().flat_map(led_to).collect();
        for phase in Phase::ALL {
            assert!(all.contains(&phase), "{phase:?} is never come to");
            assert!(!led_to(phase).is_empty(), "{phase:?} is never left");
        }
    }
}
