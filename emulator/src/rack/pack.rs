//! The supply that several ESCs share.

use crate::plant::{Bus, Supply};

/// One source behind one resistance, and the capacitors of all ESCs at its terminals.
///
/// Each ESC's mean current flows for its whole control period, so that at the start of the period that begins next all
/// currents until then are known, whatever the periods' lengths.
#[derive(Clone, Debug)]
pub(super) struct Pack {
    bus: Bus,
    now_s: f64,
    /// Each ESC's current in its latest period, A.
    drawn_a: Vec<f64>,
}

impl Pack {
    /// Creates the first supply with the capacitors of all.
    pub(super) fn new(supplies: &[Supply]) -> Option<Self> {
        let first = supplies.first()?;
        let capacitance_f = supplies.iter().map(|supply| supply.capacitance_f).sum();
        Some(Self {
            bus: Bus::new(Supply {
                capacitance_f,
                ..*first
            }),
            now_s: 0.0,
            drawn_a: vec![0.0; supplies.len()],
        })
    }

    pub(super) fn bus_mut(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// Returns its voltage at a time within every ESC's latest period, V.
    pub(super) fn volts_at(&mut self, time_s: f64) -> f64 {
        if time_s > self.now_s {
            let drawn_a = self.drawn_a.iter().sum();
            self.bus.advance(time_s - self.now_s, drawn_a);
            self.now_s = time_s;
        }
        self.bus.volts()
    }

    /// Sets the mean current of an ESC in the period that has begun, A.
    pub(super) fn draw(&mut self, esc: usize, current_a: f64) {
        self.drawn_a[esc] = current_a;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 cells of 4 mΩ: all see what one ESC draws, however their periods are offset.
    #[test]
    fn a_pack_sags_by_the_sum_of_the_currents() {
        let mut pack = Pack::new(&[Supply::battery(4); 3]).expect("three supplies");
        let open_v = pack.volts_at(0.0);
        for step in 0..2000 {
            let time_s = f64::from(step) * 20e-6;
            pack.volts_at(time_s);
            pack.draw(step as usize % 3, [30.0, 10.0, 2.0][step as usize % 3]);
        }
        let sagged_v = open_v - pack.volts_at(0.04);
        // 42 A over 16 mΩ; 0.47 mAh of 2 Ah is 4 mV over the four cells.
        assert!((sagged_v - 0.672).abs() < 0.006, "{sagged_v}");
    }
}
