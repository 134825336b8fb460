//! What the image reads is what there is, where a chip or a board is not as one would like it. Run with
//! `--release`.

use mavlink::dialects::ardupilotmega::ESC_INFO_DATA;

use crate::common::{Board, MS, image};

/// ES0431 2.5.8: a regular conversion beside injected ones may be one of channel 0.
#[test]
fn the_thermistor_is_read_beside_the_currents() {
    let mut board = Board::new(&image(), &[]);
    board.world().mislead_converters();
    board.run(2_500 * MS);
    let infos = board.heard.messages::<ESC_INFO_DATA>();
    assert!(!infos.is_empty());
    for (at, info) in infos {
        let centi_c = info.temperature[0];
        assert!((2_400..2_600).contains(&centi_c), "{centi_c} at {at} ns");
    }
    let texts = board.heard.texts();
    assert!(
        !texts.iter().any(|text| text.contains("temperature")),
        "{texts:?}"
    );
}
