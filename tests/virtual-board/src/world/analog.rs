//! The bench at the chip's pins: gates out; currents, voltages and comparators in.

use siskin_emulator::plant::Gate;
use siskin_emulator::surroundings::Surroundings as Bench;
use stm32_metapac::gpio::vals::Moder;

use super::{Event, World};
use crate::board::{self, Outside};
use crate::bridge::Bridge;
use crate::chip::Context;
use crate::time::{CLOCK_HZ, Cycles, seconds};

/// Length of a bench period without PWM.
const IDLE_PERIOD: Cycles = CLOCK_HZ / 1000;

/// The bridge transistors' minimum dead time: 0.2 µs, in cycles.
const DEAD_TIME: Cycles = CLOCK_HZ / 5_000_000;

/// The gates' pins with TIM1's alternate function on each: high sides, low sides (data sheet, table 13).
const GATE_PINS: [[((u8, u8), u8); 2]; 3] = [
    [((0, 8), 6), ((2, 13), 4)],
    [((0, 9), 6), ((0, 12), 6)],
    [((0, 10), 6), ((1, 15), 4)],
];

/// The Hall sensors' pins.
const HALL_PINS: [(u8, u8); 3] = [(1, 6), (1, 7), (1, 8)];

/// The comparators that may break.
const COMPARATORS: [u8; 3] = [1, 2, 4];

/// The bench with its position in time.
pub(super) struct Coupling {
    pub(super) bench: Bench,
    pub(super) bridge: Bridge,
    gates: [Gate; 3],
    /// Which high-side drivers have lost their supply.
    pub(super) unsupplied: [bool; 3],
    /// What a damaged thermistor shows, °C.
    pub(super) sensor_c: Option<f64>,
    /// Voltages of the shunts' grounds above the chip's, V.
    pub(super) grounds_v: [f64; 3],
    /// How far the bench has been simulated.
    at: Cycles,
    /// When its period began.
    began: Cycles,
    /// What the comparators tell the timer.
    breaks: bool,
    /// When they last began to request a break.
    pub(super) tripped: Option<Cycles>,
}

impl Coupling {
    pub(super) fn new(bench: Bench) -> Self {
        Self {
            bench,
            bridge: Bridge::new(DEAD_TIME),
            gates: [Gate::default(); 3],
            unsupplied: [false; 3],
            sensor_c: None,
            grounds_v: [0.0; 3],
            at: 0,
            began: 0,
            breaks: false,
            tripped: None,
        }
    }

    /// Returns when a period of the bench ends without PWM.
    pub(super) fn due(&self) -> Cycles {
        self.began + IDLE_PERIOD
    }

    /// Advances the bench to a time.
    fn reach(&mut self, now: Cycles) {
        if now > self.at {
            self.bench.stretch(self.gates, seconds(now - self.at));
            self.at = now;
        }
    }
}

impl World {
    /// Advances the bench to the present, and updates the comparators.
    fn reach(&mut self) {
        self.coupling.reach(self.now);
        let [first, second, third] = self.parts.tim1.break_comparators();
        let may = [first, second, third];
        if may == [false; 3] && !self.coupling.breaks {
            return;
        }
        let trips = self.compare();
        let breaks = may.into_iter().zip(trips).any(|(may, trips)| may && trips);
        if breaks != self.coupling.breaks {
            self.coupling.breaks = breaks;
            if breaks {
                self.coupling.tripped = Some(self.now);
            }
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            self.parts.tim1.set_break(breaks, &mut context);
        }
    }

    /// Updates the comparators from the bench's current state, and returns which of them trip.
    fn compare(&mut self) -> [bool; 3] {
        let outside = self.outside();
        let parts = &mut self.parts;
        COMPARATORS.map(|number| {
            let pin = parts.comparators.pin(number);
            let volts = pin.and_then(|pin| outside.volts(pin));
            volts.is_some_and(|volts| parts.comparators.level(number, volts, &parts.dac))
        })
    }

    /// Updates the comparators to the present, for a read of their outputs.
    pub(super) fn look(&mut self) {
        self.coupling.reach(self.now);
        self.compare();
    }

    /// Returns what the sensors are exposed to now, before any noise.
    fn outside(&self) -> Outside {
        let truth = self.coupling.bench.truth();
        // Only a conducting low side has current in its shunt; current out of the motor flows down.
        let shunt_a = |leg: usize| truth.low_s[leg].map_or(0.0, |_| -truth.currents_a[leg]);
        let (port, pin) = board::DIVIDERS_GROUND;
        let ground = &self.parts.ports[usize::from(port)];
        Outside {
            shunts_a: [0, 1, 2].map(shunt_a),
            grounds_v: self.coupling.grounds_v,
            terminals_v: truth.terminals_v,
            bus_v: truth.bus_v,
            temperature_c: (self.coupling.sensor_c)
                .unwrap_or_else(|| self.coupling.bench.sensor_c()),
            grounded: ground.mode(pin) == Moder::OUTPUT && !ground.level(pin),
        }
    }

    /// Changes a leg's gates, as far as the timer's outputs reach the pins.
    pub(super) fn gates(&mut self, leg: usize, high: bool, low: bool) {
        let reaches = |((port, pin), function): ((u8, u8), u8)| {
            self.parts.ports[usize::from(port)].alternate(pin) == Some(function)
        };
        let [of_high, of_low] = GATE_PINS[leg];
        let gate = Gate {
            high: high && reaches(of_high) && !self.coupling.unsupplied[leg],
            low: low && reaches(of_low),
        };
        self.set_gate(leg, gate);
    }

    /// Turns the gates off by their pull-downs.
    pub(super) fn gates_off(&mut self) {
        for leg in 0..3 {
            self.set_gate(leg, Gate::default());
        }
    }

    fn set_gate(&mut self, leg: usize, gate: Gate) {
        if self.coupling.gates[leg] != gate {
            self.reach();
            self.coupling.gates[leg] = gate;
            let Gate { high, low } = gate;
            self.coupling.bridge.gates(leg, high, low, self.now);
            self.happened.push(Event::Gates(self.now, leg, gate));
        }
    }

    /// Handles the PWM timer's trigger for the converters: a period ends and the next begins.
    pub(super) fn trigger(&mut self) {
        self.end_period();
        self.load.duties(self.now);
        let hall = self.coupling.bench.hall();
        for (phase, (port, pin)) in HALL_PINS.into_iter().enumerate() {
            self.parts.ports[usize::from(port)].set_input(pin, Some(hall >> phase & 1 != 0));
        }
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        self.parts.converters.trigger(&mut context);
    }

    /// Ends a period of the bench, by the PWM or for lack of it.
    pub(super) fn end_period(&mut self) {
        self.reach();
        let coupling = &mut self.coupling;
        if let Some(passage) = coupling.bench.end_period() {
            let began_s = seconds(coupling.began);
            self.happened.push(Event::Passage(began_s, passage));
        }
        coupling.began = self.now;
    }

    /// Handles the end of a converter's sampling.
    pub(super) fn sample(&mut self, converter: u8, channel: u8) {
        self.reach();
        let volts = self.volts(converter, channel).unwrap_or(0.0);
        self.parts.converters.sampled(converter, volts);
    }

    /// Returns the voltage at a converter's channel.
    fn volts(&mut self, converter: u8, channel: u8) -> Option<f64> {
        let outside = self.outside();
        let Some(which) = self.parts.op_amps.at(converter, channel) else {
            return outside.volts(board::pin(converter, channel)?);
        };
        let pin = self.parts.op_amps.pin(which)?;
        let shunts = board::SHUNTS.iter();
        let leg = shunts.enumerate().find(|(_, shunt)| **shunt == pin)?.0;
        // What the amplifier shows, with its settling, errors and noise.
        let mut shunts_a = outside.shunts_a;
        shunts_a[leg] = -self.coupling.bench.shown_a(leg);
        let shown = Outside {
            shunts_a,
            ..outside
        };
        let foot = self.parts.op_amps.foot(which);
        let foot_v = foot.and_then(|pin| shown.volts(pin)).unwrap_or(0.0);
        self.parts.op_amps.output(which, shown.volts(pin)?, foot_v)
    }
}
