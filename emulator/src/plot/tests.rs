use std::fmt::Write;
use std::path::Path;

use super::plot;
use super::reduce::{Cell, Trace};
use crate::record::Row;

/// Writes a recording at 24 kHz that parks, runs, loses the rotor and stops. `noise` spreads its
/// values.
fn recording(path: &Path, periods: u32, noise: f64) {
    let mut text = Row::COLUMNS.join(",") + "\n";
    for k in 0..periods {
        let share = f64::from(k) / f64::from(periods);
        let (phase, faults) = match share {
            ..0.1 => ("idle", 0),
            ..0.2 => ("park", 0),
            ..0.3 => ("ramp", 0),
            ..0.8 => ("run", 0),
            ..0.9 => ("stopping", 0),
            _ => ("brake", 16),
        };
        let t_s = f64::from(k) / 24e3;
        let rpm = 3000.0 * share;
        let ripple = noise * f64::from(k * 7919 % 1000);
        writeln!(
            text,
            "{t_s},{phase},{faults},{rpm},{},{rpm},0,0,{ripple},{ripple},0,0,{ripple},{},\
             {ripple},{},,,,24,1,0.1",
            rpm + ripple,
            1.0 - ripple,
            2.0 + ripple,
        )
        .unwrap();
    }
    std::fs::write(path, text).unwrap();
}

/// Returns the texts of a recording's SVG, and the SVG's length.
fn svg(name: &str, periods: u32, noise: f64) -> (Vec<String>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let (record, picture) = (folder.path().join(name), folder.path().join("picture.svg"));
    recording(&record, periods, noise);
    plot(&record, &picture).unwrap();
    let text = std::fs::read_to_string(&picture).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let root = document.root_element();
    assert_eq!(root.attribute("width"), Some("1200"));
    assert_eq!(root.attribute("viewBox"), Some("0 0 2400 2206"));
    let texts = root.descendants().filter(|node| node.has_tag_name("text"));
    let texts = texts.map(|node| node.text().unwrap_or_default().trim().to_owned());
    (texts.collect(), text.len())
}

#[test]
fn a_picture_says_what_it_shows() {
    let (texts, _) = svg("a<b>&c.csv", 2400, 0.001);
    for expected in [
        "a<b>&c.csv: 0.1 s at 24.0 kHz; fault: rotor position lost",
        "time (s)",
        "speed (rpm)",
        "current (A)",
        "voltage (V)",
        "error (el. °)",
        "reference",
        "estimated",
        "i_d",
        "u_q",
        "Park",
        "Ramp",
        "Run",
        "Stopping",
        "Brake",
        "0.04",
        "1000",
        "band: least to greatest, line: mean",
    ] {
        assert!(
            texts.iter().any(|text| text == expected),
            "no {expected} in {texts:?}"
        );
    }
}

#[test]
fn what_is_beyond_an_axis_is_marked() {
    let folder = tempfile::tempdir().unwrap();
    let (record, picture) = (folder.path().join("a.csv"), folder.path().join("a.svg"));
    let texts = || {
        plot(&record, &picture).unwrap();
        let text = std::fs::read_to_string(&picture).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let nodes = document.descendants();
        let texts = nodes.filter(|node| node.has_tag_name("text"));
        let texts = texts.map(|node| node.text().unwrap_or_default().trim().to_owned());
        (
            texts.collect::<Vec<_>>(),
            document
                .descendants()
                .filter(|node| node.has_tag_name("circle"))
                .count(),
        )
    };
    recording(&record, 2400, 0.0);
    let (before, dots) = texts();
    assert!(!before.iter().any(|text| text.starts_with("beyond")));
    assert_eq!(dots, 0);
    // One period in which the estimate is far off.
    let column = Row::COLUMNS
        .iter()
        .position(|name| *name == "angle_error_deg");
    let text = std::fs::read_to_string(&record).unwrap();
    let mut lines: Vec<_> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<_> = lines[1000].split(',').collect();
    cells[column.unwrap()] = "-170.2";
    lines[1000] = cells.join(",");
    std::fs::write(&record, lines.join("\n")).unwrap();
    let (after, dots) = texts();
    assert!(
        after.iter().any(|text| text == "beyond the axis, to -170"),
        "{after:?}"
    );
    assert_eq!(dots, 2, "its mark, and that of the legend");
}

#[test]
fn a_long_recording_gives_a_small_picture() {
    // Noise in every column is the most that there can be to draw.
    let (_, bytes) = svg("long.csv", 72_000, 0.01);
    assert!((50_000..300_000).contains(&bytes), "{bytes} bytes");
}

#[test]
fn two_periods_are_enough() {
    let (texts, _) = svg("short.csv", 2, 0.0);
    assert!(texts.iter().any(|text| text == "time (s)"));
}

#[test]
fn a_png_has_the_figure_on_white() {
    let folder = tempfile::tempdir().unwrap();
    let (record, picture) = (folder.path().join("r.csv"), folder.path().join("r.png"));
    recording(&record, 2400, 0.001);
    plot(&record, &picture).unwrap();
    let file = std::io::BufReader::new(std::fs::File::open(&picture).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (2400, 2206));
    assert_eq!(pixels[..3], [255, 255, 255]);
    let has = |colour: [u8; 3]| pixels.chunks_exact(3).any(|pixel| pixel == colour);
    assert!(has([0x00, 0x72, 0xb2]), "no curve");
    assert!(has([0x22, 0x22, 0x22]), "no text");
}

#[test]
fn a_column_keeps_what_its_samples_span() {
    let mut trace = Trace::new(4);
    for (column, value) in [
        (1, 2.0),
        (1, -4.0),
        (1, f32::NAN),
        (2, 5.0),
        (3, f32::INFINITY),
    ] {
        trace.add(column, value);
    }
    let spans = |outliers| trace.range(outliers, |cell| cell.min, |cell| cell.max);
    assert_eq!(spans(0.0), Some((-4.0, 5.0)));
    assert_eq!(spans(0.5), Some((5.0, 2.0)));
    assert_eq!(trace.range(0.0, Cell::mean, Cell::mean), Some((-1.0, 5.0)));
    let [None, Some(cell), Some(_), None] = trace.cells() else {
        panic!("{trace:?}")
    };
    assert_eq!((cell.min, cell.max, cell.mean()), (-4.0, 2.0, -1.0));
}

#[test]
fn what_cannot_be_drawn_is_one_line_with_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good.csv");
    recording(&good, 10, 0.0);
    let line = |record: &Path, picture: &str| {
        let text = plot(record, &folder.path().join(picture))
            .unwrap_err()
            .to_string();
        assert!(!text.contains('\n'), "{text}");
        text
    };
    let content = |bytes: &[u8]| {
        let path = folder.path().join("bad.csv");
        std::fs::write(&path, bytes).unwrap();
        let text = line(&path, "x.svg");
        assert!(text.contains("bad.csv"), "{text}");
        text
    };
    let text = line(&good, "picture.jpeg");
    assert!(
        text.ends_with("picture.jpeg: the name must end in .svg or .png"),
        "{text}"
    );
    assert!(line(&folder.path().join("none.csv"), "x.svg").contains("cannot read"));
    assert!(line(folder.path(), "x.svg").contains("cannot read"));
    assert!(line(&good, "nowhere/x.svg").contains("cannot write"));

    assert!(content(b"").ends_with("its first line names no column t_s"));
    assert!(content(&[0xff; 100]).ends_with("its first line names no column t_s"));
    assert!(content(b"t_s,rpm\n1,2\n").ends_with("its first line names no column phase"));
    let good = std::fs::read_to_string(&good).unwrap();
    let lines: Vec<_> = good.lines().collect();
    assert!(content(lines[..2].join("\n").as_bytes()).contains("fewer than two"));
    let cut = &good[..good.len() - 10];
    assert!(
        content(cut.as_bytes()).contains("line 11: "),
        "{}",
        content(cut.as_bytes())
    );
    let word = good.replacen("idle", "asleep", 1);
    assert!(content(word.as_bytes()).contains("line 2: unknown variant `asleep`"));
    let letter = good.replacen("\n0,idle,0", "\n0,idle,x", 1);
    assert!(content(letter.as_bytes()).contains("line 2, column 3: "));
    let (_, values) = lines[2].split_once(',').unwrap();
    for t_s in ["nan", "-inf", "1e300", "-1.1e9"] {
        let late = [lines[0], lines[1], &format!("{t_s},{values}")].join("\n");
        assert!(content(late.as_bytes()).ends_with("line 3: t_s is not a time"));
    }
    let backwards = [lines[0], lines[2], lines[1]].join("\n");
    assert!(content(backwards.as_bytes()).ends_with("line 3: t_s does not rise"));
}
