//! The bus: a capacitor between the supply and the bridge.
//!
//! Its voltage is constant within a control period; at the end the period's mean current moves it,
//! in closed form. The ripple from the PWM edges is left out.

use super::Supply;
use super::wires::Wires;

/// A supply with the capacitor that it charges.
#[derive(Clone, Debug)]
pub struct Bus {
    supply: Supply,
    volts: f64,
    /// Current in the wires from the source, A; unused where they have no inductance.
    wires_a: f64,
    /// Charge drawn from the source since the start, C.
    drawn_c: f64,
    /// Voltage that the source lacks, V.
    sag_v: f64,
    /// The most that the source gives, V.
    limit_v: f64,
    connected: bool,
    /// Another bus feeds it, in place of the source and the capacitor.
    fed: bool,
}

impl Bus {
    /// Creates a supply without load.
    pub fn new(supply: Supply) -> Self {
        Self {
            volts: supply.open_v(0.0),
            supply,
            wires_a: 0.0,
            drawn_c: 0.0,
            sag_v: 0.0,
            limit_v: f64::INFINITY,
            connected: true,
            fed: false,
        }
    }

    /// Takes its voltage from another bus, V, as far as its own source would be connected and
    /// sound.
    pub fn feed(&mut self, volts: f64) {
        self.fed = true;
        if self.connected {
            self.volts = (volts - self.sag_v).min(self.limit_v).max(0.0);
        }
    }

    /// Returns true if the bridge draws its current from the source.
    pub fn is_connected(&self) -> bool {
        self.connected
    }

    /// Returns the supply as it is now.
    pub fn supply(&self) -> Supply {
        self.supply
    }

    /// Replaces the supply; the capacitor keeps its voltage until time advances.
    pub fn set_supply(&mut self, supply: Supply) {
        self.supply = supply;
    }

    /// Returns the bus voltage in the period that begins, V.
    pub fn volts(&self) -> f64 {
        self.volts
    }

    /// Returns the charge drawn from the source since the start, C.
    #[cfg(test)]
    fn drawn_c(&self) -> f64 {
        self.drawn_c
    }

    /// Lowers the source by this many volts; 0 mends it.
    pub fn sag(&mut self, volts: f64) {
        self.sag_v = volts;
    }

    /// Limits the source's voltage, V, as in a brown-out; `None` mends it.
    pub fn limit(&mut self, volts: Option<f64>) {
        self.limit_v = volts.unwrap_or(f64::INFINITY);
    }

    /// Connects the source, or leaves the bridge to the capacitor alone.
    pub fn connect(&mut self, connected: bool) {
        self.connected = connected;
        if !connected {
            self.wires_a = 0.0;
        }
    }

    /// Ends a period in which the bridge took this mean current, A; negative is returned.
    pub fn advance(&mut self, time_s: f64, current_a: f64) {
        if self.fed && self.connected {
            return;
        }
        let Supply {
            resistance_ohm,
            inductance_h,
            capacitance_f,
            ..
        } = self.supply;
        let open_v = self.supply.open_v(self.drawn_c) - self.sag_v;
        let open_v = open_v.min(self.limit_v).max(0.0);
        let before_v = self.volts;
        self.volts = if !self.connected {
            before_v - current_a * time_s / capacitance_f
        } else if inductance_h > 0.0 {
            let wires = Wires {
                resistance_ohm,
                inductance_h,
                capacitance_f,
            };
            let (state, driven) = ((before_v, self.wires_a), (open_v, current_a));
            let after = if self.supply.sinks() {
                wires.both_ways(state, driven, time_s)
            } else {
                wires.one_way(state, driven, time_s)
            };
            self.wires_a = after.1;
            after.0
        } else if self.supply.sinks() {
            let settled_v = open_v - resistance_ohm * current_a;
            settled_v + (before_v - settled_v) * decay(time_s, resistance_ohm * capacitance_f)
        } else {
            self.charged_one_way(time_s, current_a, open_v)
        }
        .max(0.0);
        if self.connected {
            self.drawn_c += current_a * time_s + capacitance_f * (self.volts - before_v);
        }
    }

    /// Returns the bus voltage after a time with a source that gives current and takes none, V.
    fn charged_one_way(&self, time_s: f64, current_a: f64, open_v: f64) -> f64 {
        let capacitance_f = self.supply.capacitance_f;
        let resistance_ohm = self.supply.resistance_ohm;
        let rate = -current_a / capacitance_f;
        let mut volts = self.volts;
        let mut left_s = time_s;
        if volts > open_v {
            // The capacitor alone, until it is down to the source's voltage.
            let until_s = if rate < 0.0 {
                (open_v - volts) / rate
            } else {
                f64::INFINITY
            };
            if until_s >= left_s {
                return volts + rate * left_s;
            }
            (volts, left_s) = (open_v, left_s - until_s);
        }
        let settled_v = open_v - resistance_ohm * current_a;
        let time_constant_s = resistance_ohm * capacitance_f;
        if current_a >= 0.0 {
            return settled_v + (volts - settled_v) * decay(left_s, time_constant_s);
        }
        // Current returns: the source keeps charging until the voltage has reached its own.
        let until_s = if volts < open_v && time_constant_s > 0.0 {
            time_constant_s * libm::log((settled_v - volts) / (settled_v - open_v))
        } else {
            0.0
        };
        if until_s >= left_s {
            settled_v + (volts - settled_v) * decay(left_s, time_constant_s)
        } else {
            open_v + rate * (left_s - until_s)
        }
    }
}

/// Returns the remaining share of a transient.
fn decay(time_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s > 0.0 {
        libm::exp(-time_s / time_constant_s)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Source;

    const PERIOD_S: f64 = 41.7e-6;

    fn bench(volts: f64, sinks: bool, resistance_ohm: f64) -> Bus {
        Bus::new(Supply {
            source: Source::Fixed { volts, sinks },
            resistance_ohm,
            inductance_h: 0.0,
            capacitance_f: 470e-6,
        })
    }

    #[test]
    fn a_stiff_supply_does_not_move() {
        let mut bus = Bus::new(Supply::stiff(24.0));
        for current_a in [0.0, 40.0, -30.0] {
            bus.advance(PERIOD_S, current_a);
            assert_eq!(bus.volts(), 24.0);
        }
        bus.sag(6.0);
        bus.advance(PERIOD_S, 10.0);
        assert_eq!(bus.volts(), 18.0);
        bus.limit(Some(7.0));
        bus.advance(PERIOD_S, 10.0);
        assert_eq!(bus.volts(), 7.0);
        bus.sag(0.0);
        bus.limit(None);
        bus.advance(PERIOD_S, 10.0);
        assert_eq!(bus.volts(), 24.0);
    }

    #[test]
    fn a_pack_sags_under_load_and_with_its_charge() {
        let mut bus = Bus::new(Supply::battery(6));
        for _ in 0..100_000 {
            bus.advance(PERIOD_S, 30.0);
        }
        // 125 C of 7200 C, and 30 A through 24 mΩ.
        let drawn_c = 100_000.0 * PERIOD_S * 30.0;
        assert!(
            (bus.drawn_c() / drawn_c - 1.0).abs() < 1e-3,
            "{}",
            bus.drawn_c()
        );
        let wanted_v = Supply::battery(6).open_v(bus.drawn_c()) - 0.72;
        assert!((bus.volts() - wanted_v).abs() < 1e-3, "{}", bus.volts());
        // It takes current back.
        for _ in 0..100 {
            bus.advance(PERIOD_S, -30.0);
        }
        assert!(
            (bus.volts() - wanted_v - 1.44).abs() < 2e-3,
            "{}",
            bus.volts()
        );
    }

    /// Returned energy that the source does not take stays in the capacitor.
    #[test]
    fn braking_charges_the_capacitor_of_a_supply_that_takes_nothing() {
        for resistance_ohm in [0.0, 0.05] {
            let mut bus = bench(24.0, false, resistance_ohm);
            let mut back_c = 0.0;
            for _ in 0..50 {
                bus.advance(PERIOD_S, -3.0);
                back_c += 3.0 * PERIOD_S;
            }
            let wanted_v = 24.0 + back_c / 470e-6;
            assert!((bus.volts() - wanted_v).abs() < 1e-9, "{}", bus.volts());
            assert!(bus.drawn_c().abs() < 1e-12);
            // Half of it is used up, then all: the source takes over at its own voltage.
            bus.advance(0.5 * back_c / 6.0, 6.0);
            assert!((bus.volts() - 0.5 * (wanted_v + 24.0)).abs() < 1e-9);
            for _ in 0..50 {
                bus.advance(PERIOD_S, 6.0);
            }
            let wanted_v = 24.0 - 6.0 * resistance_ohm;
            assert!((bus.volts() - wanted_v).abs() < 1e-6, "{}", bus.volts());
        }
    }

    /// The bus reaches the same state in steps of any length.
    #[test]
    fn the_bus_is_solved_whatever_the_step() {
        for (from_a, then_a) in [(8.0, -9.0), (-4.0, 20.0)] {
            let after = |steps: u32| {
                let mut bus = bench(20.0, false, 0.1);
                for current_a in [from_a, then_a] {
                    for _ in 0..steps {
                        bus.advance(200e-6 / f64::from(steps), current_a);
                    }
                }
                bus.volts()
            };
            assert!((after(1) - after(1000)).abs() < 1e-9, "{from_a}");
        }
    }

    #[test]
    fn a_fed_bus_is_the_other_s_until_it_is_cut_off() {
        let mut bus = Bus::new(Supply::battery(4));
        bus.feed(15.0);
        bus.advance(PERIOD_S, 30.0);
        assert_eq!(bus.volts(), 15.0);
        bus.sag(2.0);
        bus.feed(15.0);
        assert_eq!(bus.volts(), 13.0);
        bus.connect(false);
        bus.feed(16.0);
        bus.advance(1e-3, 2.0);
        assert!((bus.volts() - (13.0 - 2e-3 / 470e-6)).abs() < 1e-9);
    }

    #[test]
    fn disconnected_the_capacitor_alone_carries_the_bus() {
        let mut bus = Bus::new(Supply::stiff(24.0));
        bus.connect(false);
        bus.advance(1e-3, 2.0);
        assert!((bus.volts() - (24.0 - 2e-3 / 470e-6)).abs() < 1e-9);
        bus.advance(1.0, 2.0);
        assert_eq!(bus.volts(), 0.0);
        bus.connect(true);
        bus.advance(PERIOD_S, 2.0);
        assert_eq!(bus.volts(), 24.0);
    }
}
