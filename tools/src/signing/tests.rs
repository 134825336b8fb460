use mavlink::dialects::ardupilotmega::HEARTBEAT_DATA;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};
use siskin_control::mavlink::Receiver;

use super::*;

fn frame() -> Vec<u8> {
    let mut frame = MAVLinkV2MessageRaw::new();
    frame.serialize_message_data(MavHeader::default(), &HEARTBEAT_DATA::DEFAULT);
    frame.raw_bytes().to_vec()
}

fn key_file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("key");
    create(&path, None).expect("new");
    (folder, path)
}

#[test]
fn a_signed_frame_is_whole_and_believed_once() {
    let (_folder, path) = key_file();
    let mut signer = Signer::open(&path).expect("a key");
    let mut other = Signer::open(&path).expect("a key");
    let unsigned = frame();
    assert!(!is_signed(&unsigned) && !other.believes(&unsigned));
    let [first, second] = [(); 2].map(|()| signer.sign(&unsigned, HEARTBEAT_DATA::EXTRA_CRC));
    let mut whole = 0;
    Receiver::new().push(0, &first, |frame| whole += usize::from(frame.raw == first));
    assert_eq!(whole, 1, "its check is right");
    assert!(other.believes(&first) && !other.believes(&first));
    assert!(other.believes(&second) && !other.believes(&first));
    for at in 0..first.len() {
        let mut changed = first.clone();
        changed[at] ^= 1;
        assert!(!fits(signer.key(), &changed), "{at}");
    }
}

#[test]
fn timestamps_grow_from_run_to_run_even_if_the_clock_goes_back_or_a_run_is_killed() {
    let (_folder, path) = key_file();
    let mut signer = Signer::open(&path).expect("a key");
    let first = signer.stamp();
    // A run that is killed keeps nothing.
    std::mem::forget(signer);
    let mut signer = Signer::open(&path).expect("a key");
    let second = signer.stamp();
    assert!(second > first && second <= now() + 2 * AHEAD);
    drop(signer);
    // An hour ahead: the clock has gone back since.
    let text = std::fs::read_to_string(&path).expect("text");
    let kept = format!("time {}", second + 3600 * TICKS_PER_S);
    let text = text.replace(&format!("time {second}"), &kept);
    std::fs::write(&path, text).expect("written");
    let mut signer = Signer::open(&path).expect("a key");
    assert!(signer.stamp() > second + 3600 * TICKS_PER_S);
}

#[test]
fn a_key_is_not_replaced_and_is_read_by_its_owner_alone() {
    let (_folder, path) = key_file();
    let text = std::fs::read(&path).expect("text");
    assert!(create(&path, None).is_err());
    Signer::open(&path).expect("a key").stamp();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(&path)
            .expect("a file")
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600);
    }
    assert_ne!(
        std::fs::read(&path).expect("text"),
        text,
        "the time is kept"
    );
    let (_other, other) = key_file();
    assert_ne!(
        Signer::open(&path).expect("a key").key(),
        Signer::open(&other).expect("a key").key()
    );
}
