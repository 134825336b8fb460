use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use siskin_params::{ParamId, Params, TABLE};

use super::word::key;
use super::word::{Word, Writer};
use super::*;
use crate::mavlink::{Intervals, KeptSigning, Key};
use crate::statistics::Statistics;
use flash::{PAGE, RANGE, RamFlash, WORD};
use random::Random;

mod flash;
mod power;
mod random;
mod rot;

fn changed() -> Kept {
    let mut params = Params::default();
    params.set(ParamId::MotPolePairs, 7.0).expect("in range");
    params.set(ParamId::LimPhaseA, 12.5).expect("in range");
    Kept {
        params,
        ..Kept::default()
    }
}

/// Every value differs from its default, as far as the table's range has two.
fn everything(shift: f32) -> Kept {
    let mut kept = Kept::default();
    for id in ParamId::ALL {
        let entry = id.entry();
        let value = libm::floorf(entry.min + shift * (entry.max - entry.min));
        if entry.kind.is_kept() {
            kept.params
                .set(id, value.max(entry.min))
                .expect("between its ends");
        }
    }
    for word in 0..Intervals::WORDS {
        assert!(kept.intervals.set_word(word, 1_000 + word as u32));
    }
    for word in 0..Statistics::WORDS {
        assert!(kept.statistics.set_word(word, (7.0 + shift).to_bits()));
    }
    kept.signing = Some(KeptSigning {
        key: Key([(200.0 * shift) as u8; 32]),
        newest: 99,
    });
    kept.owed_s = (1_000.0 * shift) as u32;
    kept
}

fn sound(flash: &mut RamFlash) -> Kept {
    let loaded = load(flash, RANGE);
    assert_eq!(loaded.integrity, Integrity::Sound);
    assert_eq!(loaded.trouble(), None);
    loaded.kept
}

/// Stores arbitrary words as the first set.
fn store(flash: &mut RamFlash, words: &[(u16, u32)]) {
    let mut writer = Writer::new(0, 1);
    for (key, bits) in words {
        writer.put(flash, *key, *bits).expect("fits");
    }
    writer.seal(flash).expect("fits");
}

/// Returns the newest set's words without its seal.
fn stored(flash: &mut RamFlash) -> Vec<(u16, u32)> {
    let values = Log::open(flash, RANGE).expect("two pages").newest.values;
    values
        .step_by(WORD)
        .map(|at| {
            let word = Word::read(flash, at).expect("it can be read");
            (word.key, word.bits)
        })
        .collect()
}

#[test]
fn nothing_stored_gives_the_defaults() {
    let loaded = load(&mut RamFlash::new(), RANGE);
    assert_eq!(
        (loaded.kept, loaded.integrity),
        (Kept::default(), Integrity::Empty)
    );
}

#[test]
fn values_survive_and_nothing_is_written_twice() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &Kept::default()).expect("nothing to write");
    assert_eq!(flash.bytes, RamFlash::new().bytes);
    save(&mut flash, RANGE, &changed()).expect("fits");
    // Schema, two values and seal, twice.
    assert_eq!(flash.bytes[8 * WORD..], RamFlash::new().bytes[8 * WORD..]);
    let before = flash.bytes.clone();
    save(&mut flash, RANGE, &changed()).expect("nothing to write");
    assert_eq!(flash.bytes, before);
    // MOT_KV follows, though it is not stored.
    assert_eq!(sound(&mut flash), changed());

    // The stored value must not come back.
    save(&mut flash, RANGE, &Kept::default()).expect("fits");
    assert_eq!(sound(&mut flash), Kept::default());
}

#[test]
fn halves_wrap_under_thousands_of_saves() {
    let mut flash = RamFlash::new();
    let mut kept = changed();
    // More saves than set numbers.
    for i in 0..70_000_u32 {
        let value = 100.0 + (i % 5000) as f32;
        kept.params
            .set(ParamId::CtlRpmMax, value)
            .expect("in range");
        save(&mut flash, RANGE, &kept).expect("fits");
        if i % 997 == 0 {
            assert_eq!(sound(&mut flash), kept, "{i}");
        }
    }
    // 40 bytes per set: 51 sets fit a half, written two at a time.
    assert_eq!(flash.erases, 2 * 70_000 / 51);
}

/// Only what changes by itself is written once.
#[test]
fn settings_are_written_twice_and_statistics_once() {
    let sets = |flash: &RamFlash| {
        let words = flash.bytes.chunks(WORD);
        words.filter(|word| word[..2] == [0, 0]).count()
    };
    let mut flash = RamFlash::new();
    let mut kept = changed();
    save(&mut flash, RANGE, &kept).expect("fits");
    assert_eq!(sets(&flash), 2);
    for run_s in 1..4 {
        kept.statistics.run_s = run_s;
        save(&mut flash, RANGE, &kept).expect("fits");
    }
    assert_eq!(sets(&flash), 5);
    for (newest, wanted) in [(0, 7), (1, 8), (u32::MAX, 9)] {
        let key = Key([7; 32]);
        kept.signing = Some(KeptSigning { key, newest });
        save(&mut flash, RANGE, &kept).expect("fits");
        assert_eq!(
            sets(&flash),
            wanted,
            "the key is a setting, and its time none"
        );
    }
    assert_eq!(sound(&mut flash), kept);
}

/// As the module's documentation says.
#[test]
fn the_pages_last_for_so_many_changes() {
    const PAGE_ERASES: usize = 10_000;
    let few = |shift: f32| {
        let mut kept = everything(shift);
        kept.params = Params::default();
        let writable = |id: &ParamId| id.entry().kind.is_kept();
        for id in ParamId::ALL.into_iter().filter(writable).take(40) {
            let value = everything(shift).params.get(id);
            kept.params.set(id, value).expect("in range");
        }
        kept
    };
    for (make, lasts) in [
        (everything as fn(f32) -> Kept, 20_000),
        (few as fn(f32) -> Kept, 40_000),
    ] {
        let mut flash = RamFlash::new();
        for i in 0..400 {
            let kept = make([0.25, 0.75][i % 2]);
            save(&mut flash, RANGE, &kept).expect("fits");
            assert_eq!(sound(&mut flash), kept);
        }
        let changes = 400 * PAGE_ERASES / flash.erases.div_ceil(RANGE.len() / PAGE);
        assert!(changes >= lasts, "{changes}");
    }
}

#[test]
fn what_is_replaced_is_nowhere_in_the_flash() {
    let mut flash = RamFlash::new();
    store(&mut flash, &[(9999, 1)]);
    for shift in [0.25, 0.5, 0.75] {
        save(&mut flash, RANGE, &everything(shift)).expect("fits");
    }
    let rest = Kept {
        statistics: everything(0.75).statistics,
        ..Kept::default()
    };
    replace(&mut flash, RANGE, &rest).expect("fits");
    assert_eq!(sound(&mut flash), rest);
    // Schema, statistics and seal, twice.
    let written = flash
        .bytes
        .chunks(WORD)
        .filter(|word| word != &[0xff; WORD]);
    assert_eq!(written.count(), 2 * (2 + Statistics::WORDS));
}

#[test]
fn what_another_firmware_stored_is_told_and_stays() {
    let mut flash = RamFlash::new();
    let kv = ParamId::MotKv.entry().key;
    let foreign = [(9999, 1), (kv, 5)];
    store(&mut flash, &foreign);
    let loaded = load(&mut flash, RANGE);
    assert_eq!(loaded.kept, Kept::default());
    assert!(loaded.unknown && !loaded.out_of_range);
    assert_eq!(
        loaded.trouble(),
        Some("storage: values of another firmware are kept")
    );

    for kept in [changed(), everything(0.25), Kept::default()] {
        save(&mut flash, RANGE, &kept).expect("fits");
        assert_eq!(load(&mut flash, RANGE).kept, kept);
        assert_eq!(stored(&mut flash)[1..3], foreign);
    }
}

#[test]
fn a_value_out_of_range_is_told_until_the_next_save() {
    let id = ParamId::MotPolePairs;
    let interval = 0x1100;
    let temperature = 0x1202;
    for (key, bits) in [
        (id.entry().key, (-3.0_f32).to_bits()),
        (id.entry().key, 7.5_f32.to_bits()),
        (id.entry().key, f32::NAN.to_bits()),
        (interval, 0x8000_0000),
        (temperature, f32::INFINITY.to_bits()),
    ] {
        let mut flash = RamFlash::new();
        let limit = ParamId::LimPhaseA.entry().key;
        store(&mut flash, &[(key, bits), (limit, 12.5_f32.to_bits())]);
        let loaded = load(&mut flash, RANGE);
        assert!(loaded.out_of_range && !loaded.unknown, "{key}");
        let trouble = "storage: out of range, using some defaults";
        assert_eq!(loaded.trouble(), Some(trouble));
        let mut wanted = Kept::default();
        wanted
            .params
            .set(ParamId::LimPhaseA, 12.5)
            .expect("in range");
        assert_eq!(loaded.kept, wanted, "{key}");

        save(&mut flash, RANGE, &loaded.kept).expect("fits");
        assert_eq!(sound(&mut flash), wanted);
    }
}

#[test]
fn every_trouble_fits_a_text() {
    let mut loaded = load(&mut RamFlash::new(), RANGE);
    loaded.unknown = true;
    let mut count = 0;
    for integrity in [
        Integrity::Sound,
        Integrity::Incomplete,
        Integrity::Unfinished,
        Integrity::Corrupt,
        Integrity::Unreadable,
    ] {
        for out_of_range in [false, true] {
            loaded.integrity = integrity;
            loaded.out_of_range = out_of_range;
            let trouble = loaded.trouble().expect("there is some");
            assert!(trouble.len() <= 50, "{trouble}");
            count += 1;
        }
    }
    assert_eq!(count, 10);
}

#[test]
fn a_range_that_is_not_pages_is_refused() {
    let mut flash = RamFlash::new();
    for range in [
        0..2048,
        8..4096,
        0..4000,
        Range {
            start: 4096,
            end: 0,
        },
    ] {
        assert_eq!(
            save(&mut flash, range.clone(), &changed()),
            Err(StoreError::BadRange)
        );
        assert_eq!(load(&mut flash, range).integrity, Integrity::Unreadable);
    }
}

#[test]
fn a_flash_that_cannot_be_read_gives_the_defaults() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &changed()).expect("fits");
    // Whenever reads start to fail.
    let mut all = flash.clone();
    assert_eq!(sound(&mut all), changed());
    for reads in 0..all.reads - flash.reads {
        let mut flash = flash.clone();
        flash.reads_left = reads;
        let loaded = load(&mut flash, RANGE);
        let wanted = (Kept::default(), Integrity::Unreadable);
        assert_eq!((loaded.kept, loaded.integrity), wanted, "{reads} reads");
    }
}

#[test]
fn keys_are_told_apart() {
    assert!(
        TABLE
            .iter()
            .all(|parameter| key::SEAL < parameter.key && parameter.key < key::SCHEMA)
    );
    for word in 0..Kept::WORDS {
        let key = Kept::key(word);
        assert!(key != key::SEAL && key != key::SCHEMA);
        let others = [ParamId::MotKv, ParamId::MotIdentify];
        let is_kept = others.iter().all(|id| id.entry().key != key);
        assert_eq!(Kept::find(key), is_kept.then_some(word));
    }
}

proptest! {
    // Always the same cases: a run is repeatable, and noise may be valid by chance, once in 2^32.
    #![proptest_config(ProptestConfig {
        cases: 500,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn rotten_bytes_are_noticed_and_healed(
        rot in prop::collection::vec((0..RANGE.end as usize, any::<u8>()), 1..40),
    ) {
        let mut flash = RamFlash::new();
        save(&mut flash, RANGE, &changed()).expect("fits");
        for (at, byte) in rot {
            flash.bytes[at] = byte;
        }
        let loaded = load(&mut flash, RANGE);
        if loaded.integrity == Integrity::Sound {
            prop_assert_eq!(&loaded.kept, &changed());
        }
        let mut wanted = changed();
        wanted.params.set(ParamId::CtlRpmMax, 5000.0).expect("in range");
        save(&mut flash, RANGE, &wanted).expect("heals");
        let loaded = load(&mut flash, RANGE);
        prop_assert_eq!(loaded.integrity, Integrity::Sound);
        prop_assert_eq!(loaded.kept, wanted);
    }

    #[test]
    fn any_bytes_load_and_can_be_saved_over(
        bytes in prop::collection::vec(any::<u8>(), RANGE.end as usize),
        blank in prop::collection::vec(any::<bool>(), 16),
    ) {
        let mut bytes = bytes;
        for (part, blank) in bytes.chunks_mut(256).zip(blank) {
            if blank {
                part.fill(0xff);
            }
        }
        let mut flash = RamFlash::holding(bytes);
        let loaded = load(&mut flash, RANGE);
        prop_assert_ne!(loaded.integrity, Integrity::Sound);
        prop_assert_eq!(loaded.kept, Kept::default());
        save(&mut flash, RANGE, &changed()).expect("erases what it cannot use");
        prop_assert_eq!(load(&mut flash, RANGE).kept, changed());
    }

    #[test]
    fn noise_is_never_taken_for_nothing(
        bytes in prop_oneof![
            prop::collection::vec(any::<u8>(), RANGE.end as usize),
            // Mostly erased, mostly zeros, and the log's own markers.
            prop::collection::vec(prop_oneof![Just(0xFF), Just(0xFE), Just(0x7F)], RANGE.end as usize),
            prop::collection::vec(prop_oneof![Just(0), Just(1), Just(0x80)], RANGE.end as usize),
            prop::collection::vec(prop_oneof![Just(0xFF), Just(0), any::<u8>()], RANGE.end as usize),
            any::<u8>().prop_map(|byte| vec![byte; RANGE.end as usize]),
            // Erased except for one byte.
            (0..RANGE.end as usize, any::<u8>()).prop_map(|(at, byte)| {
                let mut bytes = vec![0xFF; RANGE.end as usize];
                bytes[at] = byte;
                bytes
            }),
        ],
    ) {
        prop_assume!(bytes.iter().any(|byte| *byte != 0xFF));
        let loaded = load(&mut RamFlash::holding(bytes), RANGE);
        prop_assert_ne!(loaded.integrity, Integrity::Empty);
        prop_assert_ne!(loaded.integrity, Integrity::Sound);
        prop_assert_eq!(loaded.kept, Kept::default());
    }
}
