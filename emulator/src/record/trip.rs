//! The control periods of a fault record as rows of a recording.
//!
//! They show what the ESC saw: currents and voltages in the rotor's frame are computed from readings and duties with
//! its own angle estimate, and its speed stands for the true one.

use std::f64::consts::TAU;

use siskin_control::drive::{Faults, Phase};
use siskin_control::record::{PeriodSeen, Recorded};

use super::Row;

/// Returns the rows of a record; none if no trip holds any periods.
pub(crate) fn rows(recorded: &Recorded) -> Vec<Row> {
    let of = |holder| recorded.faults.iter().find(|seen| seen.number == holder);
    // The fault itself may have been overwritten by later ones.
    let seen = recorded.holder.and_then(of);
    let phase = seen.map(|seen| seen.phase);
    let mut faults = Faults::NONE;
    if let Some(seen) = seen {
        faults.insert(seen.fault);
    }
    let mut rows: Vec<_> = recorded.periods.iter().map(|p| row(p, phase)).collect();
    if let Some(last) = rows.last_mut() {
        last.faults = Some(faults.bits());
        last.phase = Some(Phase::Idle);
    }
    rows
}

fn row(seen: &PeriodSeen, phase: Option<Phase>) -> Row {
    let angle = f64::from(seen.angle_deg) / 360.0 * TAU;
    let turned = |abc: [f32; 3]| dq(abc, angle);
    let driven = seen.duties.map(|duty| duty.unwrap_or(0.0));
    let switches = seen.duties.iter().all(Option::is_some);
    let [i_d, i_q] = turned(seen.currents_a);
    let [u_d, u_q] = turned(driven.map(|duty| duty * seen.bus_v));
    let drawn = driven.iter().zip(seen.currents_a);
    Row {
        t_s: (f64::from(seen.time_s) * 1e9).round() / 1e9,
        phase,
        faults: Some(0),
        rpm: seen.rpm,
        rpm_est: Some(seen.rpm),
        rpm_ref: None,
        angle_deg: seen.angle_deg,
        angle_est_deg: Some(seen.angle_deg),
        angle_error_deg: None,
        i_a_a: seen.currents_a[0],
        i_b_a: seen.currents_a[1],
        i_c_a: seen.currents_a[2],
        i_d_a: Some(i_d),
        i_q_a: Some(i_q),
        u_d_v: switches.then_some(u_d),
        u_q_v: switches.then_some(u_q),
        duty_a: seen.duties[0],
        duty_b: seen.duties[1],
        duty_c: seen.duties[2],
        bus_v: seen.bus_v,
        bus_a: drawn.map(|(duty, current_a)| duty * current_a).sum(),
        torque_nm: 0.0,
    }
}

/// Returns the components along and across an axis at this angle from phase a's, with the phases' amplitude.
fn dq([a, b, c]: [f32; 3], angle: f64) -> [f32; 2] {
    let alpha = f64::from(2.0 * a - b - c) / 3.0;
    let beta = f64::from(b - c) / 3.0_f64.sqrt();
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    [alpha * cos + beta * sin, beta * cos - alpha * sin].map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_current_along_the_axis_has_the_phases_amplitude() {
        for degrees in [0.0, 30.0, 200.0] {
            let angle = degrees / 360.0 * TAU;
            let phase = |lag: f64| (3.0 * libm::cos(angle - lag)) as f32;
            let [d, q] = dq(
                [phase(0.0), phase(TAU / 3.0), phase(TAU * 2.0 / 3.0)],
                angle,
            );
            assert!((d - 3.0).abs() < 1e-5 && q.abs() < 1e-5, "{d} {q}");
        }
    }
}
