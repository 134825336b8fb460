//! Start-up of a damaged image. It goes no further: the control interrupt, which alone turns the bridge on,
//! never starts. The light blinks evenly, five times a second, and the serial line gives the reason at the
//! factory baud rate: stored settings are not read.

/// MAVLink 2 frames: a HEARTBEAT in the *critical* state, and a STATUSTEXT of *critical* severity.
#[cfg(any(board, test))]
static TOLD: [u8; 62] = *b"\
    \xfd\x09\0\0\0\x01\x01\0\0\0\0\0\0\0\0\0\0\x05\x03\x0c\x98\
    \xfd\x1d\0\0\x01\x01\x01\xfd\0\0\x02Image damaged: flash it anew\xde\x28";

/// Repeats the message forever.
#[cfg(board)]
pub fn tell(hardware: crate::board::Hardware) -> ! {
    const BAUD: u32 = 115_200;
    let mut light = hardware.light;
    let (mut out, _line) = hardware.mavlink.open(BAUD).split();
    loop {
        // An error cannot be reported.
        let _ = out.blocking_write(&TOLD);
        // One heartbeat per second.
        for _ in 0..10 {
            light.toggle();
            embassy_time::block_for(embassy_time::Duration::from_millis(100));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use siskin_control::mavlink::Receiver;
    use std::vec::Vec;

    #[test]
    fn what_is_told_are_two_sound_frames() {
        let mut told = Vec::new();
        Receiver::new().push(0, &TOLD, |frame| {
            told.push((frame.id, frame.payload.to_vec()));
        });
        let text = [b"\x02".as_slice(), b"Image damaged: flash it anew"].concat();
        assert_eq!(told.len(), 2);
        assert_eq!(told[0], (0, std::vec![0, 0, 0, 0, 0, 0, 0, 5, 3]));
        assert_eq!(told[1].0, 253);
        assert_eq!(told[1].1[..text.len()], text);
    }
}
