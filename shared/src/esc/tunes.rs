//! The tunes that the motor plays, and when it may.

use crate::drive::Snapshot;
use crate::tune::{Note, Player, Tune};
use crate::units::Speed;

/// The tune that is being played.
#[derive(Clone, Debug, Default)]
pub(super) struct Tunes {
    player: Player,
    /// The note that is due, as of the last look.
    note: Option<Note>,
    /// Tunes but beacons are off.
    silent: bool,
}

impl Tunes {
    /// Begins a tune. A beacon sounds in silent mode too: whoever asks for it is looking for the craft.
    pub(super) fn play(&mut self, now_us: u64, tune: Tune) {
        if !self.silent || matches!(tune, Tune::Beacon(_)) {
            self.player.play(now_us, tune);
        }
    }

    /// Silent mode on, or off again.
    pub(super) fn toggle_silent(&mut self) {
        self.silent = !self.silent;
        self.player.stop();
    }

    /// The note that is due.
    pub(super) fn note(&self) -> Option<Note> {
        self.note
    }

    /// Finds the note that is due. Throttle, a test and a fault end a tune; one that begins while the
    /// shaft turns is played when it has stopped.
    pub(super) fn look(&mut self, now_us: u64, snapshot: &Snapshot, rests: bool) {
        let turns = snapshot.phase.drives() || snapshot.speed != Speed::ZERO;
        if !rests || !snapshot.faults.is_empty() {
            self.player.stop();
        } else if turns {
            self.player.wait(now_us);
        }
        self.note = self.player.note(now_us).filter(|_| !turns);
    }
}
