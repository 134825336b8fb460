//! The answer to a client: the state of `LOCKSTEP.md`, encoded.

use super::request::VERSION;
use crate::rack::{Answer, EscState, Rack};

const STATE: u8 = 40;

/// The longest datagram over UDP.
const BYTES_MAX: usize = 65_507;

/// What precedes the ESCs besides the rack's own state.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Head {
    /// Of the latest request obeyed.
    pub(super) sequence: u32,
    /// Number of malformed requests.
    pub(super) refused: u32,
    /// Answers that found no room.
    pub(super) left_out: u32,
}

/// Writes the state, and counts the answers for which there is no room.
pub(super) fn write(out: &mut Vec<u8>, head: &mut Head, rack: &Rack) {
    let escs = rack.escs().len();
    let mut answers = vec![Vec::new(); escs];
    let mut counts = vec![0_u16; escs];
    let mut left = BYTES_MAX - 24 - 96 * escs;
    for Answer {
        esc,
        asked_ns,
        datagram,
    } in rack.answers()
    {
        let length = 10 + datagram.len();
        if length > left {
            head.left_out = head.left_out.wrapping_add(1);
            continue;
        }
        left -= length;
        counts[*esc] += 1;
        let of_esc = &mut answers[*esc];
        of_esc.extend(asked_ns.to_le_bytes());
        of_esc.extend((datagram.len() as u16).to_le_bytes());
        of_esc.extend(datagram);
    }
    out.clear();
    out.extend([STATE, VERSION, escs as u8, 0]);
    out.extend(head.sequence.to_le_bytes());
    out.extend(rack.now_ns().to_le_bytes());
    out.extend(head.refused.to_le_bytes());
    out.extend(head.left_out.to_le_bytes());
    for (state, count) in rack.states().zip(counts) {
        write_esc(out, &state, count);
    }
    out.extend(answers.iter().flatten());
}

fn write_esc(out: &mut Vec<u8>, state: &EscState, answers: u16) {
    let [a, b, c] = state.currents_a;
    let truth = [state.rpm, state.angle_turns, state.torque_nm, a, b, c];
    for value in truth
        .into_iter()
        .chain([state.bus_a, state.bus_v, state.board_c])
    {
        out.extend(value.to_le_bytes());
    }
    let reported = &state.reported;
    for value in [
        reported.rpm,
        reported.bus_v,
        reported.bus_a,
        reported.temperature_c,
    ] {
        out.extend(value.to_le_bytes());
    }
    out.extend(u32::from(state.faults.bits()).to_le_bytes());
    out.extend([u8::from(state.armed), state.phase as u8]);
    out.extend(answers.to_le_bytes());
}
