//! How the flashing programs are invoked, and what their exit status leads to.

use std::fs;

use crate::bench::Bench;
use crate::elf::Elf;

#[test]
fn a_probe_gets_chip_and_file_and_then_resets() {
    for (board, chip) in [
        ("b-g431b-esc1", "STM32G431CBUx"),
        ("vesc4-f405-r001", "STM32F405RGTx"),
    ] {
        let bench = Bench::with(&["probe-rs"]);
        let image = bench.image(board);
        let ended = bench.siskin(&["flash", &image, "--board", board]);
        assert_eq!((ended.status, ended.err.as_str()), (0, ""));
        assert!(
            ended.out.contains("build    0123456789ab+"),
            "{}",
            ended.out
        );
        assert!(ended.out.contains("verified"), "{}", ended.out);
        let [download, reset] = &bench.asked()[..] else {
            panic!("two commands: {:?}", bench.asked())
        };
        let wanted = format!("probe-rs download --chip {chip} --verify ");
        assert!(download.starts_with(&wanted), "{download}");
        assert_eq!(*reset, format!("probe-rs reset --chip {chip}"));
        // By then the linked image has its check sum.
        let written = fs::read(bench.path("flash")).expect("downloaded");
        assert!(written == Elf::of(board).stamped().bytes());
    }
}

#[test]
fn one_of_several_probes_can_be_chosen() {
    let bench = Bench::with(&["probe-rs"]);
    let image = bench.image("b-g431b-esc1");
    let ended = bench.siskin(&["flash", &image, "--probe", "0483:374b:0012"]);
    assert_eq!(ended.status, 0, "{}", ended.err);
    let asked = bench.asked();
    assert_eq!(asked.len(), 2);
    for line in asked {
        assert!(line.contains(" --probe 0483:374b:0012"), "{line}");
    }
}

#[test]
fn an_image_for_another_board_is_refused_and_nothing_is_written() {
    let bench = Bench::with(&["probe-rs", "dfu-util"]);
    let image = bench.image("vesc4-f405-r001");
    for arguments in [&[][..], &["--dfu"]] {
        let wanted = ["flash", &image, "--board", "b-g431b-esc1"];
        let ended = bench.siskin(&[&wanted, arguments].concat());
        assert_eq!((ended.status, ended.out.as_str()), (2, ""));
        let complaint =
            format!("siskin: {image}: made for vesc4-f405-r001, not for b-g431b-esc1\n");
        assert_eq!(ended.err, complaint);
    }
    assert_eq!(bench.asked(), [""; 0]);
}

#[test]
fn over_usb_the_flash_is_read_back() {
    let bench = Bench::with(&["dfu-util"]);
    let image = bench.image("vesc4-f405-r001");
    let ended = bench.siskin(&["flash", &image, "--dfu"]);
    assert_eq!((ended.status, ended.err.as_str()), (0, ""));
    assert!(ended.out.contains("release BOOT0"), "{}", ended.out);
    let written = fs::read(bench.path("flash")).expect("downloaded");
    assert!(written == crate::flash(&Elf::of("vesc4-f405-r001").stamped()));
    let asked = bench.asked();
    let loader = "dfu-util --device 0483:df11 --alt 0 --dfuse-address";
    let download = format!("{loader} 0x08000000 --download ");
    let upload = format!("{loader} 0x08000000:{} --upload ", written.len());
    assert_eq!(asked.len(), 2, "{asked:?}");
    assert!(asked[0].starts_with(&download), "{asked:?}");
    assert!(asked[1].starts_with(&upload), "{asked:?}");
}

#[test]
fn storage_in_a_hole_of_the_image_is_not_overwritten() {
    let bench = Bench::with(&["dfu-util"]);
    // The code is beyond the second and third sectors.
    let elf = Elf::with_code_at("vesc4-f405-r001", 0x0800_C000);
    let path = bench.path("holed.elf");
    fs::write(&path, elf.bytes()).expect("written");
    let ended = bench.siskin(&["flash", path.to_str().expect("UTF-8"), "--dfu"]);
    assert_eq!((ended.status, ended.err.as_str()), (0, ""));
    let downloads: Vec<String> = bench.asked();
    let addresses = downloads.iter().filter_map(|line| {
        let (before, _) = line.split_once(" --download")?;
        before.rsplit(' ').next()
    });
    assert_eq!(addresses.collect::<Vec<_>>(), ["0x08000000", "0x0800c000"]);
}

#[test]
fn a_flash_that_reads_back_differently_is_reported() {
    let mut bench = Bench::with(&["dfu-util"]);
    let image = bench.image("vesc4-f405-r001");
    bench.file("worn", [0xFF; 100]);
    bench.variables.push(("FLASH", "worn".to_owned()));
    let ended = bench.siskin(&["flash", &image, "--dfu"]);
    assert_eq!(ended.status, 1);
    assert!(ended.err.contains("does not contain"), "{}", ended.err);
    assert!(!ended.out.contains("written and"), "{}", ended.out);
}

#[test]
fn a_board_without_usb_is_not_flashed_over_usb() {
    let bench = Bench::with(&["dfu-util"]);
    let image = bench.image("b-g431b-esc1");
    let ended = bench.siskin(&["flash", &image, "--dfu"]);
    assert_eq!((ended.status, ended.out.as_str()), (2, ""));
    assert_eq!(ended.err.lines().count(), 1, "{}", ended.err);
    assert!(ended.err.contains("no USB"), "{}", ended.err);
    assert_eq!(bench.asked(), [""; 0]);
}

#[test]
fn a_program_that_fails_or_is_missing_is_named() {
    for (board, option, program, remedy) in [
        ("b-g431b-esc1", None, "probe-rs", "https://probe.rs"),
        (
            "vesc4-f405-r001",
            Some("--dfu"),
            "dfu-util",
            "package dfu-util",
        ),
    ] {
        let mut bench = Bench::with(&[program]);
        let image = bench.image(board);
        let arguments: Vec<&str> = ["flash", &image].into_iter().chain(option).collect();
        bench.variables.push(("STATUS", "74".to_owned()));
        let failed = bench.siskin(&arguments);
        let complaint = format!("siskin: {program}: exit status: 74; see above\n");
        assert_eq!((failed.status, failed.err), (1, complaint));
        assert_eq!(bench.asked().len(), 1, "no further step");

        let bench = Bench::with(&[]);
        let image = bench.image(board);
        let arguments: Vec<&str> = ["flash", &image].into_iter().chain(option).collect();
        let missing = bench.siskin(&arguments);
        assert_eq!(missing.status, 2);
        assert_eq!(missing.err.lines().count(), 1, "{}", missing.err);
        let complaint = format!("siskin: {program} is not installed: install");
        assert!(missing.err.starts_with(&complaint), "{}", missing.err);
        assert!(missing.err.contains(remedy), "{}", missing.err);
    }
}
