//! Tunes that the motor plays, and when it may.

use siskin_units::Speed;

use crate::drive::Snapshot;
use crate::tune::{Note, Player, Tune};

/// The tune being played.
#[derive(Clone, Debug, Default)]
pub(super) struct Tunes {
    player: Player,
    /// The note due at the last poll.
    note: Option<Note>,
    /// Only beacons sound.
    silent: bool,
}

impl Tunes {
    /// Starts a tune. A beacon sounds even in silent mode: whoever asks for it is looking for the craft.
    pub(super) fn play(&mut self, now_us: u64, tune: Tune) {
        if !self.silent || matches!(tune, Tune::Beacon(_)) {
            self.player.play(now_us, tune);
        }
    }

    /// Toggles silent mode.
    pub(super) fn toggle_silent(&mut self) {
        self.silent = !self.silent;
        self.player.stop();
    }

    /// Returns the note that is due.
    pub(super) fn note(&self) -> Option<Note> {
        self.note
    }

    /// Updates the note that is due. Throttle, a test and a fault end a tune; one that starts while the shaft
    /// turns is played when it has stopped.
    pub(super) fn poll(&mut self, now_us: u64, snapshot: &Snapshot, rests: bool) {
        let turns = snapshot.phase.drives() || snapshot.speed != Speed::ZERO;
        if !rests || !snapshot.faults.is_empty() {
            self.player.stop();
        } else if turns {
            self.player.wait(now_us);
        }
        self.note = self.player.note(now_us).filter(|_| !turns);
    }
}
