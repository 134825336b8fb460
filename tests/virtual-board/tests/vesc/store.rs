//! The store's flash.

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};
use mavlink::{MAVLinkV2MessageRaw, MavHeader};

use super::chip::{HEARD, REVISION_1, Registers};
use super::image;

/// The store's two sectors.
const STORE: u32 = 0x0800_4000;
const STORE_BYTES: usize = 0x8000;

/// Below 2.7 V the chip must not program words (RM0090, program and erase parallelism): a store asked for while the
/// supply falls is refused.
#[test]
fn nothing_is_stored_while_the_supply_is_low() {
    let mut frame = MAVLinkV2MessageRaw::new();
    let command = COMMAND_LONG_DATA {
        target_system: 1,
        target_component: 1,
        command: MavCmd::MAV_CMD_PREFLIGHT_STORAGE,
        param1: 1.0,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    frame.serialize_message_data(MavHeader::default(), &command);
    let stored = |supply_is_low| {
        let ends = |registers: &Registers| registers.periods.len() > HEARD + 600;
        let chip = Registers {
            supply_is_low,
            said: frame.raw_bytes().to_vec(),
            ..Registers::of(REVISION_1, ends)
        };
        let (registers, stop) = chip.run(&image());
        assert!(registers.periods.len() > HEARD + 600, "{stop:?}");
        let bytes = registers.flash.bytes(STORE, STORE_BYTES);
        bytes.iter().any(|byte| *byte != 0xff)
    };
    assert!(stored(false));
    assert!(!stored(true));
}
