//! Hands the linker the chip's script, and the image its name.

use std::env;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=link");
    // Another commit is another image.
    println!("cargo::rerun-if-changed=../.git/logs/HEAD");
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=../shared");
    println!("cargo::rustc-env=SISKIN_COMMIT={}", commit());
    println!("cargo::rustc-check-cfg=cfg(board)");
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let script = match (has("STM32G431"), has("STM32F405")) {
        (true, false) => "stm32g431.x",
        (false, true) => "stm32f405.x",
        _ => return,
    };
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        // Short for what depends on a board.
        println!("cargo::rustc-cfg=board");
        let folder = env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
        println!("cargo::rustc-link-arg-bins=-L{folder}/link");
        println!("cargo::rustc-link-arg-bins=-T{script}");
        println!("cargo::rustc-link-arg-bins=--nmagic");
        // `siskin image` and the tests ask what refers to what.
        println!("cargo::rustc-link-arg-bins=--emit-relocs");
        if has("DEFMT") {
            println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
        }
    }
}

/// The commit that is checked out, `+` behind it where files differ from it; `unknown` without git.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = output.status.success().then_some(output.stdout)?;
        Some(String::from_utf8(text).ok()?.trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short=16", "HEAD"]) else {
        return "unknown".into();
    };
    match git(&["status", "--porcelain", "--untracked-files=no"]) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit}+"),
    }
}
