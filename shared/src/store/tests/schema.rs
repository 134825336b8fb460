//! Values of older firmware.

use super::*;

/// The limit was stored in quarters of an ampere under the key 300, then in A under 301; then it got its key of now. The
/// pole pairs were poles once.
fn changes() -> [Change; 3] {
    let limit = ParamId::LimPhaseA.entry().key;
    let poles = ParamId::MotPolePairs.entry().key;
    [
        (1, 300, 301, 0.25),
        (2, 301, limit, 1.0),
        (2, poles, poles, 0.5),
    ]
    .map(|(from, old, new, factor)| Change {
        from,
        old,
        new,
        factor,
    })
}

#[test]
fn what_was_renamed_or_rescaled_is_found() {
    let limit = ParamId::LimPhaseA.entry().key;
    let poles = ParamId::MotPolePairs.entry().key;
    for (schema, key, value, number) in [
        (1, 300, 50.0, 14.0),
        (2, 301, 12.5, 14.0),
        (3, limit, 12.5, 7.0),
    ] {
        let mut flash = RamFlash::new();
        let words = [(key::SCHEMA, schema), (key, f32::to_bits(value))];
        let poles = (poles, f32::to_bits(number));
        store(&mut flash, &[words[0], words[1], poles]);
        let loaded = load_changed(&mut flash, RANGE, &changes());
        assert_eq!(loaded.kept, changed(), "schema {schema}");
        assert!(!loaded.unknown && !loaded.out_of_range);
    }
}

#[test]
fn an_old_key_has_no_other_meaning_later() {
    let mut flash = RamFlash::new();
    let value = 50_f32.to_bits();
    store(&mut flash, &[(key::SCHEMA, 3), (300, value)]);
    let loaded = load_changed(&mut flash, RANGE, &changes());
    assert_eq!(loaded.kept, Kept::default());
    assert!(loaded.unknown);
}

#[test]
fn what_was_renamed_is_not_kept_twice() {
    let changes = changes();
    let mut flash = RamFlash::new();
    let value = 50_f32.to_bits();
    store(&mut flash, &[(key::SCHEMA, 1), (300, value), (9999, 5)]);
    let kept = load_changed(&mut flash, RANGE, &changes).kept;
    let log = Log::open(&mut flash, RANGE).expect("two pages");
    let content = Content::new(&kept, log.newest.values(&changes));
    log.append(&mut flash, &content).expect("fits");
    let limit = ParamId::LimPhaseA.entry().key;
    let wanted = [
        (key::SCHEMA, SCHEMA),
        (9999, 5),
        (limit, 12.5_f32.to_bits()),
    ];
    assert_eq!(stored(&mut flash), wanted);
}

/// The rows that this firmware has: a schema is named for each, and none is of a schema to come.
#[test]
fn changes_are_in_the_order_of_their_schemas() {
    let from = || CHANGES.iter().map(|change| change.from);
    assert!(from().is_sorted());
    assert_eq!(from().next_back().unwrap_or(0) + 1, SCHEMA);
}
