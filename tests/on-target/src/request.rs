//! The chip's input: parameters and board first, then the inputs of each control period.

use fixed::types::I1F31;
use siskin_control::drive::{Excitation, Fault, Pull, Sample, Setpoint};
use siskin_params::{
    BOSSO_BENCH, Board, Delay, Greatest, Image, LeastDeadTime, ParamId, Params, Shunts, TABLE,
};
use siskin_units::{AdcCounts, Current, Speed};

/// Words of the parameters and the board.
pub const SET_UP_WORDS: usize = TABLE.len() + BOARD_WORDS;

/// Words per period.
pub const PERIOD_WORDS: usize = 9;

const BOARD_WORDS: usize = 8;

/// Returns the parameters in the table's order, then the board.
pub fn set_up(params: &Params, board: &Board) -> [u32; SET_UP_WORDS] {
    let Board {
        image: _,
        current_a_per_count,
        bus_v_per_count,
        current_range_a,
        terminal_v_per_count,
        shunts,
        // A chip has no other than one period.
        delay: _,
        low_side_on_s,
        refresh_s,
        charge_s,
        // The requester has built it before.
        greatest_phase: _,
        greatest_supply: _,
        least_dead_time: _,
        pwm_bounds: _,
    } = *board;
    let mut words = [0; SET_UP_WORDS];
    let (table, rest) = words.split_at_mut(TABLE.len());
    table.copy_from_slice(&ParamId::ALL.map(|id| params.get(id).to_bits()));
    rest.copy_from_slice(&[
        current_a_per_count.to_bits(),
        bus_v_per_count.to_bits(),
        current_range_a.to_bits(),
        terminal_v_per_count.to_bits(),
        low_side_on_s.to_bits(),
        refresh_s.to_bits(),
        charge_s.to_bits(),
        shunts as u32,
    ]);
    words
}

/// The inverse of [`set_up`]. Derived parameters are derived again.
pub fn read_set_up(words: &[u32; SET_UP_WORDS]) -> (Params, Board) {
    let (table, rest) = words.split_at(TABLE.len());
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, &bits) in ParamId::ALL.into_iter().zip(table) {
        // Only derived parameters are refused: the others have been accepted before.
        let _ = params.set(id, f32::from_bits(bits));
    }
    let si = |i: usize| f32::from_bits(rest[i]);
    let board = Board {
        image: Image::EMULATOR,
        current_a_per_count: si(0),
        bus_v_per_count: si(1),
        current_range_a: si(2),
        terminal_v_per_count: si(3),
        low_side_on_s: si(4),
        refresh_s: si(5),
        charge_s: si(6),
        shunts: if rest[7] == Shunts::Two as u32 {
            Shunts::Two
        } else {
            Shunts::Three
        },
        delay: Delay::One,
        greatest_phase: Greatest::ANY,
        greatest_supply: Greatest::ANY,
        least_dead_time: LeastDeadTime::NONE,
        pwm_bounds: &[],
    };
    (params, board)
}

/// Returns the inputs of one period.
pub fn period(sample: &Sample, setpoint: Setpoint) -> [u32; PERIOD_WORDS] {
    let [a, b, c] = sample.currents.map(|counts| counts.to_bits() as u32);
    let [ta, tb, tc] = sample.terminals.map(|counts| counts.to_bits() as u32);
    let (kind, value) = match setpoint {
        Setpoint::Stop => (0, 0),
        Setpoint::Zero => (1, 0),
        Setpoint::Fault(fault) => (2, fault as i32),
        Setpoint::Speed(speed) => (3, speed.to_bits()),
        Setpoint::Torque(current) => (4, current.to_bits()),
        Setpoint::Voltage(share) => (5, share.to_bits()),
        Setpoint::Tone(pitch) => (6, pitch.to_bits()),
        Setpoint::Test(current) => (7, current.to_bits()),
        Setpoint::Pull(pull) => (8, pull as i32),
        Setpoint::Excite(excitation) => (9, excitation.to_word() as i32),
    };
    let bus = sample.bus.to_bits() as u32;
    let hall_and_kind = u32::from(sample.hall) << 8 | kind;
    [a, b, c, ta, tb, tc, bus, hall_and_kind, value as u32]
}

/// The inverse of [`period`].
pub fn read_period(words: &[u32; PERIOD_WORDS]) -> (Sample, Setpoint) {
    let [a, b, c, ta, tb, tc, bus, hall_and_kind, value] = words.map(|word| word as i32);
    let sample = Sample {
        currents: [a, b, c].map(AdcCounts::from_bits),
        bus: AdcCounts::from_bits(bus),
        terminals: [ta, tb, tc].map(AdcCounts::from_bits),
        hall: (hall_and_kind >> 8) as u8,
    };
    let setpoint = match hall_and_kind & 0xff {
        0 => Setpoint::Stop,
        1 => Setpoint::Zero,
        2 => Setpoint::Fault(Fault::ALL[value as usize]),
        3 => Setpoint::Speed(Speed::from_bits(value)),
        4 => Setpoint::Torque(Current::from_bits(value)),
        5 => Setpoint::Voltage(I1F31::from_bits(value)),
        6 => Setpoint::Tone(Speed::from_bits(value)),
        8 => Setpoint::Pull(Pull::from_number(value as u8)),
        9 => Excitation::from_word(value as u32).map_or(Setpoint::Stop, Setpoint::Excite),
        _ => Setpoint::Test(Current::from_bits(value)),
    };
    (sample, setpoint)
}
