//! `siskin image` and `siskin flash`: from a linked image to files, and to the programs that write
//! it. There is no board to write to: those programs are stand-ins that record their arguments.

mod bench;
mod elf;
mod flash;
#[path = "../common/run.rs"]
mod run;

use std::fs;

use bench::Bench;
use elf::{Elf, tag};
use ihex::{Reader, Record};
use run::siskin;

/// The flash's contents then: the vectors and the tag, a hole, and the code.
fn flash(elf: &Elf) -> Vec<u8> {
    let [code, _, first, _] = &elf.segments[..] else {
        panic!("four segments")
    };
    [&first.2[..], &[0xFF; 12], &code.2].concat()
}

#[test]
fn one_command_writes_elf_bin_and_hex() {
    let bench = Bench::with(&[]);
    let folder = bench.path("new/folder");
    let output = folder.to_str().expect("text");
    let image = bench.image("vesc4-f405-r001");
    let ended = bench.siskin(&["image", &image, "-o", output]);
    assert_eq!((ended.status, ended.err.as_str()), (0, ""));
    let elf = Elf::of("vesc4-f405-r001").stamped();
    let wanted = flash(&elf);
    for told in [
        "board    vesc4-f405-r001\n",
        "version  0.1.0\n",
        "build    0123456789ab+\n",
        &format!(
            "size     {} of 1048576 bytes, from 0x08000000\n",
            wanted.len()
        ),
        "reach    1 functions, 4 bytes while the flash is written, none of them in it;",
        &format!("wrote    {output}/vesc4-f405-r001.hex\n"),
    ] {
        assert!(ended.out.contains(told), "{told}: {}", ended.out);
    }
    let read = |extension| fs::read(folder.join(format!("vesc4-f405-r001.{extension}")));
    assert_eq!(read("elf").expect("written"), elf.bytes());
    assert_eq!(read("bin").expect("written"), wanted);

    let hex = String::from_utf8(read("hex").expect("written")).expect("text");
    let (mut upper, mut held, mut entry) = (0, Vec::new(), None);
    for record in Reader::new(&hex) {
        match record.expect("a sound line") {
            Record::ExtendedLinearAddress(address) => upper = u32::from(address) << 16,
            Record::Data { offset, value } => {
                let at = upper + u32::from(offset) - 0x0800_0000;
                assert_eq!(at as usize, held.len());
                held.extend(value);
            }
            Record::StartLinearAddress(address) => entry = Some(address),
            Record::EndOfFile => {}
            other => panic!("{other:?}"),
        }
    }
    assert!(held == wanted, "{} bytes", held.len());
    assert_eq!(entry, Some(0x0800_0401));
}

#[test]
fn an_image_for_a_board_is_built_first() {
    let mut bench = Bench::with(&["cargo"]);
    let image = bench.image("b-g431b-esc1");
    bench.variables.push(("EXECUTABLE", format!("{image:?}")));
    let folder = bench.path("files");
    let output = folder.to_str().expect("text");
    let arguments = ["image", "--board", "b-g431b-esc1", "-o", output];
    let ended = bench.siskin(&arguments);
    assert_eq!((ended.status, ended.err.as_str()), (0, ""));
    assert!(folder.join("b-g431b-esc1.bin").exists());
    assert_eq!(
        bench.asked(),
        [
            "cargo build --package siskin-firmware --release --target thumbv7em-none-eabihf \
             --features b-g431b-esc1 --message-format=json"
        ]
    );

    bench.variables.push(("STATUS", "101".to_owned()));
    let failed = bench.siskin(&arguments);
    assert_eq!((failed.status, failed.out.as_str()), (1, ""));
    assert!(
        failed.err.contains("cargo: exit status: 101"),
        "{}",
        failed.err
    );
    let missing = Bench::with(&[]).siskin(&arguments);
    assert_eq!(missing.status, 2);
    assert!(missing.err.contains("rustup.rs"), "{}", missing.err);
}

/// Files that must be refused, each with a part of the message.
fn bad_images() -> Vec<(Vec<u8>, &'static str)> {
    let good = Elf::of("b-g431b-esc1");
    let with = |segments| Elf {
        segments,
        ..good.clone()
    };
    let cut = |length| good.bytes()[..length].to_vec();
    let foreign = Elf {
        machine: 62,
        ..good.clone()
    };
    let untagged = with(vec![(1, 0x0800_0000, vec![0x55; 1000])]);
    let tagged = |address| with(vec![(1, address, tag("b-g431b-esc1", [0; 4]))]);
    vec![
        (Vec::new(), "not a 32-bit ELF file"),
        (b":10000000".to_vec(), "not a 32-bit ELF file"),
        (cut(60), "not a 32-bit ELF file"),
        (cut(30_000), "truncated"),
        (foreign.bytes(), "Arm"),
        (with(Vec::new()).bytes(), "nothing in it"),
        (untagged.bytes(), "no Siskin image tag"),
        (Elf::of("third").bytes(), "'third'"),
        // What the feature of a class of boards builds.
        (
            Elf::of("vesc4-f405").bytes(),
            "vesc4-f405-r0005, vesc4-f405-r001, vesc4-f405-r005",
        ),
        (tagged(0x0801_EFF0).bytes(), "0x0801f000"),
        (tagged(0x1000_0000).bytes(), "0x10000000"),
        (tagged(0xFFFF_FFF0).bytes(), "0xfffffff0"),
        (tagged(0x0800_0000).bytes(), "damaged"),
    ]
}

#[test]
fn both_commands_refuse_a_bad_image_in_one_line() {
    for (bytes, named) in bad_images() {
        let bench = Bench::with(&["probe-rs", "dfu-util"]);
        let image = bench.file("bad", &bytes);
        let folder = bench.path("files");
        let output = folder.to_str().expect("text");
        for arguments in [&["image", &image, "-o", output][..], &["flash", &image]] {
            let ended = bench.siskin(arguments);
            assert_eq!((ended.status, ended.out.as_str()), (2, ""), "{named}");
            assert_eq!(ended.err.lines().count(), 1, "{}", ended.err);
            assert!(ended.err.contains(named), "{named}: {}", ended.err);
            assert!(ended.err.contains(&image), "{}", ended.err);
        }
        assert!(bench.asked().is_empty() && !folder.exists(), "{named}");
    }
}

#[test]
fn a_flipped_bit_of_a_stamped_image_is_refused() {
    let bench = Bench::with(&["probe-rs"]);
    let stamped = Elf::of("vesc4-f405-r001").stamped().bytes();
    let image = bench.file("image", &stamped);
    assert_eq!(bench.siskin(&["flash", &image]).status, 0);
    let asked = bench.asked();
    // After the headers: the code, then vectors and tag, every word of which is hit.
    let loaded = 52 + 4 * 32;
    let tag = loaded + 70_000;
    let sampled = (0..70_000).step_by(1009).map(|byte| loaded + byte);
    for (number, byte) in sampled.chain((tag..tag + 576).step_by(7)).enumerate() {
        let mut damaged = stamped.clone();
        damaged[byte] ^= 1 << (number % 8);
        let ended = bench.siskin(&["flash", &bench.file("image", &damaged)]);
        assert_eq!((ended.status, ended.out.as_str()), (2, ""), "byte {byte}");
        assert_eq!(ended.err.lines().count(), 1, "{}", ended.err);
    }
    assert_eq!(bench.asked(), asked, "nothing more is written");

    let mut damaged = stamped;
    damaged[loaded + 12_345] ^= 1;
    let ended = bench.siskin(&["flash", &bench.file("image", &damaged)]);
    for named in ["damaged", "check sum", "siskin image"] {
        assert!(ended.err.contains(named), "{named}: {}", ended.err);
        assert!(!ended.err.contains("similar"), "{}", ended.err);
    }
}

#[test]
fn bad_arguments_end_with_one_line() {
    let bench = Bench::with(&[]);
    let image = bench.image("b-g431b-esc1");
    let folder = bench.file("a-file", "");
    for (arguments, named) in [
        (&["image", "-o", "x"][..], "--board"),
        (&["image", &image], "--output"),
        (&["image", "no-such-file", "-o", "x"], "no-such-file"),
        (&["image", "--board", "esc3", "-o", "x"], "b-g431b-esc1"),
        // Without its shunts' number a VESC is no board.
        (
            &["image", "--board", "vesc4-f405", "-o", "x"],
            "vesc4-f405-r0005, vesc4-f405-r001, vesc4-f405-r005",
        ),
        (&["image", &image, "-o", &folder], &folder),
        (
            &["image", &image, "--board", "vesc4-f405-r001", "-o", "x"],
            "made for b-g431b-esc1, not for vesc4-f405-r001",
        ),
        (&["flash"], "ELF"),
        (&["flash", "no-such-file"], "no-such-file"),
        (&["flash", &image, "--dfu", "--probe", "1:2"], "--probe"),
    ] {
        let ended = siskin(arguments);
        assert_eq!(ended.status, 2, "{arguments:?}: {}", ended.err);
        assert_eq!(ended.err.lines().count(), 1, "{}", ended.err);
        assert!(ended.err.contains(named), "{named}: {}", ended.err);
        assert!(!ended.err.contains("similar"), "{}", ended.err);
    }
}
