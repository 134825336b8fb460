//! How often settings are stored unasked, which determines the flash's life.

use super::*;
use crate::esc::storage::Storage;

#[test]
fn changes_without_end_are_stored_every_two_seconds() {
    let mut bench = rested();
    let mut stored_ms = Vec::new();
    for step in 0..50 {
        bench.set("LIM_PHASE_A", 10.0 + step as f32 / 10.0);
        for ms in 0..400 {
            bench.wait_ms(1);
            if bench.requests.contains(&Request::Keep) {
                stored_ms.push(400 * step + ms);
                bench.storage_done(Ok(()));
                bench.requests.clear();
            }
        }
    }
    let first = stored_ms.first().copied().expect("there are some");
    assert!(first <= 2_001, "{stored_ms:?}");
    // After a save the next change is up to 0.4 s away.
    assert!(
        stored_ms.windows(2).all(|pair| pair[1] - pair[0] <= 2_401),
        "{stored_ms:?}"
    );
}

/// The flash lasts for 40 000 saves.
#[test]
fn a_day_of_changes_costs_the_flash_a_fiftieth_of_its_life() {
    let mut storage = Storage::default();
    let mut saves = 0;
    let mut now_us = 0;
    let mut change = |storage: &mut Storage| {
        storage.changed(now_us);
        now_us += 1_200_000;
        if storage.waits(now_us) {
            saves += 1;
            assert_eq!(storage.take(now_us), Some(Request::Keep));
            storage.done(true);
        }
        (now_us, saves)
    };
    for person in 1..=100 {
        let (_, saves) = change(&mut storage);
        assert_eq!(saves, person, "who tries values sees each of them stored");
    }
    let mut made = 0;
    while change(&mut storage).0 < 86_400_000_000 {
        made = change(&mut storage).1;
    }
    assert!((500..=800).contains(&made), "{made}");
}

/// A client changes a value and restarts the ESC, which takes a second, for a day.
#[test]
fn a_day_of_restarts_costs_the_flash_a_twenty_fifth_of_its_life() {
    const DAY_MS: u64 = 86_400_000;
    let (mut saves, mut day_ms, mut owed_s) = (0, 0, 0);
    while day_ms < DAY_MS {
        let mut storage = Storage::default();
        storage.recall(owed_s);
        storage.changed(0);
        storage.reboot();
        let mut now_ms = 0;
        while !storage.reboots() {
            if storage.waits(1_000 * now_ms) {
                saves += 1;
                assert_eq!(storage.take(1_000 * now_ms), Some(Request::Keep));
                owed_s = storage.owed_s();
                storage.done(true);
            }
            now_ms += 100;
            assert!(
                now_ms <= 61_000,
                "the change is stored, and the ESC restarts"
            );
        }
        if saves <= 100 {
            assert_eq!(now_ms, 100, "the first hundred are made at once");
        }
        day_ms += now_ms + 1_000;
    }
    assert!((1_400..=1_600).contains(&saves), "{saves}");
}

#[test]
fn the_time_that_saves_owe_is_stored_with_them() {
    let mut bench = rested();
    bench.set("LIM_PHASE_A", 12.5);
    bench.keeps_after_ms();
    let mut loaded = Loaded {
        kept: bench.esc.kept(),
        ..loaded(Integrity::Sound)
    };
    assert_eq!(loaded.kept.owed_s, 180);
    // All are used up.
    loaded.kept.owed_s = 100 * 180;
    let mut bench = Bench::new();
    bench.esc.recall(&loaded);
    bench.wait_ms(3_000);
    bench.set("LIM_PHASE_A", 13.0);
    bench.wait_ms(55_500);
    assert!(!bench.requests.contains(&Request::Keep));
    bench.keeps_after_ms();
    let since_start_us = bench.now_us;
    assert!(
        (60_000_000..60_100_000).contains(&since_start_us),
        "{since_start_us}"
    );
    // A requested one does not wait.
    bench.storage_done(Ok(()));
    bench.requests.clear();
    bench.set("LIM_PHASE_A", 14.0);
    bench.command(STORAGE, 1.0);
    bench.wait_ms(5);
    assert!(bench.requests.contains(&Request::Save));
}
