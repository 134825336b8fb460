//! Tunes that the motor plays: the notes of each, and which is due.
//!
//! A tune tells the user what the ESC has found, so no two sound alike. The drive plays a note
//! without turning the motor; see [`Setpoint::Tone`](crate::drive::Setpoint::Tone).

use siskin_throttle::command::Beacon;

/// The tunes of the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tune {
    /// Powered up: three rising notes, over before a wire can be armed with the defaults.
    Start,
    /// The wire is armed: one high note.
    Armed,
    /// An armed wire has lost its signal: three low pulses.
    Lost,
    /// The throttle was not at zero when the signal came: two falling notes, twice.
    OpenThrottle,
    /// The high end of the stick's range is taken: two short notes.
    Calibrating,
    /// The stick's range is stored: two short notes and a high one.
    Calibrated,
    /// A flight controller searches for its aircraft: one note.
    Beacon(Beacon),
}

/// One sound of a tune.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Note {
    /// Silence.
    Rest,
    /// A note's frequency.
    Pitch {
        /// 500 to 3000 Hz.
        hz: u16,
    },
}

/// A note and its duration, ms.
type Timed = (Note, u16);

const fn note(hz: u16, for_ms: u16) -> Timed {
    (Note::Pitch { hz }, for_ms)
}

const fn rest(for_ms: u16) -> Timed {
    (Note::Rest, for_ms)
}

/// Pitches, Hz.
const D5: u16 = 587;
const G5: u16 = 784;
const B5: u16 = 988;
const C6: u16 = 1047;
const D6: u16 = 1175;
const E6: u16 = 1319;
const G6: u16 = 1568;
const B6: u16 = 1976;
const C7: u16 = 2093;

/// The end of every tune: a pause in which the low sides brake the movement left by the last note.
const END: Timed = rest(20);

impl Tune {
    /// Returns its notes in order, without the [`END`].
    const fn notes(self) -> &'static [Timed] {
        const START: &[Timed] = &[note(C6, 80), rest(15), note(E6, 80), rest(15), note(G6, 80)];
        const ARMED: &[Timed] = &[note(C7, 150)];
        const LOST: &[Timed] = &[
            note(D5, 100),
            rest(60),
            note(D5, 100),
            rest(60),
            note(D5, 100),
        ];
        const OPEN_THROTTLE: &[Timed] = &[
            note(G6, 80),
            note(C6, 80),
            rest(60),
            note(G6, 80),
            note(C6, 80),
        ];
        const CALIBRATING: &[Timed] = &[note(E6, 60), rest(60), note(E6, 60)];
        const CALIBRATED: &[Timed] = &[
            note(E6, 60),
            rest(60),
            note(E6, 60),
            rest(60),
            note(C7, 200),
        ];
        // 250 ms with the end: flight controllers wait 260 ms for one.
        const BEACONS: [&[Timed]; 5] = [
            &[note(G5, 230)],
            &[note(B5, 230)],
            &[note(D6, 230)],
            &[note(G6, 230)],
            &[note(B6, 230)],
        ];
        match self {
            Self::Start => START,
            Self::Armed => ARMED,
            Self::Lost => LOST,
            Self::OpenThrottle => OPEN_THROTTLE,
            Self::Calibrating => CALIBRATING,
            Self::Calibrated => CALIBRATED,
            Self::Beacon(beacon) => BEACONS[beacon as usize],
        }
    }
}

/// Plays one tune at a time. Times are in µs from any origin, and monotonic.
#[derive(Clone, Copy, Debug, Default)]
pub struct Player {
    playing: Option<Playing>,
}

#[derive(Clone, Copy, Debug)]
struct Playing {
    tune: Tune,
    since_us: u64,
}

impl Player {
    /// Begins a tune in place of the one playing. If it already plays it goes on: callers may ask
    /// repeatedly.
    pub fn play(&mut self, now_us: u64, tune: Tune) {
        let goes_on = self.playing.is_some_and(|playing| playing.tune == tune);
        if !goes_on || self.note(now_us).is_none() {
            self.playing = Some(Playing {
                tune,
                since_us: now_us,
            });
        }
    }

    /// Restarts the tune now, since the motor cannot be heard yet.
    pub fn wait(&mut self, now_us: u64) {
        if self.note(now_us).is_some()
            && let Some(playing) = &mut self.playing
        {
            playing.since_us = now_us;
        }
    }

    /// Ends the tune.
    pub fn stop(&mut self) {
        self.playing = None;
    }

    /// Returns the note that is due; `None` if no tune plays.
    pub fn note(&self, now_us: u64) -> Option<Note> {
        let playing = self.playing?;
        let mut left_us = now_us.saturating_sub(playing.since_us);
        for (note, for_ms) in playing.tune.notes().iter().chain([&END]) {
            let for_us = u64::from(*for_ms) * 1000;
            if left_us < for_us {
                return Some(*note);
            }
            left_us -= for_us;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const BEACONS: [Beacon; 5] = [
        Beacon::One,
        Beacon::Two,
        Beacon::Three,
        Beacon::Four,
        Beacon::Five,
    ];

    fn all() -> Vec<Tune> {
        let named = [
            Tune::Start,
            Tune::Armed,
            Tune::Lost,
            Tune::OpenThrottle,
            Tune::Calibrating,
            Tune::Calibrated,
        ];
        let beacons = BEACONS.map(Tune::Beacon);
        named.into_iter().chain(beacons).collect()
    }

    /// Returns each note with the time it is heard, ms, for a caller that looks every ms.
    fn heard(tune: Tune) -> Vec<(Note, u32)> {
        let mut player = Player::default();
        player.play(5_000_000, tune);
        let mut heard: Vec<(Note, u32)> = Vec::new();
        let mut now_us = 5_000_000;
        while let Some(note) = player.note(now_us) {
            match heard.last_mut() {
                Some((last, for_ms)) if *last == note => *for_ms += 1,
                _ => heard.push((note, 1)),
            }
            now_us += 1000;
        }
        heard
    }

    fn length_ms(tune: Tune) -> u32 {
        heard(tune).iter().map(|(_, for_ms)| for_ms).sum()
    }

    #[test]
    fn no_two_tunes_sound_alike() {
        let tunes: Vec<_> = all().into_iter().map(heard).collect();
        for (n, tune) in tunes.iter().enumerate() {
            assert!(!tunes[n + 1..].contains(tune), "{tune:?}");
        }
    }

    #[test]
    fn every_pitch_is_one_that_the_drive_plays_and_every_tune_ends_with_a_note() {
        for tune in all() {
            for (note, _) in tune.notes() {
                if let Note::Pitch { hz } = note {
                    assert!((500..=3000).contains(hz), "{tune:?}: {hz} Hz");
                }
            }
            assert!(tune.notes().last().is_some_and(|last| last.0 != Note::Rest));
        }
    }

    #[test]
    fn tunes_are_as_long_as_their_users_wait() {
        // Arming takes 300 ms, and a flight controller waits 260 ms for a beacon.
        assert!(length_ms(Tune::Start) < 300);
        assert!(length_ms(Tune::Armed) <= 200);
        for beacon in BEACONS {
            assert_eq!(length_ms(Tune::Beacon(beacon)), 250);
        }
    }

    #[test]
    fn the_start_rises_and_so_do_the_beacons() {
        let pitches = |tune: Tune| {
            let notes = tune.notes().iter();
            notes.filter_map(|(note, _)| match note {
                Note::Pitch { hz } => Some(*hz),
                Note::Rest => None,
            })
        };
        assert!(pitches(Tune::Start).is_sorted_by(|a, b| a < b));
        assert_eq!(pitches(Tune::Start).count(), 3);
        let beacons = BEACONS.map(|beacon| pitches(Tune::Beacon(beacon)).sum::<u16>());
        assert!(beacons.is_sorted_by(|a, b| a < b), "{beacons:?}");
    }

    #[test]
    fn a_tune_asked_for_again_goes_on_and_another_takes_its_place() {
        let mut player = Player::default();
        let beacon = Tune::Beacon(Beacon::One);
        player.play(0, beacon);
        player.play(200_000, beacon);
        assert!(player.note(249_999).is_some());
        assert_eq!(player.note(250_000), None);
        // It is over: this is a second one.
        player.play(260_000, beacon);
        assert!(player.note(500_000).is_some());
        player.play(500_000, Tune::Armed);
        assert_eq!(player.note(500_000), Some(Note::Pitch { hz: C7 }));
    }

    #[test]
    fn a_tune_that_must_wait_begins_anew_and_one_that_is_over_does_not() {
        let mut player = Player::default();
        player.play(0, Tune::Start);
        for now_us in (0..2_000_000).step_by(1000) {
            player.wait(now_us);
            assert_eq!(player.note(now_us), Some(Note::Pitch { hz: C6 }));
        }
        assert_eq!(player.note(2_200_000), Some(Note::Pitch { hz: G6 }));
        player.wait(2_400_000);
        assert_eq!(player.note(2_400_000), None);
        player.stop();
        assert_eq!(player.note(0), None);
    }
}
