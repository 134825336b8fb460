//! What faults do to the chip and its flash, and whom it answers.

use std::net::UdpSocket;
use std::path::Path;
use std::time::Duration;

use super::*;
use crate::fault::Kind;
use crate::rig::Period;
use crate::wire::WireErrors;

mod overrides;

const MS_NS: u64 = 1_000_000;

fn device(flash: FileFlash, faults: Vec<Fault>) -> Device {
    let started = Device::start(Start {
        flash,
        faults,
        ..Start::default()
    });
    started.unwrap().0
}

/// Runs up to a time with zero throttle every millisecond; returns the number of MAVLink frames sent.
fn run(device: &mut Device, until_ms: u64) -> u32 {
    let mut frames = 0;
    while device.is_before(until_ms * MS_NS) {
        let now_ns = device.now_ns();
        device.wire().play(now_ns, &[12, 0, 0]).unwrap();
        let mut none = |_: f64, _: &Period, _: &Rig| {};
        device.advance(now_ns + MS_NS, |_, _| None, &mut none, &mut |_| frames += 1);
    }
    frames
}

fn set(device: &mut Device, amps: f32) {
    let mut kept = device.esc.kept();
    kept.params.set(ParamId::LimPhaseA, amps).unwrap();
    device.esc.replace(&mut kept);
}

fn limit(device: &Device) -> f32 {
    device.esc.params().get(ParamId::LimPhaseA)
}

#[test]
fn a_flash_that_refuses_keeps_what_was_stored() {
    let folder = tempfile::tempdir().unwrap();
    let flash = FileFlash::open(&folder.path().join("flash")).unwrap();
    let fails = Fault {
        at_s: 0.1,
        for_s: Some(0.1),
        kind: Kind::FlashFail,
    };
    let mut device = device(flash, vec![fails]);
    set(&mut device, 15.0);
    assert_eq!(device.store(Request::Save), Ok(()));

    run(&mut device, 150);
    set(&mut device, 12.0);
    let refused = device.store(Request::Save).unwrap_err();
    assert!(refused.starts_with("storage"), "{refused}");
    assert!(device.store(Request::FactoryReset).is_err());
    assert_eq!(limit(&device), 12.0, "in force until the restart");
    device.reboot(true);
    assert_eq!(limit(&device), 15.0);

    run(&mut device, 250);
    set(&mut device, 12.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    device.reboot(true);
    assert_eq!(limit(&device), 12.0);
}

/// Creates a device on a stored file, with parameters over the stored ones and in place of the factory values.
fn given(path: &Path, overrides: Vec<(ParamId, f32)>, defaults: Vec<(ParamId, f32)>) -> Device {
    let started = Device::start(Start {
        flash: FileFlash::open(path).unwrap(),
        overrides,
        defaults,
        ..Start::default()
    });
    started.unwrap().0
}

/// Nor by a reset to the factory settings, after which it is still in force.
#[test]
fn what_the_command_line_set_is_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash");
    let start = |overrides| given(&path, overrides, Vec::new());
    let mut plain = start(Vec::new());
    set(&mut plain, 15.0);
    assert_eq!(plain.store(Request::Keep), Ok(()));
    drop(plain);

    let mut given = start(vec![
        (ParamId::LimPhaseA, 12.0),
        (ParamId::CtlRpmMax, 5000.0),
    ]);
    for (request, stored) in [
        (Request::Keep, 15.0),
        (Request::Save, 15.0),
        (Request::Load, 15.0),
        (Request::FactoryReset, 20.0),
        (Request::Save, 20.0),
    ] {
        assert_eq!(given.store(request), Ok(()), "{request:?}");
        assert_eq!(limit(&given), 12.0, "{request:?}");
        let params = store::load(&mut given.flash, STORE).kept.params;
        let found = (
            params.get(ParamId::LimPhaseA),
            params.get(ParamId::CtlRpmMax),
        );
        assert_eq!(found, (stored, 6000.0), "{request:?}");
    }
}

/// Unlike what the command line sets, it yields to what is stored: before a restart, after it, and after a load. What
/// the command line sets overrides it.
#[test]
fn what_takes_the_place_of_the_factorys_value_gives_way_to_a_stored_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash");
    let start = |overrides| given(&path, overrides, vec![(ParamId::LimPhaseA, 12.0)]);
    let stored = |device: &mut Device| {
        let params = store::load(&mut device.flash, STORE).kept.params;
        params.get(ParamId::LimPhaseA)
    };
    let mut device = start(Vec::new());
    assert_eq!(limit(&device), 12.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    assert_eq!(stored(&mut device), 20.0, "the factory's");

    set(&mut device, 15.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    assert_eq!(stored(&mut device), 15.0);
    set(&mut device, 12.5);
    assert_eq!(device.store(Request::Load), Ok(()));
    assert_eq!(limit(&device), 15.0);
    device.reboot(true);
    assert_eq!(limit(&device), 15.0);
    drop(device);
    let mut device = start(Vec::new());
    assert_eq!(limit(&device), 15.0);

    assert_eq!(device.store(Request::FactoryReset), Ok(()));
    assert_eq!((limit(&device), stored(&mut device)), (12.0, 20.0));
    drop(device);
    assert_eq!(limit(&start(vec![(ParamId::LimPhaseA, 18.0)])), 18.0);
}

#[test]
fn without_a_file_only_who_has_asked_is_told() {
    let mut device = device(FileFlash::in_memory(), Vec::new());
    set(&mut device, 12.0);
    assert_eq!(device.store(Request::Keep), Ok(()));
    let refused = device.store(Request::Save).unwrap_err();
    assert!(refused.contains("none"), "{refused}");
}

#[test]
fn a_chip_in_reset_is_silent_and_forgets_that_it_was_armed() {
    let reset = Fault {
        at_s: 1.0,
        for_s: Some(1.5),
        kind: Kind::Reset,
    };
    let mut device = device(FileFlash::in_memory(), vec![reset]);
    let armed = |device: &Device| device.esc.telemetry().armed;
    assert!(run(&mut device, 1_000) > 0);
    assert!(armed(&device));
    assert_eq!(run(&mut device, 2_500), 0);
    // INP_ARM_MS, 300 ms, counts from the end of the reset.
    assert!(run(&mut device, 2_790) > 0);
    assert!(!armed(&device));
    run(&mut device, 2_810);
    assert!(armed(&device));
}

/// So does a bus whose supply has come off, and one that sags, until it is up again.
#[test]
fn whatever_drains_the_bus_resets_the_chip() {
    for (kind, for_s) in [
        (Kind::BusSag(20.0), Some(0.5)),
        (Kind::BusSag(19.0), Some(0.5)),
        (Kind::BusDisconnect, None),
    ] {
        let fault = Fault {
            at_s: 1.0,
            for_s,
            kind,
        };
        let mut device = device(FileFlash::in_memory(), vec![fault]);
        run(&mut device, 1_001);
        let silent = run(&mut device, 1_499) == 0;
        // 24 V less 20 V is below 4.5 V. Nothing discharges the capacitor of a motor at rest.
        assert_eq!(silent, kind == Kind::BusSag(20.0), "{kind:?}");
        assert!(run(&mut device, 2_000) > 0, "{kind:?}");
    }
}

/// The chip is gone while the bus is below 4.5 V and no longer.
#[test]
fn a_brown_out_resets_the_chip() {
    let brown_out = |volts| Fault {
        at_s: 1.0,
        for_s: Some(0.5),
        kind: Kind::BrownOut(volts),
    };
    for (volts, silent) in [(4.4, true), (4.5, false)] {
        let mut device = device(FileFlash::in_memory(), vec![brown_out(volts)]);
        run(&mut device, 1_001);
        assert_eq!(run(&mut device, 1_499) == 0, silent, "{volts} V");
        assert!(run(&mut device, 2_000) > 0);
    }
}

/// Two flight controllers take turns, at times that are not ticks of the ESC's timer, on an exact wire and on an
/// imperfect one.
#[test]
fn an_answer_goes_to_who_has_asked() {
    for jitter_ns in [0.0, 60.0] {
        let mut device = Device::start(Start {
            wire: Wire::open(&"udp:127.0.0.1:0".parse().unwrap(), 0).unwrap(),
            overrides: vec![(ParamId::InpProto, 22.0)],
            ..Start::default()
        })
        .unwrap()
        .0;
        device.wire.disturb(WireErrors {
            jitter_ns,
            ..WireErrors::default()
        });
        let to = device.wire.local_address().unwrap();
        let senders = [(); 2].map(|()| {
            let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
            let patience = Duration::from_secs(5);
            sender.set_read_timeout(Some(patience)).unwrap();
            sender
        });
        for number in 0..20 {
            let sender = &senders[number % 2];
            sender.send_to(&[22, 0x0F, 0], to).unwrap();
            let now_ns = device.now_ns();
            while device.wire.counts().played as usize == number {
                device.wire.poll(now_ns);
            }
            let mut none = |_: f64, _: &Period, _: &Rig| {};
            device.advance(now_ns + MS_NS, |_, _| None, &mut none, &mut |_| {});
            let answer = sender.recv(&mut [0; 16]);
            assert_eq!(answer.ok(), Some(9), "to {number}, jitter {jitter_ns} ns");
        }
    }
}
