//! What is stored of a parameter that the command line or the bench sets, once somebody else sets it too.

use super::*;
use crate::parameter::set_frame;

/// A client sets a parameter.
fn ask(device: &mut Device, id: ParamId, value: f32) {
    let stream = LinkId::default();
    let mut nobody = |_: f64, _: &Period, _: &Rig| {};
    device.receive(stream, set_frame(id, value).raw_bytes(), &mut nobody);
}

fn stored(device: &mut Device, id: ParamId) -> f32 {
    store::load(&mut device.flash, STORE).kept.params.get(id)
}

const ID: ParamId = ParamId::LimPhaseA;

/// Asserts what a restart of the ESC finds, and another start.
#[track_caller]
fn found(path: &Path, mut device: Device, defaults: &[(ParamId, f32)], value: f32) {
    device.reboot(true);
    assert_eq!(limit(&device), value);
    drop(device);
    assert_eq!(limit(&given(path, Vec::new(), defaults.to_vec())), value);
}

#[test]
fn a_value_that_somebody_sets_is_stored_though_the_bench_has_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash");
    let defaults = [(ID, 12.0)];
    let mut device = given(&path, Vec::new(), defaults.to_vec());
    ask(&mut device, ID, 14.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    drop(device);
    let mut device = given(&path, Vec::new(), defaults.to_vec());
    assert_eq!(limit(&device), 14.0);
    ask(&mut device, ID, 12.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    assert_eq!(stored(&mut device, ID), 12.0);
    found(&path, device, &defaults, 12.0);
}

#[test]
fn a_value_that_somebody_sets_is_stored_though_the_command_line_has_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash");
    for value in [12.0, 15.0] {
        let mut device = given(&path, vec![(ID, 12.0)], Vec::new());
        // Set, not set to another value.
        ask(&mut device, ID, value);
        assert_eq!(device.store(Request::Save), Ok(()));
        assert_eq!(stored(&mut device, ID), value);
        found(&path, device, &[], value);
    }
}

#[test]
fn what_nobody_sets_and_what_is_refused_leave_the_stored_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flash");
    let mut device = given(&path, vec![(ID, 12.0)], Vec::new());
    ask(&mut device, ID, 1e9);
    ask(&mut device, ParamId::CtlRpmMax, 5000.0);
    assert_eq!(device.store(Request::Save), Ok(()));
    assert_eq!(stored(&mut device, ID), 20.0);
    assert_eq!(stored(&mut device, ParamId::CtlRpmMax), 5000.0);
    // Set, but given up before it was stored.
    ask(&mut device, ID, 15.0);
    assert_eq!(device.store(Request::Load), Ok(()));
    assert_eq!(device.store(Request::Save), Ok(()));
    assert_eq!((limit(&device), stored(&mut device, ID)), (12.0, 20.0));
}
