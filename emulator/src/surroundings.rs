//! The running bench outside the chip: motor and inverter, bus, heat and sensors.
//!
//! The control's periods come whole ([`Surroundings::period`]), with the emulator's converter sampling at their start.
//! A caller that has the edges itself advances it stretch by stretch, reads a pin at any instant, and ends each PWM
//! period.

mod fit;

use std::f64::consts::TAU;

use siskin_control::drive::{Bridge, Sample, Snapshot};

use crate::bench::Bench;
use crate::fault::InForce;
use crate::plant::{Air, Bus, Flow, Gate, Noise, Plant, RUNAWAY_RAD_S, Sensing, Thermal, Truth};

/// Expected length of the first period, s.
const USUAL_S: f64 = 1.0 / 24_000.0;

/// Shortest and longest expected period, s: bus voltage and shaft speed are constant within one.
const EXPECTED_S: [f64; 2] = [10e-6, 1e-3];

/// The motor and its supply at the start of a period, and what flowed in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Electrical angle, turns, 0..1.
    pub angle_turns: f64,
    /// Mechanical speed, rad/s.
    pub speed_rad_s: f64,
    /// Currents into the phases, A.
    pub currents_a: [f64; 3],
    /// Supply voltage, V.
    pub bus_v: f64,
    /// Current from the supply, A.
    pub bus_a: f64,
    /// Means over the period.
    pub flow: Flow,
}

/// A period as seen from outside the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Its length, s.
    pub length_s: f64,
    /// The motor.
    pub motion: Motion,
    /// The Hall sensors' bits at its start.
    pub hall: u8,
}

/// The bench outside the chip.
#[derive(Clone, Debug)]
pub struct Surroundings {
    bench: Bench,
    plant: Plant,
    bus: Bus,
    thermal: Thermal,
    noise: Noise,
    air: Air,
    /// What faults add to the air's torque, Nm, and wind, rad/s.
    struck: [f64; 2],
    /// The sensors as they are now.
    sensing: Sensing,
    /// What stuck current sensors read, A.
    stuck_a: [Option<f64>; 3],
    /// What stuck Hall sensors read.
    hall_stuck: [Option<bool>; 3],
    /// The period in progress, from its start and with its length so far.
    begun: Option<Passage>,
    /// Length of the latest such period, s, within the expected range.
    latest_s: f64,
}

impl Surroundings {
    /// Creates the bench at its start.
    pub fn new(bench: Bench) -> Self {
        let mut plant = Plant::new(
            bench.plant,
            bench.motor,
            bench.load,
            bench.initial_rad_s,
            bench.initial_angle_turns,
        );
        plant.fit(&bench.extras);
        if let Some(speed_rad_s) = bench.imposed_rad_s {
            plant.impose(speed_rad_s);
        }
        Self {
            plant,
            bus: Bus::new(bench.supply),
            thermal: Thermal::new(bench.board_k_per_w),
            noise: Noise::new(bench.seed),
            air: Air::default(),
            struck: [0.0; 2],
            sensing: bench.sensing,
            stuck_a: [None; 3],
            hall_stuck: [None; 3],
            begun: None,
            latest_s: USUAL_S,
            bench,
        }
    }

    /// Returns the bench.
    pub fn bench(&self) -> &Bench {
        &self.bench
    }

    /// Returns motor, load and inverter.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Returns the bus voltage, V.
    pub fn bus_v(&self) -> f64 {
        self.bus.volts()
    }

    /// Returns the bus, to be fed by another or given another supply.
    pub fn bus_mut(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// Returns what acts from outside now.
    pub fn air(&self) -> Air {
        self.air
    }

    /// Sets what acts from outside from now on.
    pub fn surround(&mut self, air: Air) {
        let before = std::mem::replace(&mut self.air, air);
        if [air.torque_nm, air.wind_rad_s] != [before.torque_nm, before.wind_rad_s] {
            self.push();
        }
        self.plant.set_ambient_c(air.ambient_c);
        self.thermal.set_ambient_c(air.ambient_c);
    }

    /// Applies air and faults to the shaft.
    fn push(&mut self) {
        let [torque_nm, wind_rad_s] = self.struck;
        self.plant.set_wind_rad_s(self.air.wind_rad_s + wind_rad_s);
        self.plant
            .set_extra_torque_nm(self.air.torque_nm + torque_nm);
    }

    /// Returns the board's temperature as measured by the emulator's thermistor and converter, °C.
    pub fn temperature_c(&self) -> f32 {
        self.thermal.measured_c()
    }

    /// Returns the temperature of the sensor on the board, °C.
    pub fn sensor_c(&self) -> f64 {
        self.thermal.sensor_c()
    }

    /// Returns the present electrical angle, turns, 0..1.
    pub fn angle_turns(&self) -> f64 {
        let [cos, sin] = self.plant.direction();
        let turns = libm::atan2(sin, cos) / TAU;
        if turns < 0.0 { turns + 1.0 } else { turns }
    }

    /// Returns what there is to sense now.
    #[inline(always)] // in each period
    pub fn truth(&self) -> Truth {
        Truth {
            currents_a: self.plant.shunts_a(self.plant.currents_a()),
            low_s: self.plant.low_s(),
            terminals_v: self.plant.terminals_v(),
            bus_v: self.bus.volts(),
            direction: self.plant.direction(),
        }
    }

    /// Returns the readings of the emulator's converter.
    #[inline(always)] // in each period
    pub fn sample(&mut self) -> Sample {
        let mut sample = self.sensing.sample(&self.truth(), &mut self.noise);
        for (counts, stuck_a) in sample.currents.iter_mut().zip(self.stuck_a) {
            if let Some(stuck_a) = stuck_a {
                *counts = self.sensing.stuck(stuck_a);
            }
        }
        sample.hall = self.seen(sample.hall);
        sample
    }

    /// Returns the present output of a phase's shunt amplifier, A, with its errors and noise.
    pub fn shown_a(&mut self, phase: usize) -> f64 {
        match self.stuck_a[phase] {
            Some(stuck_a) => stuck_a,
            None => {
                let truth = self.truth();
                self.sensing.shown_a(&truth, phase, &mut self.noise)
            }
        }
    }

    /// Returns the Hall sensors' present bits.
    pub fn hall(&self) -> u8 {
        self.seen(self.sensing.hall(self.plant.direction()))
    }

    /// Applies stuck Hall sensors to their bits.
    #[inline(always)] // in each period
    fn seen(&self, mut hall: u8) -> u8 {
        for (phase, stuck) in self.hall_stuck.into_iter().enumerate() {
            if let Some(level) = stuck {
                hall = hall & !(1 << phase) | u8::from(level) << phase;
            }
        }
        hall
    }

    /// Runs a whole control period with a command for each half.
    #[inline(always)] // in each period
    pub fn period(&mut self, halves: [Bridge; 2], period_s: f64, dead_time_s: f64) -> Motion {
        let start = self.start();
        let bus_v = self.bus.volts();
        let flow = self.plant.period(halves, bus_v, period_s, dead_time_s);
        self.follow(start, flow, period_s)
    }

    /// Advances by `time_s`, if positive, with each leg's gates.
    pub fn stretch(&mut self, gates: [Gate; 3], time_s: f64) {
        if time_s <= 0.0 {
            return;
        }
        if self.begun.is_none() {
            self.plant.begin(self.bus.volts(), self.latest_s);
            self.begun = Some(Passage {
                length_s: 0.0,
                motion: self.start(),
                hall: self.hall(),
            });
        }
        self.plant.stretch(gates, time_s);
        if let Some(begun) = &mut self.begun {
            begun.length_s += time_s;
        }
    }

    /// Ends a PWM period, if it had a stretch, and returns what passed in it. Without PWM, call it each millisecond
    /// too: supply and speed are constant until then.
    pub fn end_period(&mut self) -> Option<Passage> {
        let begun = self.begun.take()?;
        let length_s = begun.length_s;
        self.latest_s = length_s.clamp(EXPECTED_S[0], EXPECTED_S[1]);
        let flow = self.plant.end(length_s);
        Some(Passage {
            motion: self.follow(begun.motion, flow, length_s),
            ..begun
        })
    }

    /// Returns the present state of the motor and its supply.
    #[inline(always)] // in each period
    fn start(&self) -> Motion {
        Motion {
            angle_turns: self.plant.angle_turns(),
            speed_rad_s: self.plant.speed_rad_s(),
            currents_a: self.plant.currents_a(),
            bus_v: self.bus.volts(),
            bus_a: 0.0,
            flow: Flow::default(),
        }
    }

    /// Advances bus and board after a period.
    #[inline(always)] // in each period
    fn follow(&mut self, start: Motion, flow: Flow, time_s: f64) -> Motion {
        self.bus.advance(time_s, flow.bus_a);
        let current_square = flow.copper_w / (1.5 * self.plant.resistance_ohm());
        self.thermal.advance(time_s, current_square);
        Motion {
            bus_a: flow.bus_a,
            flow,
            ..start
        }
    }

    /// Sets the level, A, at which comparators turn the bridge off in whole control periods.
    pub fn set_comparator_a(&mut self, level_a: f64) {
        self.plant.set_comparator_a(level_a);
    }

    /// Replaces the faults that act.
    pub fn disturb(&mut self, before: &InForce, now: &InForce) {
        if now.breaks != before.breaks {
            self.plant.break_legs(&now.breaks);
        }
        if now.blocked != before.blocked {
            self.plant.block(now.blocked);
        }
        if now.motor_drift != before.motor_drift {
            self.plant.drift(now.motor_drift.map(|share| 1.0 + share));
        }
        self.plant.kick(now.kicked_rad_s - before.kicked_rad_s);
        let struck = [now.torque_nm, now.wind_rad_s];
        if struck != self.struck {
            self.struck = struck;
            self.push();
        }
        self.bus.sag(now.sag_v);
        self.bus.limit(now.brown_out_v);
        self.bus.connect(!now.disconnected);
        let sound = self.bench.sensing;
        let offset = |phase: usize| sound.offset_a[phase] + now.drift_a[phase];
        self.sensing = Sensing {
            noise_a: libm::hypot(sound.noise_a, now.noise_a),
            offset_a: [0, 1, 2].map(offset),
            ..sound
        };
        self.stuck_a = now.stuck_a;
        self.hall_stuck = now.hall;
    }
}

impl Motion {
    /// Returns true if the plant's numbers are no longer finite, or the shaft has run away.
    pub fn diverged(&self) -> bool {
        let turns = self.speed_rad_s.abs() < RUNAWAY_RAD_S;
        !(turns && self.flow.torque_nm.is_finite())
    }

    /// Returns the estimated less true electrical angle, degrees, ±180.
    pub fn angle_error_deg(&self, snapshot: &Snapshot) -> f64 {
        let turns = snapshot.angle.to_num::<f64>() - self.angle_turns;
        (turns - libm::round(turns)) * 360.0
    }

    /// Returns the mechanical speed, rpm.
    pub fn rpm(&self) -> f64 {
        self.speed_rad_s * 60.0 / TAU
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use siskin_units::Duty;

    use super::*;
    use crate::plant::{Fidelity, Gates};

    const PERIOD_S: f64 = 1.0 / 24_000.0;
    const DEAD_TIME_S: f64 = 500e-9;

    fn around(rpm: f64) -> Surroundings {
        Surroundings::new(Bench {
            plant: Fidelity::Switching,
            initial_rad_s: rpm * TAU / 60.0,
            ..Bench::default()
        })
    }

    /// A bench whose periods are played edge by edge.
    struct Played {
        around: Surroundings,
        gates: Gates,
        on: [Gate; 3],
    }

    impl Played {
        fn new(rpm: f64) -> Self {
            Self {
                around: around(rpm),
                gates: Gates::default(),
                on: [Gate::default(); 3],
            }
        }

        /// Plays a period, cut into `cuts` pieces besides its edges.
        fn period(&mut self, bridge: Bridge, cuts: u32) -> Motion {
            let mut edges = Vec::new();
            let halves = [bridge; 2];
            self.gates
                .period(halves, PERIOD_S, DEAD_TIME_S, |at_s, leg, gate| {
                    edges.push((at_s, Some((leg, gate))));
                });
            let part_s = PERIOD_S / f64::from(cuts + 1);
            edges.extend((1..=cuts).map(|cut| (f64::from(cut) * part_s, None)));
            edges.push((PERIOD_S, None));
            edges.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut now_s = 0.0;
            for (at_s, edge) in edges {
                self.around.stretch(self.on, at_s - now_s);
                now_s = at_s;
                if let Some((leg, gate)) = edge {
                    self.on[leg] = gate;
                }
            }
            self.around.end_period().expect("it took time").motion
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        /// However a period is cut, the result is the same, and equals the switching plant's, whose sweep has the
        /// diodes of a dead time as kicks. A diode's onset is searched from the ends of a stretch, at most 3 mV and so
        /// some mA too late, and the copper's loss is by a different series in each.
        #[test]
        fn stretches_make_the_period(
            rpm in -5000.0..5000.0,
            commands in prop::collection::vec((0..4_u8, [0.0..0.95, 0.0..0.95, 0.0..0.95]), 1..40),
        ) {
            let (mut whole, mut edges, mut cut) = (around(rpm), Played::new(rpm), Played::new(rpm));
            for (kind, duties) in commands {
                let duties = duties.map(Duty::from_num::<f64>);
                let bridge = match kind {
                    0 => Bridge::Off,
                    1 => Bridge::Legs([Some(duties[0]), None, Some(duties[2])]),
                    _ => Bridge::Duty(duties),
                };
                let wanted = whole.period([bridge; 2], PERIOD_S, DEAD_TIME_S);
                let (edges, cut) = (edges.period(bridge, 0), cut.period(bridge, 19));
                for of in [wanted, edges] {
                    for (what, seen, wanted) in [
                        ("speed", cut.speed_rad_s, of.speed_rad_s),
                        ("angle", cut.angle_turns, of.angle_turns),
                        ("i_a", cut.currents_a[0], of.currents_a[0]),
                        ("i_b", cut.currents_a[1], of.currents_a[1]),
                        ("bus", cut.bus_a, of.bus_a),
                        ("torque", cut.flow.torque_nm, of.flow.torque_nm),
                    ] {
                        let apart = (seen - wanted).abs() / (1.0 + wanted.abs());
                        prop_assert!(apart < 5e-3, "{what}: {seen:?} for {wanted:?}");
                    }
                    let [seen, wanted] = [cut, of].map(|motion| motion.flow.copper_w);
                    prop_assert!((seen - wanted).abs() < 2e-3 * (1.0 + wanted), "{seen} {wanted}");
                }
            }
        }
    }

    /// The winding's time constant is 0.4 ms: in 5 µs a current rises by V/L·t, and through the low side's shunt only
    /// while that is on.
    #[test]
    fn a_shunt_shows_its_current_while_its_low_side_is_on() {
        let mut around = Surroundings::new(Bench {
            sensing: Sensing {
                noise_a: 0.0,
                offset_a: [0.0, 0.25, 0.0],
                ..Sensing::default()
            },
            ..Bench::default()
        });
        let low = Gate {
            high: false,
            low: true,
        };
        let high = Gate {
            high: true,
            low: false,
        };
        around.stretch([high, low, low], 5e-6);
        let [a, b, _] = around.plant().currents_a();
        assert!(a > 0.1 && (a + 2.0 * b).abs() < 1e-6, "{a} {b}");
        assert_eq!(around.shown_a(0), 0.0);
        assert!((around.shown_a(1) - b - 0.25).abs() < 1e-9);
        around.stuck_a[1] = Some(3.0);
        assert_eq!(around.shown_a(1), 3.0);
    }

    /// 24 V over twice 3 mΩ, as with a shorted switch; it ends with the gates' overlap.
    #[test]
    fn both_gates_of_a_leg_shoot_through() {
        let mut around = around(0.0);
        let off = Gate::default();
        let both = Gate {
            high: true,
            low: true,
        };
        around.stretch([both, off, off], 2e-6);
        around.stretch([off; 3], 8e-6);
        let bus_a = around.end_period().expect("it took time").motion.bus_a;
        assert!((bus_a - 0.2 * 24.0 / 6e-3).abs() < 1.0, "{bus_a}");
        around.stretch([off; 3], 10e-6);
        let bus_a = around.end_period().expect("it took time").motion.bus_a;
        assert!(bus_a.abs() < 0.1, "{bus_a}");
    }

    #[test]
    fn the_angle_goes_on_within_a_period() {
        let mut around = around(6000.0);
        let before = around.angle_turns();
        around.stretch([Gate::default(); 3], 10e-6);
        let pole_pairs = f64::from(around.bench().motor.pole_pairs);
        let turned = around.angle_turns() - before;
        assert!(
            (turned - 100.0 * 10e-6 * pole_pairs).abs() < 1e-4,
            "{turned}"
        );
        assert!(around.end_period().is_some() && around.end_period().is_none());
    }
}
