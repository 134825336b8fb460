//! The shaft's motion against its command: turning back, reaching and settling.

use siskin_control::drive::Setpoint;
use siskin_units::{Current, Speed};

use super::since::Since;
use crate::shaft::Units;

/// Share of a speed from which the shaft has reached it.
const REACHED: f64 = 0.95;

/// Share of a speed within which it has settled.
const SETTLED: f64 = 0.01;

/// Sums over the periods of a window.
#[derive(Clone, Debug)]
pub(super) struct Turning {
    /// The command.
    setpoint: Setpoint,
    /// Its speed, rpm; 0 if none.
    command_rpm: f64,
    reached: Since,
    settled: Since,
    /// 1 or −1: the commanded direction.
    forward: f64,
    /// Forward rotation since the direction was commanded, degrees.
    angle_deg: f64,
    furthest_deg: f64,
    turned_back_deg: f64,
}

impl Turning {
    pub(super) const fn new() -> Self {
        Self {
            setpoint: Setpoint::Stop,
            command_rpm: 0.0,
            reached: Since(None),
            settled: Since(None),
            forward: 1.0,
            angle_deg: 0.0,
            furthest_deg: 0.0,
            turned_back_deg: 0.0,
        }
    }

    /// Adds a period that began at `t_s` with the shaft at `rpm`.
    pub(super) fn add(&mut self, t_s: f64, rpm: f64, setpoint: Setpoint, units: Units) {
        if setpoint != self.setpoint {
            self.change(setpoint, units);
        }
        let command = self.command_rpm;
        let wanted = command != 0.0;
        let share = command.abs();
        self.reached
            .add(t_s, wanted && rpm * command.signum() >= REACHED * share);
        self.settled
            .add(t_s, wanted && (rpm - command).abs() <= SETTLED * share);
        self.furthest_deg = self.furthest_deg.max(self.angle_deg);
        self.turned_back_deg = self.turned_back_deg.max(self.furthest_deg - self.angle_deg);
        self.angle_deg += self.forward * rpm * (360.0 / 60.0) * f64::from(units.scale.period_s);
    }

    /// Changes the command.
    fn change(&mut self, setpoint: Setpoint, units: Units) {
        self.setpoint = setpoint;
        self.command_rpm = match setpoint {
            Setpoint::Speed(speed) => units.rpm(speed),
            _ => 0.0,
        };
        // It may have been near the new speed by chance.
        self.settled = Since(None);
        let forward = forward(setpoint).map_or(self.forward, |along| along * units.sign());
        if forward != self.forward {
            self.forward = forward;
            self.angle_deg = 0.0;
            self.furthest_deg = 0.0;
        }
    }

    /// Returns when the shaft reached 95 % of the command for good, s.
    pub(super) fn reached_at_s(&self) -> Option<f64> {
        self.reached.0
    }

    /// Returns when it came within 1 % of the last commanded speed for good, s.
    pub(super) fn settled_at_s(&self) -> Option<f64> {
        self.settled.0
    }

    /// Returns the most by which it fell behind the furthest point reached, degrees.
    pub(super) fn turned_back_deg(&self) -> f64 {
        self.turned_back_deg
    }
}

/// Returns 1 or −1 if a set-point turns the motor along or against the configured direction.
fn forward(setpoint: Setpoint) -> Option<f64> {
    let backward = match setpoint {
        Setpoint::Speed(speed) if speed != Speed::ZERO => speed < Speed::ZERO,
        Setpoint::Torque(current) | Setpoint::Test(current) if current != Current::ZERO => {
            current < Current::ZERO
        }
        Setpoint::Voltage(share) if share != 0 => share < 0,
        _ => return None,
    };
    Some(if backward { -1.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use siskin_control::drive::Direction;
    use siskin_units::Scale;

    use super::*;

    const SCALE: Scale = Scale {
        period_s: 1e-3,
        current_a: 1.0,
        voltage_v: 1.0,
        pole_pairs: 1.0,
    };

    /// Plays (seconds, commanded rpm, rpm of the shaft) in periods of a millisecond.
    fn turning(stretches: &[(f64, f32, f64)]) -> Turning {
        configured(Direction::Normal, stretches)
    }

    fn configured(direction: Direction, stretches: &[(f64, f32, f64)]) -> Turning {
        let units = Units {
            scale: &SCALE,
            direction,
        };
        let mut turning = Turning::new();
        let mut periods = 0;
        for &(length_s, command, rpm) in stretches {
            let setpoint = if command == 0.0 {
                Setpoint::Zero
            } else {
                Setpoint::Speed(SCALE.speed_from_rpm(command))
            };
            for _ in 0..(length_s * 1000.0).round() as u32 {
                turning.add(f64::from(periods) * 1e-3, rpm, setpoint, units);
                periods += 1;
            }
        }
        turning
    }

    #[test]
    fn reached_is_where_95_percent_are_held_from() {
        let at = |stretches: &[_]| turning(stretches).reached_at_s();
        let held = [(0.1, 1000.0, 0.0), (0.1, 1000.0, 960.0)];
        assert!((at(&held).unwrap() - 0.1).abs() < 1e-9);
        // The first time was not for good, and more than commanded is enough.
        let again = [
            (0.1, 1000.0, 960.0),
            (0.1, 1000.0, 940.0),
            (0.1, 1000.0, 1500.0),
        ];
        assert!((at(&again).unwrap() - 0.2).abs() < 1e-9);
        let backward = [(0.1, -1000.0, 960.0), (0.1, -1000.0, -960.0)];
        assert!((at(&backward).unwrap() - 0.1).abs() < 1e-9);
        assert_eq!(at(&[(0.1, 1000.0, 960.0), (0.1, 1000.0, 940.0)]), None);
        assert_eq!(at(&[(0.1, 0.0, 0.0)]), None);
    }

    #[test]
    fn settled_is_within_1_percent_of_the_last_command() {
        let at = |stretches: &[_]| turning(stretches).settled_at_s();
        let step = [
            (0.1, 1000.0, 1001.0),
            (0.1, 2000.0, 1500.0),
            (0.1, 2000.0, 2030.0),
            (0.1, 2000.0, 1985.0),
        ];
        assert!((at(&step).unwrap() - 0.3).abs() < 1e-9);
        // If the shaft was at the new speed before the command, it counts from the command.
        let early = [(0.1, 1000.0, 2000.0), (0.1, 2000.0, 2000.0)];
        assert!((at(&early).unwrap() - 0.1).abs() < 1e-9);
        assert_eq!(at(&[(0.1, 1000.0, 1020.0)]), None);
    }

    #[test]
    fn turning_back_is_measured_from_the_furthest_point() {
        let back = |stretches: &[_]| turning(stretches).turned_back_deg();
        // 60 rpm is a degree in 2.78 ms: 0.25 s is 90 degrees.
        let swing = [
            (0.1, 1000.0, -60.0),
            (0.25, 1000.0, 60.0),
            (0.2, 1000.0, -60.0),
            (0.1, 1000.0, 60.0),
        ];
        assert!((back(&swing) - 72.0).abs() < 0.5, "{}", back(&swing));
        assert!(back(&[(0.25, 1000.0, 60.0)]) < 1e-9);
        // Commanded the other way, that is forward.
        assert!(back(&[(0.25, -1000.0, -60.0)]) < 1e-9);
        let reversed = [(0.25, 1000.0, 60.0), (0.25, -1000.0, -60.0)];
        assert!(back(&reversed) < 1e-9);
    }

    #[test]
    fn forward_is_as_configured() {
        let reversed = |stretches: &[_]| configured(Direction::Reversed, stretches);
        let asked = reversed(&[(0.1, 1000.0, 0.0), (0.1, 1000.0, -1000.0)]);
        assert!(asked.turned_back_deg() < 1e-9);
        assert!((asked.reached_at_s().unwrap() - 0.1).abs() < 1e-9);
        assert!((asked.settled_at_s().unwrap() - 0.1).abs() < 1e-9);
        let wrong = reversed(&[(0.25, 1000.0, 60.0)]);
        assert!((wrong.turned_back_deg() - 90.0).abs() < 0.5);
        assert_eq!(wrong.reached_at_s(), None);
    }
}
