//! The chip's program, built like the firmware, on QEMU.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use siskin_on_target::{ANSWER_FILE, REQUEST_FILE};

const CHIP: &str = "thumbv7em-none-eabihf";

/// Longest time for a run, s: 10 s of the drive take a few.
const TIMEOUT: &str = "120";

/// The control step alone, with the parts for flying.
pub(crate) static STEP: LazyLock<PathBuf> =
    LazyLock::new(|| build("siskin-step-on-target", "chip,siskin-control/flight"));

/// The control step alone, with all of the papers.
pub(crate) static PAPERS: LazyLock<PathBuf> =
    LazyLock::new(|| build("siskin-step-on-target", "chip,siskin-control/papers"));

/// The whole interrupt.
pub(crate) static INTERRUPT: LazyLock<PathBuf> =
    LazyLock::new(|| build("siskin-interrupt-on-target", "interrupt"));

/// Builds a program for the chip, under a name that tells its features.
fn build(program: &str, features: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .parent()
        .expect("it is in the target folder");
    let built = Command::new(env!("CARGO"))
        .current_dir(root)
        .args(["build", "--release", "--target", CHIP, "--target-dir"])
        .arg(target)
        .args([
            "-p",
            "siskin-on-target",
            "--features",
            features,
            "--bin",
            program,
        ])
        .status()
        .expect("cargo runs");
    assert!(built.success(), "the chip's program does not build");
    let folder = target.join(CHIP).join("release");
    let (_, parts) = features.rsplit_once('/').unwrap_or(("", features));
    let kept = folder.join(format!("{program}-{parts}"));
    fs::copy(folder.join(program), &kept).expect("it has been built");
    kept
}

/// Has a program for the chip run a request's periods, and returns its answer.
pub(crate) fn replay(program: &Path, name: &str, request: &[u32]) -> Vec<u32> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("on-target")
        .join(name);
    fs::create_dir_all(&folder).expect("a folder for the files");
    let file = |name: &core::ffi::CStr| folder.join(name.to_str().expect("a plain name"));
    let bytes: Vec<u8> = request.iter().flat_map(|word| word.to_le_bytes()).collect();
    fs::write(file(REQUEST_FILE), bytes).expect("the request is written");
    let ended = Command::new("timeout")
        .arg(TIMEOUT)
        .args(["qemu-system-arm", "-M", "mps2-an386", "-nographic"])
        // Each instruction takes 2^10 ns of the board's time, which never waits for the PC's.
        .args(["-icount", "shift=10,align=off,sleep=off"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(program)
        .current_dir(&folder)
        .status()
        .expect("timeout and qemu-system-arm are installed");
    assert!(
        ended.success(),
        "{name}: the chip's program has ended with {ended}"
    );
    let bytes = fs::read(file(ANSWER_FILE)).expect("the chip has answered");
    let (words, rest) = bytes.as_chunks();
    assert!(rest.is_empty());
    words.iter().map(|word| u32::from_le_bytes(*word)).collect()
}
