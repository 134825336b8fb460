//! Latency from the last edge of a throttle frame to the set-point of a control period.

use siskin_control::drive::Setpoint;
use siskin_emulator::device::{Device, Onlooker, Start};
use siskin_emulator::rig::{Period, Rig};
use siskin_params::ParamId;
use siskin_throttle::dshot::{Frame, check_mask};

/// Measures from the last edge of a frame before each set-point change to when `step` first gets the new
/// one.
#[derive(Default)]
struct Latency {
    edge_ns: u64,
    /// The frame has been answered: the edges that follow are the reply's.
    answered: bool,
    setpoint: Option<Setpoint>,
    /// Changes seen, and their longest latency.
    changes: u32,
    longest_s: f64,
}

impl Onlooker for Latency {
    fn edge(&mut self, time_ns: u64, _: bool) {
        if !self.answered {
            self.edge_ns = time_ns;
        }
    }

    fn answer(&mut self, _: u64, _: &[u8]) {
        self.answered = true;
    }

    fn period(&mut self, t_s: f64, period: &Period, _: &Rig) {
        let before = self.setpoint.replace(period.setpoint);
        if before.is_some_and(|before| before != period.setpoint) {
            self.changes += 1;
            self.longest_s = self.longest_s.max(t_s - self.edge_ns as f64 * 1e-9);
        }
    }
}

fn device() -> Device {
    let (device, _) = Device::start(Start {
        overrides: vec![(ParamId::CtlMode, 2.0)],
        ..Start::default()
    })
    .expect("voltage mode fits the bench");
    device
}

/// Plays a datagram at one time and runs until another.
fn play(device: &mut Device, at_ns: u64, datagram: &[u8], until_ns: u64, latency: &mut Latency) {
    device.advance(at_ns, |_, _| None, latency, &mut |_| {});
    let now_ns = device.now_ns();
    latency.answered = false;
    device
        .wire()
        .play(at_ns.max(now_ns), datagram)
        .expect("there is room on the wire");
    device.advance(until_ns, |_, _| None, latency, &mut |_| {});
}

fn dshot(protocol: u8, value: u16) -> [u8; 3] {
    let frame = Frame {
        value,
        telemetry: false,
    };
    let bits = frame.to_bits() ^ check_mask(protocol >= 20);
    let [low, high] = bits.to_le_bytes();
    [protocol, low, high]
}

fn pulse(protocol: u8, width_ns: u32) -> [u8; 5] {
    let [a, b, c, d] = width_ns.to_le_bytes();
    [protocol, a, b, c, d]
}

/// Arms, opens, and then changes the throttle a thousand times at all phases of the PWM.
///
/// Returns the longest time to the set-point, less a control period, s.
fn beyond_a_period(spacing_ns: u64, datagram: impl Fn(u64) -> Vec<u8>) -> f64 {
    let mut device = device();
    let mut latency = Latency::default();
    for number in 0..1403_u64 {
        if number == 400 {
            latency = Latency::default();
        }
        let at_ns = number * spacing_ns;
        let until_ns = at_ns + spacing_ns;
        let datagram = datagram(number);
        play(&mut device, at_ns, &datagram, until_ns, &mut latency);
    }
    assert!(latency.changes >= 999, "{} changes", latency.changes);
    latency.longest_s - device.rig().period_s()
}

/// Returns a frame's throttle: zero while arming, then another step each time.
fn step(number: u64) -> u32 {
    match number {
        0..400 => 0,
        _ => 1 + (number % 97) as u32,
    }
}

#[test]
fn a_frame_is_in_the_set_point_within_a_control_period() {
    for protocol in [10, 11, 12, 13, 20, 21, 22, 23] {
        let beyond_s = beyond_a_period(1_003_700, |number| {
            let value = match step(number) {
                0 => 0,
                step => 147 + step as u16,
            };
            dshot(protocol, value).to_vec()
        });
        assert!(beyond_s <= 0.0, "{protocol}: {beyond_s} s more");
    }
}

/// A pulse has no checksum, so its end is believed only after the filter time.
#[test]
fn a_pulse_is_in_the_set_point_within_a_control_period_and_the_filter_s_time() {
    let kinds = [
        (0, 2_203_700, 1_000_000, 2_000_000, 2e-6),
        (1, 1_003_700, 125_000, 250_000, 0.5e-6),
        (2, 1_003_700, 42_000, 84_000, 0.5e-6),
        (3, 1_003_700, 5_000, 25_000, 0.2e-6),
    ];
    for (protocol, spacing_ns, least_ns, most_ns, filter_s) in kinds {
        let beyond_s = beyond_a_period(spacing_ns, |number| {
            // Up to 2 % of the range is zero.
            let percent = step(number).saturating_add(u32::from(number >= 400) * 2);
            let width_ns = least_ns + (most_ns - least_ns) / 100 * percent;
            pulse(protocol, width_ns).to_vec()
        });
        assert!(beyond_s <= filter_s + 1e-9, "{protocol}: {beyond_s} s more");
    }
}
