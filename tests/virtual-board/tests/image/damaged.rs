//! The start-up code verifies an image stamped by `siskin image`; a damaged one goes no further. Run with
//! `--release`.

use crate::common::{Board, MS, Throttle, image};
use siskin_vboard::image::Image;

/// The start's text if all is well.
const GREETING: &str = "Siskin ESC ";

/// A bit of the sine table: flipping it stops no start.
fn table(image: &Image) -> (u32, u8) {
    let (address, _) = image
        .symbol(&["math", "trig", "TABLE"])
        .expect("it has one");
    (address + 100, 1 << 5)
}

fn flip(image: &mut Image, (address, bits): (u32, u8)) {
    let found = image.segments.iter_mut().find_map(|segment| {
        let at = address.checked_sub(segment.address)? as usize;
        segment.bytes.get_mut(at)
    });
    *found.expect("it is flashed") ^= bits;
}

/// Turns a stamped image back into what the linker left.
fn unstamp(image: &mut Image) {
    let (sum, _) = image.symbol(&["__check_sum"]).expect("it has a sum");
    let erase: Vec<(u32, u8)> = image
        .segments
        .iter()
        .flat_map(|segment| (segment.address..).zip(segment.bytes.iter()))
        .filter(|(at, _)| (sum..sum + 8).contains(at))
        .map(|(at, byte)| (at, !byte))
        .collect();
    assert!(erase.iter().any(|(_, bits)| *bits != 0), "it is stamped");
    for bits in erase {
        flip(image, bits);
    }
}

/// Sends it everything that arms and turns a motor.
fn throttled(image: &Image) -> Board {
    let mut board = Board::new(image, &[]);
    board.throttle = Throttle::Dshot(0);
    board.run(1000 * MS);
    board.throttle = Throttle::Dshot(1000);
    board.run(500 * MS);
    board
}

#[test]
fn a_damaged_image_never_turns_the_bridge_on_and_tells_why() {
    let (sum, _) = image().symbol(&["__check_sum"]).expect("it has a sum");
    // In the program, in the sum, in its inverse, and in the vectors of an unused interrupt.
    for bits in [table(&image()), (sum, 1), (sum + 7, 0x80), (0x0800_01d4, 2)] {
        let mut image = image();
        flip(&mut image, bits);
        let mut board = throttled(&image);
        let texts = board.heard.texts();
        println!("{bits:x?}: {texts:?}");
        assert!(texts.len() >= 2, "{texts:?}");
        let told = |text: &String| text == "Image damaged: flash it anew";
        assert!(texts.iter().all(told), "{texts:?}");
        assert_eq!(board.heard.heartbeats().len(), texts.len());
        assert_eq!(board.world().bridge().edges(), 0);
        assert_eq!(board.rpm(), 0.0);
    }
}

#[test]
fn an_image_as_the_linker_left_it_starts_whatever_it_holds() {
    let mut image = image();
    unstamp(&mut image);
    let bits = table(&image);
    flip(&mut image, bits);
    let mut board = throttled(&image);
    let texts = board.heard.texts();
    assert!(
        texts.iter().any(|text| text.starts_with(GREETING)),
        "{texts:?}"
    );
    assert!(board.world().bridge().edges() > 0);
}

#[test]
fn the_sum_holds_up_the_start_for_little() {
    let stamped = image();
    let mut unstamped = stamped.clone();
    unstamp(&mut unstamped);
    let greeted_ns = [unstamped, stamped].map(|image| {
        let mut board = Board::new(&image, &[]);
        let greets = |board: &mut Board| {
            let texts = board.heard.texts();
            texts.iter().any(|text| text.starts_with(GREETING))
        };
        board
            .run_until(MS / 10, 3000 * MS, greets)
            .expect("it greets");
        board.now_ns()
    });
    let [without, with] = greeted_ns;
    println!("greeting after {without} ns without the sum, {with} ns with it");
    assert!(with - without < 4 * MS, "{without}, {with}");
}
