//! The motor on its shaft: the circuit within a period, and the speed from period to period.
//!
//! The speed is constant within a period, at the mid-period value expected from the last period's torque; at the end
//! the period's mean torque moves it (3).

use std::f64::consts::TAU;

use super::circuit::{Circuit, Course, Drive, Moment, Stretch, Sums, Way, confine};
use super::conduction::Conduction;
use super::magnetics::Magnetics;
use super::series::{fraction, settle};
use super::shaft::Shaft;
use super::thermal::Warming;
use super::vector::{back, largest, phases, turn};
use super::{Cogging, Drag, Extras, Load, Motor};

/// The speed at which the simulation ends, rad/s: a million rpm, five times what a scenario may impose.
pub const RUNAWAY_RAD_S: f64 = 1e6 * TAU / 60.0;

/// Means over a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Electromagnetic torque, Nm.
    pub torque_nm: f64,
    /// Its square.
    pub torque_square: f64,
    /// Electrical power into the motor, W.
    pub motor_w: f64,
    /// Power lost in the windings, W.
    pub copper_w: f64,
    /// Current from the supply, A.
    pub bus_a: f64,
    /// Greatest phase current among those computed: with the switches, at each of their edges, A.
    pub most_a: f64,
    /// Power lost to the motor's friction and iron while the shaft is free, W.
    pub drag_w: f64,
}

/// A motor with its load.
#[derive(Clone, Debug)]
pub(super) struct Machine {
    motor: Motor,
    /// What its resistance and flux have been multiplied with.
    drifted: [f64; 2],
    /// The circuit is another from the next period on.
    changes: bool,
    load: Load,
    inertia_kgm2: f64,
    /// Speed at which the shaft is held while nothing blocks it, rad/s.
    imposed_rad_s: Option<f64>,
    /// Speed at which it is held whatever the torque, rad/s.
    held_rad_s: Option<f64>,
    /// Flux against current, if not the ideal motor's.
    magnetics: Option<Box<Magnetics>>,
    /// What heats the winding, if anything.
    warming: Option<Warming>,
    /// What else acts on the shaft, if anything.
    shaft: Option<Box<Shaft>>,
    /// Electrical angle at the start of the period in turns, 0..1.
    angle_turns: f64,
    /// Mechanical speed at the start of the period, rad/s.
    speed_rad_s: f64,
    /// Mechanical acceleration over the last period, rad/s².
    acceleration: f64,
    /// The circuit in this period.
    pub(super) circuit: Circuit,
    /// Its progress.
    pub(super) course: Course,
}

impl Machine {
    /// Creates a motor and its load without current, at a mechanical speed and an electrical angle in turns.
    pub(super) fn new(motor: Motor, load: Load, speed_rad_s: f64, angle_turns: f64) -> Self {
        let angle_turns = fraction(angle_turns);
        let (sin, cos) = libm::sincos(TAU * angle_turns);
        Self {
            motor,
            drifted: [1.0; 2],
            changes: false,
            load,
            inertia_kgm2: motor.inertia_kgm2 + load.inertia_kgm2,
            imposed_rad_s: None,
            held_rad_s: None,
            magnetics: None,
            warming: None,
            shaft: None,
            angle_turns,
            speed_rad_s,
            acceleration: 0.0,
            circuit: Circuit::new(&motor),
            course: Course {
                now: Moment {
                    i: [0.0; 2],
                    direction: [cos, sin],
                },
                sums: Sums::default(),
                most_a: 0.0,
            },
        }
    }

    /// Gives an ideal motor, at rest, the deviations of a real one.
    pub(super) fn fit(&mut self, extras: &Extras) {
        self.magnetics = Magnetics::new(&self.motor, extras).map(Box::new);
        let cold_ohm = self.motor.resistance_ohm;
        self.warming = extras
            .winding
            .map(|winding| Warming::new(winding, cold_ohm));
        if !extras.runs_freely() {
            let pole_pairs = self.motor.pole_pairs;
            let shaft = Shaft::new(pole_pairs, extras.drag, extras.cogging);
            self.shaft = Some(Box::new(shaft));
        }
    }

    /// Returns true if the currents have a closed solution between two changes of the inverter, and solutions
    /// superpose.
    #[inline(always)] // in each period
    pub(super) fn is_linear(&self) -> bool {
        self.magnetics.is_none()
    }

    /// Returns the present phase resistance, Ω.
    pub(super) fn resistance_ohm(&self) -> f64 {
        self.motor.resistance_ohm
    }

    /// Flux linkage of a phase now, peak Wb.
    pub(super) fn flux_wb(&self) -> f64 {
        self.motor.flux_wb
    }

    /// Lets resistance and flux be so many times those of the start, whatever else heat does to the winding.
    pub(super) fn drift(&mut self, factors: [f64; 2]) {
        let before = std::mem::replace(&mut self.drifted, factors);
        let [resistance, flux] = [0, 1].map(|which| factors[which] / before[which]);
        self.motor.resistance_ohm *= resistance;
        self.motor.flux_wb *= flux;
        if let Some(warming) = &mut self.warming {
            warming.scale(resistance);
        }
        if let Some(magnetics) = &mut self.magnetics {
            magnetics.scale(flux);
        }
        self.changes = true;
    }

    /// Returns the winding's temperature, °C, if simulated.
    pub(super) fn winding_c(&self) -> Option<f64> {
        self.warming.as_ref().map(Warming::temperature_c)
    }

    /// Holds the shaft at this speed, rad/s, whatever the torque.
    pub(super) fn impose(&mut self, speed_rad_s: f64) {
        self.imposed_rad_s = Some(speed_rad_s);
        self.hold(self.imposed_rad_s);
    }

    /// Blocks the shaft, or releases it.
    pub(super) fn block(&mut self, blocked: bool) {
        self.hold(if blocked {
            Some(0.0)
        } else {
            self.imposed_rad_s
        });
    }

    fn hold(&mut self, speed_rad_s: Option<f64>) {
        self.held_rad_s = speed_rad_s;
        if let Some(speed_rad_s) = speed_rad_s {
            self.speed_rad_s = speed_rad_s;
            self.acceleration = 0.0;
        }
    }

    /// Adds to the speed of a shaft that is not held, rad/s.
    pub(super) fn kick(&mut self, speed_rad_s: f64) {
        if self.held_rad_s.is_none() {
            self.speed_rad_s += speed_rad_s;
        }
    }

    /// Returns what else acts on the shaft.
    pub(super) fn shaft_mut(&mut self) -> &mut Shaft {
        let pole_pairs = self.motor.pole_pairs;
        let free = || Box::new(Shaft::new(pole_pairs, Drag::default(), Cogging::default()));
        self.shaft.get_or_insert_with(free)
    }

    /// Changes the ambient temperature, °C.
    pub(super) fn set_ambient_c(&mut self, ambient_c: f64) {
        if let Some(warming) = &mut self.warming {
            warming.set_ambient_c(ambient_c);
        }
    }

    /// Returns the electrical angle at the start of the period in turns, 0..1.
    pub(super) fn angle_turns(&self) -> f64 {
        self.angle_turns
    }

    /// Returns the mechanical speed at the start of the period, rad/s.
    pub(super) fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s
    }

    /// Returns the present currents and rotor direction.
    pub(super) fn now(&self) -> &Moment {
        &self.course.now
    }

    /// Returns the currents into the phases, A.
    #[inline(always)] // in each period
    pub(super) fn currents_a(&self) -> [f64; 3] {
        phases(self.now().stator_a())
    }

    /// Returns the voltages of currentless phases against the star, V: the back-EMF, and in a motor that is not round
    /// what the other phases couple into an open one.
    pub(super) fn emf_v(&self, at: &Moment, drive: &Drive) -> [f64; 3] {
        if let Some(magnetics) = &self.magnetics {
            let open = match drive.way {
                Way::Without(phase) => Some(phase),
                Way::Star | Way::Nowhere => None,
            };
            return magnetics.phases_v(&self.circuit, at, drive.u, open);
        }
        let peak = self.circuit.emf_v;
        phases([-peak * at.direction[1], peak * at.direction[0]])
    }

    /// Returns the greatest voltage that the rotor induces between two phases, V.
    pub(super) fn line_v(&self) -> f64 {
        let peak = self.magnetics.as_ref().map_or(1.0, |m| m.peak());
        3.0_f64.sqrt() * self.circuit.emf_v.abs() * peak
    }

    /// Returns the angular speed of the fastest wave that the rotor induces, rad/s.
    pub(super) fn fastest_rad_s(&self) -> f64 {
        let order = self.magnetics.as_ref().map_or(1.0, |m| m.order());
        self.circuit.omega.abs() * order
    }

    /// Keeps a current that has reached zero with its phase open at zero.
    pub(super) fn open(&mut self, way: Way) {
        let now = &mut self.course.now;
        now.i = back(confine(now.stator_a(), way), now.direction);
    }

    /// Begins a period.
    #[inline(always)] // in each period
    pub(super) fn begin(&mut self, period_s: f64) {
        let omega = settle(self.middle_rad_s(period_s)) * f64::from(self.motor.pole_pairs);
        if std::mem::take(&mut self.changes) || self.warming.is_some() {
            self.circuit = Circuit::new(&self.motor);
        }
        self.circuit.turn_at(omega, 0.5 * period_s);
        self.course.sums = Sums::default();
        self.course.most_a = largest(self.now().stator_a());
    }

    /// Returns the expected mid-period speed, rad/s.
    fn middle_rad_s(&self, period_s: f64) -> f64 {
        self.speed_rad_s + 0.5 * period_s * self.acceleration
    }

    /// Advances the currents and the rotor.
    #[inline(always)] // in each period
    pub(super) fn conduct(&mut self, drive: &Drive, stretch: &Stretch) {
        if let Some(magnetics) = &self.magnetics {
            let conduction = Conduction {
                magnetics,
                circuit: &self.circuit,
            };
            let flux_wb = self.motor.flux_wb;
            conduction.conduct(&mut self.course, drive, stretch.time_s, flux_wb);
        } else {
            self.circuit.conduct(&mut self.course, drive, stretch);
        }
    }

    /// Advances the currents and the rotor at a mean voltage; the supply provides the power that goes into the motor.
    #[inline(always)] // in each period
    pub(super) fn conduct_mean(&mut self, u: [f64; 2], bus_v: f64, time_s: f64) {
        if self.is_linear() {
            let course = &mut self.course;
            self.circuit.conduct_mean(course, u, bus_v, time_s);
            return;
        }
        let share = 1.5 / bus_v.max(1.0);
        let drive = Drive {
            u,
            to_bus: [u[0] * share, u[1] * share],
            way: Way::Star,
        };
        self.conduct(&drive, &self.circuit.stretch(time_s));
    }

    /// Returns the phase currents expected in the middle of a stretch, A: i_d and i_q held constant, and the rotor's
    /// turn taken as a straight line, 2 % too long at 0.2 rad.
    #[inline(always)] // in each period
    pub(super) fn middle_a(&self, time_s: f64) -> [f64; 3] {
        let turned = 0.5 * self.circuit.omega * time_s;
        phases(turn(self.now().stator_a(), [1.0, turned]))
    }

    /// Returns the currents and the rotor after a time of at most half a period.
    pub(super) fn after(&self, drive: &Drive, time_s: f64) -> Moment {
        match &self.magnetics {
            Some(magnetics) => Conduction {
                magnetics,
                circuit: &self.circuit,
            }
            .at(self.now(), drive, time_s),
            None => {
                let stretch = self.circuit.stretch(time_s);
                self.circuit.solve(self.now(), drive, &stretch).end
            }
        }
    }

    /// Returns the energy in the currents' flux, the shaft's motion and its detents, J.
    #[cfg(test)]
    pub(super) fn stored_j(&self) -> f64 {
        let [d, q] = self.now().i;
        let electric_j = match &self.magnetics {
            Some(magnetics) => magnetics.stored_j([d, q]),
            None => 0.75 * self.motor.inductance_h * (d * d + q * q),
        };
        let detents_j = self.shaft.as_ref().map(|s| s.stored_j(self.angle_turns));
        let moved_j = 0.5 * self.inertia_kgm2 * self.speed_rad_s * self.speed_rad_s;
        electric_j + moved_j + detents_j.unwrap_or_default()
    }

    /// Ends the period: the shaft takes its mean torque.
    #[inline(always)] // in each period
    pub(super) fn finish(&mut self, period_s: f64) -> Flow {
        let turns = self.circuit.omega * period_s * (1.0 / TAU);
        let angle_turns = self.angle_turns;
        self.angle_turns = fraction(angle_turns + turns);
        let middle_rad_s = self.middle_rad_s(period_s);
        let Course { now, sums, most_a } = &mut self.course;
        let [cos, sin] = now.direction;
        // One Newton step towards length 1 keeps rounding from accumulating.
        let correction = 1.5 - 0.5 * (cos * cos + sin * sin);
        now.direction = [cos * correction, sin * correction];
        now.i = now.i.map(settle);

        let share = 1.0 / period_s;
        let torque_per_a = 1.5 * f64::from(self.motor.pole_pairs) * self.motor.flux_wb;
        let torque_nm = torque_per_a * sums.q * share;
        let mut drag_w = 0.0;
        if let Some(shaft) = &mut self.shaft {
            shaft.turn(angle_turns, turns);
            if self.held_rad_s.is_none() {
                let speeds = [self.speed_rad_s, middle_rad_s];
                let (load, inertia) = (&self.load, self.inertia_kgm2);
                let push = shaft.push(load, inertia, speeds, torque_nm, period_s);
                drag_w = push.drag_w;
                [self.speed_rad_s, self.acceleration] =
                    accelerated(self.speed_rad_s, push.acceleration, period_s);
            }
        } else if self.held_rad_s.is_none() {
            // The load by the trapezoidal rule, stable however stiff the load.
            let damping = self.load.damping_at(middle_rad_s);
            let inertia = self.inertia_kgm2 + 0.5 * period_s * damping;
            let torque = torque_nm - damping * self.speed_rad_s;
            // The division need not wait for the torque.
            let acceleration = torque * (1.0 / inertia);
            [self.speed_rad_s, self.acceleration] =
                accelerated(self.speed_rad_s, acceleration, period_s);
        }
        let flow = Flow {
            torque_nm,
            torque_square: torque_per_a * torque_per_a * sums.squares[1] * share,
            motor_w: 1.5 * self.circuit.inverse_r * sums.energy * share,
            copper_w: 1.5 * self.motor.resistance_ohm * (sums.squares[0] + sums.squares[1]) * share,
            bus_a: self.circuit.inverse_r * sums.charge * share,
            most_a: *most_a,
            drag_w,
        };
        if let Some(warming) = &mut self.warming {
            self.motor.resistance_ohm = warming.advance(period_s, flow.copper_w);
        }
        flow
    }
}

/// Returns the speed after a period, and the acceleration to go on with. A runaway stays at the end of what is
/// simulated: the steps of a period grow with the speed, and so would the wait for whoever finds out.
#[inline(always)] // in each period
fn accelerated(speed_rad_s: f64, acceleration: f64, period_s: f64) -> [f64; 2] {
    let speed_rad_s = settle(speed_rad_s + period_s * acceleration);
    if speed_rad_s.abs() > RUNAWAY_RAD_S {
        return [RUNAWAY_RAD_S.copysign(speed_rad_s), 0.0];
    }
    [speed_rad_s, acceleration]
}
