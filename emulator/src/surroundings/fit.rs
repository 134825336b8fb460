//! Replacing the motor.

use super::Surroundings;
use crate::bench::Bench;
use crate::plant::Plant;

impl Surroundings {
    /// Replaces the motor and load, at rest, with those of a bench.
    pub fn fit(&mut self, bench: &Bench) {
        self.bench.motor = bench.motor;
        self.bench.load = bench.load;
        self.bench.extras = bench.extras.clone();
        let own = &self.bench;
        let angle_turns = own.initial_angle_turns;
        let mut plant = Plant::new(own.plant, own.motor, own.load, 0.0, angle_turns);
        plant.fit(&own.extras);
        if let Some(speed_rad_s) = own.imposed_rad_s {
            plant.impose(speed_rad_s);
        }
        plant.set_ambient_c(self.air.ambient_c);
        self.plant = plant;
        self.push();
    }
}
