//! Pseudo-terminals and serial ports.

use std::fs::{self, OpenOptions};
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

use tempfile::tempdir;

use super::*;

/// Opens the terminal as a program that sets nothing.
fn open(path: &Path) -> fs::File {
    let flags = (rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY).bits();
    let mut options = OpenOptions::new();
    options.read(true).write(true).custom_flags(flags as i32);
    options.open(path).unwrap()
}

fn pending(file: &mut fs::File) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(length @ 1..) = file.read(&mut buffer) {
        bytes.extend(&buffer[..length]);
    }
    bytes
}

/// Lets the link notice who is there: at least a byte's time at any rate used here.
fn settle(bench: &mut Bench) {
    for _ in 0..3 {
        bench.now += 5 * MS;
        bench.receive();
    }
}

fn path(bench: &Bench) -> PathBuf {
    match &bench.links.endpoints()[0] {
        Endpoint::Pty {
            link: Some(path), ..
        } => path.clone(),
        other => panic!("{other} is no terminal"),
    }
}

#[test]
fn a_terminal_passes_every_byte_both_ways() {
    let mut bench = Bench::open(&["pty"]);
    let mut reader = open(&path(&bench));
    settle(&mut bench);
    // All values: a terminal that is not raw changes 0x03, 0x0D, 0x11 and more.
    let all: Vec<u8> = (0..=255).collect();
    assert_eq!(bench.links.send(&all), 0);
    let mut found = Vec::new();
    bench.until(5 * MS, |_| {
        found.extend(pending(&mut reader));
        found.len() >= 256
    });
    assert_eq!(found, all);
    reader.write_all(&all).unwrap();
    bench.until(5 * MS, |b| b.heard(&all));
    assert!(pending(&mut reader).is_empty(), "no echo");
}

#[test]
fn bytes_pass_at_the_rate() {
    // 9600 baud: 960 bytes a second, at most 480 of them pending (at least two frames: 560).
    let mut bench = Bench::open(&["pty::9600"]);
    let mut reader = open(&path(&bench));
    settle(&mut bench);
    assert_eq!(bench.links.send(&[1; 280]), 0);
    assert_eq!(bench.links.send(&[2; 280]), 0);
    assert_eq!(bench.links.send(&[3; 1]), 1, "there is no room for a third");
    let start = bench.now;
    let mut found = Vec::new();
    // A poll each ms is 0.96 bytes: after t ms at most 0.96·t bytes have arrived, and at most one
    // fewer once the kernel has passed them on.
    for ms in 1..=600_u32 {
        bench.now = start + ms * MS;
        bench.receive();
        let carried = (ms as usize * 960 / 1000).min(560);
        for _ in 0..1000 {
            found.extend(pending(&mut reader));
            if found.len() >= carried {
                break;
            }
            sleep(MS);
        }
        assert_eq!(found.len(), carried, "after {ms} ms");
    }
    assert_eq!(found, [[1; 280], [2; 280]].concat());

    // The other direction: 2000 bytes wait in the kernel and arrive at the same pace.
    settle(&mut bench);
    reader.write_all(&[4; 2000]).unwrap();
    let mut came = 0;
    let start = bench.now;
    while came < 2000 {
        bench.now += MS;
        bench.receive();
        came = bench.streams.values().map(Vec::len).sum();
        let ms = (bench.now - start).as_millis() as usize;
        assert!(came <= ms * 960 / 1000, "{came} bytes after {ms} ms");
        assert!(ms < 2200, "{came} bytes after {ms} ms");
    }
}

#[test]
fn a_reader_goes_away_and_comes_back() {
    let mut bench = Bench::open(&["pty"]);
    let path = path(&bench);
    // Nobody is there: the frame is lost, as on a line without a listener.
    settle(&mut bench);
    assert_eq!(bench.links.send(b"unheard"), 0);
    settle(&mut bench);

    let mut reader = open(&path);
    reader.write_all(b"here").unwrap();
    bench.until(MS, |b| b.heard(b"here"));
    // What is pending when the reader leaves is lost with it.
    assert_eq!(bench.links.send(&[9; 280]), 0);
    drop(reader);
    bench.until(MS, |b| b.ended.len() == 1);
    for _ in 0..100 {
        bench.links.send(b"unheard");
        settle(&mut bench);
    }

    let mut reader = open(&path);
    reader.write_all(b"back").unwrap();
    bench.until(MS, |b| b.heard(b"back"));
    bench.links.send(b"heard");
    let mut found = Vec::new();
    bench.until(MS, |_| {
        found.extend(pending(&mut reader));
        found.len() >= 5
    });
    assert_eq!(found, b"heard");
    assert!(!bench.streams.contains_key(&bench.ended[0]));
}

#[test]
fn a_reader_that_does_not_read_loses_whole_frames_only() {
    let mut bench = Bench::open(&["pty"]);
    let mut reader = open(&path(&bench));
    settle(&mut bench);
    let frame: Vec<u8> = (0..250).collect();
    let mut lost = 0;
    for _ in 0..2000 {
        lost += bench.links.send(&frame);
        bench.now += 20 * MS;
        bench.receive();
    }
    assert!(lost > 1000, "{lost}");
    let mut found = Vec::new();
    let whole = (2000 - lost as usize) * 250;
    bench.until(MS, |_| {
        found.extend(pending(&mut reader));
        found.len() >= whole
    });
    assert!(is_counted(&found));
}

#[test]
fn the_link_is_made_and_removed() {
    let folder = tempdir().unwrap();
    let link = folder.path().join("esc");
    let text = format!("pty:{}:57600", link.display());
    // One left by a killed run is replaced.
    symlink("/dev/pts/left-over", &link).unwrap();
    let bench = Bench::open(&[&text]);
    let target = fs::read_link(&link).unwrap();
    assert!(target.starts_with("/dev/"), "{target:?}");
    let line = &bench.links.describe()[0];
    let wanted = [
        link.to_str().unwrap(),
        target.to_str().unwrap(),
        "57600 baud",
    ];
    assert!(wanted.iter().all(|w| line.contains(w)), "{line}");
    drop(bench);
    assert!(fs::symlink_metadata(&link).is_err(), "removed at the end");

    fs::write(&link, "someone's file").unwrap();
    let opened = Links::open(&[text.parse().unwrap()]);
    let line = opened.err().expect("it is a file").to_string();
    assert!(
        line.contains(&text) && line.contains("not a symbolic link"),
        "{line}"
    );
    assert_eq!(fs::read(&link).unwrap(), b"someone's file");

    let text = format!("pty:{}", folder.path().join("no/folder").display());
    let opened = Links::open(&[text.parse().unwrap()]);
    let line = opened.err().expect("there is no such folder").to_string();
    assert!(line.contains("cannot make the link"), "{line}");
}

#[test]
fn a_link_that_another_run_has_taken_over_stays() {
    let folder = tempdir().unwrap();
    let link = folder.path().join("esc");
    let text = format!("pty:{}", link.display());
    let first = Bench::open(&[&text]);
    let second = Bench::open(&[&text]);
    drop(first);
    assert!(fs::symlink_metadata(&link).is_ok());
    drop(second);
    assert!(fs::symlink_metadata(&link).is_err());
}

#[test]
fn a_serial_port_works_and_is_found_again() {
    // The other end of our own pseudo-terminal is the device.
    let folder = tempdir().unwrap();
    let device = folder.path().join("ttyUSB0");
    let pty = format!("pty:{}", device.display());
    let mut far = Bench::open(&[&pty]);
    let mut near = Bench::open(&[&format!("serial:{}:115200", device.display())]);
    let exchange = |far: &mut Bench, near: &mut Bench, text: &[u8]| {
        // The near end may have to open the device before the far end sees anyone there.
        settle(near);
        settle(far);
        near.links.send(text);
        far.links.send(text);
        let (far_heard, near_heard) = (far.ended.len(), near.ended.len());
        near.until(MS, |near| {
            far.now += MS;
            far.receive();
            near.heard(text) && far.heard(text)
        });
        assert_eq!((far.ended.len(), near.ended.len()), (far_heard, near_heard));
    };
    exchange(&mut far, &mut near, b"\x03\r\n\x11 first");

    // Unplugged: the device is gone, then returns as another one under the same name.
    drop(far);
    near.until(MS, |near| near.ended.len() == 1);
    let mut far = Bench::open(&[&pty]);
    near.now += Duration::from_secs(2);
    exchange(&mut far, &mut near, b"second");
}
