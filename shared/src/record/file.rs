//! The record as a file: written by the ESC, read by a user's tools.

use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;

use heapless::Vec;
use siskin_params::{Board, POLE_PAIRS};

use super::{FAULTS, HELD, MAGIC, PERIODS, ROW, Record, place};
use crate::drive::{Fault, Phase};

/// Words before those of the record.
const HEAD: usize = 3;

impl Record {
    /// Passes the words of the file to `put`: amperes and volts per count of the converters, pole pairs, and the words
    /// of the record; the periods only while they are held.
    pub(crate) fn for_each_word(&self, board: &Board, pole_pairs: f32, put: &mut dyn FnMut(u32)) {
        for number in [board.current_a_per_count, board.bus_v_per_count, pole_pairs] {
            put(number.to_bits());
        }
        let held = self.get(place::WRITTEN) & HELD != 0;
        let words = if held { place::PERIODS } else { place::WRITTEN };
        let periods = if held { PERIODS } else { 0 };
        let mut put_all = |words: &[AtomicU32], count: usize| {
            let words = words.iter().take(count);
            words.for_each(|word| put(word.load(Relaxed)));
        };
        put_all(&self.words, words);
        put_all(self.periods.as_flattened(), periods * ROW);
    }
}

/// A fault in the record.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultSeen {
    /// From 1, since power-up.
    pub number: u32,
    /// Which fault.
    pub fault: Fault,
    /// What the drive was doing.
    pub phase: Phase,
    /// Restarts of the ESC since then; 0 is the current run.
    pub starts_ago: u32,
    /// Time from the ESC's start to the fault, s.
    pub time_s: f32,
    /// Mechanical speed in the motor's direction, rpm.
    pub rpm: f32,
    /// Supply, V.
    pub bus_v: f32,
}

/// A control period in the record.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodSeen {
    /// Relative to the end of the last one, s: negative.
    pub time_s: f32,
    /// Currents as read by the converters, zeros not subtracted, A.
    pub currents_a: [f32; 3],
    /// Supply, V.
    pub bus_v: f32,
    /// Estimated electrical angle, degrees, 0 to 360.
    pub angle_deg: f32,
    /// Estimated mechanical speed in the motor's direction, rpm.
    pub rpm: f32,
    /// Commanded on-time share of each high side in the next period; `None` if both switches are off.
    pub duties: [Option<f32>; 3],
}

/// The record as a tool reads it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// The last faults, oldest first.
    pub faults: Vec<FaultSeen, FAULTS>,
    /// The number of the fault that the periods led to.
    pub holder: Option<u32>,
    /// The periods before it, oldest first; in the last one the bridge was turned off.
    pub periods: Vec<PeriodSeen, PERIODS>,
}

impl Recorded {
    /// Reads the file; returns `None` if it is not one.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let word = |at: usize| {
            let bytes = bytes.get(4 * at..)?.first_chunk()?;
            Some(u32::from_le_bytes(*bytes))
        };
        let float = |at| word(at).map(f32::from_bits);
        let at = |place| word(HEAD + place);
        let row = |place| Some([at(place)?, at(place + 1)?, at(place + 2)?, at(place + 3)?]);
        if at(place::MAGIC)? != MAGIC {
            return None;
        }
        let (a_per_count, v_per_count, pole_pairs) = (float(0)?, float(1)?, float(2)?);
        let pole_pairs = if pole_pairs >= 1.0 {
            pole_pairs
        } else {
            POLE_PAIRS
        };
        let (starts, noted) = (at(place::STARTS)?, at(place::NOTED)?);
        let upper = |word: u32| f32::from((word >> 16) as i16);
        let lower = |word: u32| f32::from(word as i16);
        let rpm = |speed: f32, period_s: f32| speed / 65_536.0 / period_s * 60.0 / pole_pairs;
        let mut recorded = Self::default();
        for number in noted.saturating_sub(FAULTS as u32)..noted {
            let [what, time, state, period_s] =
                row(place::FAULTS + ROW * (number as usize % FAULTS))?;
            let period_s = f32::from_bits(period_s);
            let seen = FaultSeen {
                number: number + 1,
                fault: Fault::of_number(what as u8)?,
                phase: *Phase::ALL.get(usize::from((what >> 8) as u8))?,
                starts_ago: starts.wrapping_sub(what >> 16) & 0xffff,
                time_s: time as f32 * period_s,
                rpm: rpm(upper(state), period_s),
                bus_v: lower(state) * v_per_count,
            };
            recorded.faults.push(seen).ok()?;
        }
        let Some(written) = at(place::WRITTEN) else {
            return Some(recorded);
        };
        recorded.holder = at(place::HOLDER);
        let period_s = f32::from_bits(at(place::PERIOD_S)?);
        let end = written & !HELD;
        let first = end.saturating_sub(PERIODS as u32);
        for number in first..end {
            let place = place::PERIODS + ROW * (number as usize % PERIODS);
            let [of_b_a, of_bus_c, of_rotor, duties] = row(place)?;
            let share =
                |duty: u32, one: u32| (duty < 2 * one - 1).then(|| duty as f32 / one as f32);
            let currents = [lower(of_b_a), upper(of_b_a), lower(of_bus_c)];
            let seen = PeriodSeen {
                // Difference first: a float cannot resolve days of periods.
                time_s: -((end - number) as f32) * period_s,
                currents_a: currents.map(|counts| counts * a_per_count),
                bus_v: upper(of_bus_c) * v_per_count,
                angle_deg: f32::from(of_rotor as u16) / 65_536.0 * 360.0,
                rpm: rpm(upper(of_rotor), period_s),
                duties: [
                    share(duties >> 21, 1024),
                    share(duties >> 10 & 0x7ff, 1024),
                    share(duties & 0x3ff, 512),
                ],
            };
            recorded.periods.push(seen).ok()?;
        }
        Some(recorded)
    }
}
