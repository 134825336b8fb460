//! Random numbers, the same ones every time.

use super::*;

/// SplitMix64.
#[derive(Clone)]
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    pub(super) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub(super) fn byte(&mut self) -> u8 {
        self.next() as u8
    }

    fn word(&mut self) -> u32 {
        self.next() as u32
    }

    /// Changes something, if only by chance.
    pub(super) fn change(&mut self, kept: &mut Kept) {
        match self.below(10) {
            0 => {
                let word = self.below(Intervals::WORDS);
                let bits = [0, u32::MAX, self.word() >> 1][self.below(3)];
                assert!(kept.intervals.set_word(word, bits));
            }
            1 => {
                kept.statistics.run_s += 1 + self.word() % 600;
                kept.statistics.starts += 1;
                let fault = self.below(kept.statistics.faults.len());
                kept.statistics.faults[fault] += 1;
                kept.statistics.temperature_max_c += 0.125;
                kept.statistics.phase_max_a += 0.5;
            }
            2 => {
                let key = Key([(); 32].map(|()| self.byte()));
                let newest = self.word();
                let signing = KeptSigning { key, newest };
                kept.signing = (self.below(4) > 0).then_some(signing);
            }
            _ => {
                let id = ParamId::ALL[self.below(TABLE.len())];
                let entry = id.entry();
                let share = self.below(1001) as f32 / 1000.0;
                let value = entry.min + share * (entry.max - entry.min);
                let value = [value, libm::truncf(value), entry.default][self.below(3)];
                if entry.kind.is_kept() {
                    // A fraction of an integer parameter is refused.
                    let _ = kept.params.set(id, value);
                }
            }
        }
    }
}
