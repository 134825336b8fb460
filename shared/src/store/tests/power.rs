//! Power failures at every write and every erase.

use super::*;

/// A change of the stored values.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Act {
    Save,
    Replace,
}

impl Act {
    fn run(self, flash: &mut RamFlash, kept: &Kept) -> Result<(), StoreError> {
        match self {
            Self::Save => save(flash, RANGE, kept),
            Self::Replace => replace(flash, RANGE, kept),
        }
    }
}

/// Saves and resets of random values, each cut off at every word and page, with random bits left there. One
/// continues from any of the wrecks, and cuts off the next save too.
#[test]
fn every_loss_of_power_leaves_all_old_or_all_new_values() {
    let mut random = Random::new(1);
    let mut flash = RamFlash::new();
    let mut old = Kept::default();
    let (mut cuts, mut olds, mut news, mut wrecks) = (0, 0, 0, 0);
    while cuts < 30_000 {
        let (act, mut new) = if random.below(30) == 0 {
            let statistics = old.statistics;
            let reset = Kept {
                statistics,
                ..Kept::default()
            };
            (Act::Replace, reset)
        } else {
            (Act::Save, old.clone())
        };
        for _ in 0..=random.below(4) {
            random.change(&mut new);
        }
        let mut steps = 1;
        let mut left = Vec::new();
        loop {
            let mut cut = flash.clone();
            cut.steps_left = steps;
            cut.chance = Random::new(cuts);
            let done = act.run(&mut cut, &new);
            if cut.steps_left > 0 {
                // It finished before the cut.
                done.expect("the power was there");
                break;
            }
            assert_eq!(done, Err(StoreError::Flash));
            cut.steps_left = usize::MAX;
            let found = load(&mut cut, RANGE).kept;
            assert!(found == old || found == new, "{cuts}: {act:?} at {steps}");
            olds += u32::from(found == old && old != new);
            news += u32::from(found == new && old != new);
            left.push((cut, found));
            cuts += 1;
            steps += 1;
        }
        if random.below(3) == 0 && !left.is_empty() {
            (flash, old) = left.swap_remove(random.below(left.len()));
            wrecks += 1;
        } else {
            act.run(&mut flash, &new).expect("the power is there");
            assert_eq!(sound(&mut flash), new);
            old = new;
        }
    }
    // Cuts fall before the first copy's seal, or after it.
    assert!(olds > 10_000 && news > 10_000, "{olds} old, {news} new");
    assert!(wrecks > 100, "{wrecks}");
}

#[test]
fn the_first_save_is_not_taken_for_corruption() {
    for wanted in [changed(), everything(0.25)] {
        let mut steps = 1;
        loop {
            let mut flash = RamFlash::new();
            flash.steps_left = steps;
            flash.chance = Random::new(steps as u64);
            let done = save(&mut flash, RANGE, &wanted).is_ok();
            flash.steps_left = usize::MAX;
            let loaded = load(&mut flash, RANGE);
            if done {
                assert_eq!((loaded.kept, loaded.integrity), (wanted, Integrity::Sound));
                break;
            }
            // The first of the copies, or none.
            let wanted = if loaded.integrity == Integrity::Unfinished {
                Kept::default()
            } else {
                wanted.clone()
            };
            assert_ne!(loaded.integrity, Integrity::Corrupt, "{steps} steps");
            assert_eq!(loaded.kept, wanted, "{steps} steps");
            steps += 1;
        }
        assert!(steps > 4, "{steps}");
    }
}
