//! Another motor for a running ESC.

use siskin_control::drive::Phase;

use super::Device;
use crate::fault::InForce;
use crate::rig::Bench;

/// Speed below which the shaft counts as at rest, rad/s: 10 rpm, at which a hand could hold it.
const AT_REST_RAD_S: f64 = 1.0;

impl Device {
    /// Replaces the motor and load with those of a bench. What is broken stays broken.
    ///
    /// # Errors
    /// The motor turns, or something turns it.
    pub fn fit(&mut self, bench: &Bench) -> Result<(), &'static str> {
        let phase = self.rig.snapshot().phase;
        let rests = self.rig.plant().speed_rad_s().abs() < AT_REST_RAD_S;
        // A tone does not turn it.
        if !rests || !matches!(phase, Phase::Idle | Phase::Brake | Phase::Tone) {
            return Err("the motor turns: stop it before another takes its place");
        }
        self.rig.around_mut().fit(bench);
        let now = self.faults.now;
        // Earlier kicks of the shaft are over.
        let whole = InForce {
            kicked_rad_s: now.kicked_rad_s,
            ..InForce::default()
        };
        self.rig.disturb(&whole, &now);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use siskin_control::drive::Setpoint;

    use super::*;
    use crate::device::Start;
    use crate::fault::{Fault, Kind};
    use crate::rig::{Period, Rig};
    use crate::scenario;

    const RPM: f32 = 3000.0;

    fn run(device: &mut Device, ms: u64, setpoint: Setpoint) {
        let until_ns = device.now_ns() + 1_000_000 * ms;
        let nobody = &mut |_: f64, _: &Period, _: &Rig| {};
        device.advance(until_ns, |_, _| Some(setpoint), nobody, &mut |_| {});
    }

    #[test]
    fn only_a_motor_at_rest_gives_way_and_what_is_broken_stays_so() {
        let mut device = Device::start(Start::default()).unwrap().0;
        let fast = Setpoint::Speed(device.rig().config().scale.speed_from_rpm(RPM));
        let quad = scenario::stand("quad-5-inch", toml::Table::new()).unwrap();
        run(&mut device, 1500, fast);
        let speed_rad_s = device.rig().plant().speed_rad_s();
        assert!(speed_rad_s > 100.0 && device.fit(&quad.bench).is_err());
        assert_eq!(device.rig().plant().speed_rad_s(), speed_rad_s);

        run(&mut device, 3000, Setpoint::Stop);
        device.inject(Fault {
            at_s: 0.0,
            for_s: None,
            kind: Kind::RotorBlocked,
        });
        run(&mut device, 1, Setpoint::Stop);
        assert_eq!(device.fit(&quad.bench), Ok(()));
        let bench = device.rig().around().bench();
        assert_eq!(
            (bench.motor, bench.load),
            (quad.bench.motor, quad.bench.load)
        );
        run(&mut device, 500, fast);
        assert_eq!(device.rig().plant().speed_rad_s(), 0.0);
    }
}
