//! The rows of the table.

use crate::generator::{Wire, word};
use crate::{DRILL, decode, drill, rows};

#[test]
fn a_wrong_bit_is_shown_with_the_sent_value() {
    for bidirectional in [false, true] {
        let mut wire = Wire::new(bidirectional);
        for frame in 0..100 {
            let bits = word(1046, true, bidirectional) ^ if frame == 70 { 0x0040 } else { 0 };
            wire.frame(1e6 + f64::from(frame) * 250e3, bits, 600e3);
        }
        let (rows, summary) = rows(wire.saleae(24.0), &[]);
        assert_eq!((&summary["good"], &summary["bad"]), (&99.into(), &1.into()));
        assert_eq!(rows.len(), 3, "{rows:?}");
        let sum = word(1046, true, bidirectional) & 0xF;
        let error = format!("check sum {sum:x}, not {:x}", sum ^ 4);
        assert_eq!(rows[1]["error"], error, "{rows:?}");
        assert_eq!(rows[1]["bits"], word(1046, true, bidirectional) ^ 0x0040);
        assert_eq!(rows[1]["time_s"], 0.0185);
        assert_eq!(
            (&rows[0]["times"], &rows[2]["times"]),
            (&70.into(), &29.into())
        );
    }
}

#[test]
fn replies_are_shown_with_their_errors() {
    let mut wire = Wire::new(true);
    for frame in 0..100 {
        let at_ns = 1e6 + f64::from(frame) * 250e3;
        let end_ns = wire.frame(at_ns, word(0, false, true), 600e3);
        let data: u16 = match frame {
            50 => 0x219,
            51 => 0xE00,
            _ => 0xFFF,
        };
        let sum = !(data ^ data >> 4 ^ data >> 8) & 0xF;
        // One has a wrong check sum, one is missing, and their clock is 4 % slow.
        match frame {
            52 => wire.reply(end_ns + 25e3, data << 4 | sum ^ 1, 720e3),
            53 => {}
            _ => wire.reply(end_ns + 35e3, data << 4 | sum, 720e3),
        }
    }
    let (rows, summary) = rows(wire.saleae(24.0), &[]);
    assert_eq!(
        (&summary["good"], &summary["bad"]),
        (&100.into(), &0.into())
    );
    assert_eq!(summary["replies_good"], 98);
    assert_eq!(summary["replies_bad"], 1);
    assert_eq!(summary["replies_missing"], 1);
    let replies: Vec<_> = rows.iter().map(|row| &row["reply"]).collect();
    assert_eq!(replies.len(), 6, "{rows:?}");
    assert_eq!(replies[0]["erpm"], 0);
    assert_eq!(replies[1]["extended"], "25 \u{b0}C");
    assert_eq!(replies[2]["extended"], "extended telemetry is on");
    assert_eq!(replies[3]["error"], "check sum");
    assert_eq!(replies[4]["error"], "none");
    let delay_us = &summary["reply_delay_us"];
    for (bound, meant) in [("min", 25.0), ("max", 35.0)] {
        let delay_us = delay_us[bound].as_f64().expect("a time");
        assert!((delay_us - meant).abs() < 0.1, "{delay_us}");
    }
}

#[test]
fn the_table_has_a_row_per_run_of_equal_frames_or_per_frame() {
    let capture = drill(300e3, true).saleae(24.0);
    let (status, out, err) = decode(&capture, &[]);
    assert_eq!((status, err.as_str()), (0, ""));
    let table: Vec<_> = out.lines().take_while(|line| !line.is_empty()).collect();
    assert_eq!(table.len(), 1 + DRILL.len(), "{out}");
    assert_eq!(
        table[4],
        "    0.036500      29  0x82c9  1046 throttle 49.9 %            120000 eRPM"
    );
    let (_, out, _) = decode(&capture, &["--all"]);
    assert_eq!(out.lines().take_while(|line| !line.is_empty()).count(), 101);
}

#[test]
fn replies_of_a_turning_motor_share_a_row() {
    let mut wire = Wire::new(true);
    // The fifth is missing, and the eighth carries a temperature.
    let data: [Option<u16>; 10] = [
        Some(0x1F4),
        Some(0x1F0),
        Some(0x1F8),
        Some(0x1F4),
        None,
        Some(0x1F0),
        Some(0x1F0),
        Some(0x219),
        Some(0x1F0),
        Some(0x1F4),
    ];
    for (at_ms, data) in (1..).zip(data) {
        let end_ns = wire.frame(f64::from(at_ms) * 1e6, word(1046, false, true), 600e3);
        if let Some(data) = data {
            let sum = !(data ^ data >> 4 ^ data >> 8) & 0xF;
            wire.reply(end_ns + 30e3, data << 4 | sum, 750e3);
        }
    }
    let capture = wire.saleae(24.0);
    let (_, out, _) = decode(&capture, &[]);
    let table: Vec<_> = out
        .lines()
        .skip(1)
        .take_while(|line| !line.is_empty())
        .collect();
    let shown: Vec<_> = table
        .iter()
        .map(|line| (line[12..20].trim(), line[62..].trim()))
        .collect();
    // Periods of 496, 500 and 504 us.
    let meant = [
        ("4", "119047 to 120967 eRPM"),
        ("1", "none"),
        ("2", "120967 eRPM"),
        ("1", "25 \u{b0}C"),
        ("2", "120000 to 120967 eRPM"),
    ];
    assert_eq!(shown, meant, "{out}");
    let (rows, _) = rows(&capture, &[]);
    let reply = &rows[0]["reply"];
    assert_eq!(
        (&reply["erpm"], &reply["erpm_min"]),
        (&120_000.into(), &119_047.into())
    );
    assert_eq!(reply["erpm_max"], 120_967);
}
