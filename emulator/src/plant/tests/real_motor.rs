//! How a real motor departs from the ideal one.

use super::*;

fn harmonics() -> Vec<Harmonic> {
    let harmonic = |order, share, phase_rad| Harmonic {
        order,
        share,
        phase_rad,
    };
    vec![
        harmonic(3, 0.1, 0.3),
        harmonic(5, 0.06, 0.0),
        harmonic(7, 0.04, 1.0),
        harmonic(11, 0.01, -0.7),
    ]
}

fn held_with(extras: &Extras, rpm: f64, angle_turns: f64) -> Plant {
    let mut plant = Plant::new(
        Fidelity::Switching,
        *MOTOR,
        Load::default(),
        0.0,
        angle_turns,
    );
    plant.fit(extras);
    plant.impose(rpm * TAU / 60.0);
    plant
}

fn with_harmonics() -> Extras {
    Extras {
        harmonics: harmonics(),
        ..Extras::default()
    }
}

/// An ideal motor solved numerically nonetheless: with a harmonic of zero amplitude.
fn unheard() -> Extras {
    Extras {
        harmonics: vec![Harmonic {
            order: 5,
            share: 0.0,
            phase_rad: 0.0,
        }],
        ..Extras::default()
    }
}

fn iron() -> Extras {
    Extras {
        saliency: 1.4,
        saturation_a: 25.0,
        ..Extras::default()
    }
}

#[test]
fn field_oriented_drive_with_harmonics_is_as_by_brute_force() {
    let plant = held_with(&with_harmonics(), 4500.0, 0.1);
    compare_with(&harmonics(), plant, 24.0, 30, |_, plant| {
        [field_oriented(plant, 5.0, 24.0); 2]
    });
}

#[test]
fn six_step_commutation_with_harmonics_is_as_by_brute_force() {
    let plant = held_with(&with_harmonics(), 4000.0, 0.02);
    compare_with(&harmonics(), plant, 24.0, 40, |_, plant| {
        [six_step(plant); 2]
    });
}

#[test]
fn a_bridge_that_rectifies_harmonics_is_as_by_brute_force() {
    let plant = held_with(&with_harmonics(), 6000.0, 0.55);
    compare_with(&harmonics(), plant, 12.0, 60, |_, _| [Bridge::Off; 2]);
}

#[test]
fn the_numeric_solution_of_an_ideal_motor_is_the_closed_one() {
    let mut numeric = held_with(&unheard(), 5000.0, 0.3);
    let mut closed = held(Fidelity::Switching, 5000.0, 0.3);
    for k in 0..60 {
        let bridge = match k {
            0..20 => field_oriented(&closed, 8.0, 24.0),
            20..40 => six_step(&closed),
            _ => Bridge::Off,
        };
        let flows = [&mut numeric, &mut closed]
            .map(|plant| plant.period([bridge; 2], 24.0, PERIOD_S, DEAD_TIME_S));
        let [ours, theirs] =
            flows.map(|f| [f.torque_nm, f.torque_square, f.motor_w, f.copper_w, f.bus_a]);
        for (ours, theirs) in ours.into_iter().zip(theirs) {
            // The closed solution's own integrals of squares are accurate to 1e-4.
            assert!(
                (ours - theirs).abs() < 1e-3 * theirs.abs() + 1e-4,
                "{k}: {ours} {theirs}"
            );
        }
        for (a, b) in numeric.currents_a().into_iter().zip(closed.currents_a()) {
            assert!((a - b).abs() < 1e-5, "{k}: {a} {b}");
        }
    }
}

/// The torque of a whole period at once equals that of the numeric solution's small steps.
#[test]
fn a_mean_over_a_whole_period_makes_its_torque() {
    for rpm in [600.0, 4500.0, 7500.0, 12_000.0] {
        let mut closed = held(Fidelity::Averaged, rpm, 0.3);
        let mut numeric = held(Fidelity::Averaged, 0.0, 0.3);
        numeric.fit(&unheard());
        numeric.impose(rpm * TAU / 60.0);
        for _ in 0..50 {
            let bridge = field_oriented(&closed, 8.0, 60.0);
            let [ours, theirs] = [&mut closed, &mut numeric]
                .map(|plant| plant.period([bridge; 2], 60.0, PERIOD_S, 0.0).torque_nm);
            // Of the 0.187 Nm of 8 A.
            let apart = (ours - theirs).abs() / 0.187;
            assert!(apart < 1e-6, "{rpm}: {ours} {theirs}");
        }
    }
}

#[test]
fn energy_is_conserved_with_harmonics_drag_and_detents() {
    let extras = Extras {
        drag: Drag {
            friction_nm: 1e-3,
            viscous_nms: 1e-6,
            hysteresis_nm: 4e-3,
            eddy_nms: 2e-6,
        },
        cogging: Cogging {
            torque_nm: 3e-3,
            order: 72,
        },
        ..with_harmonics()
    };
    let apart = imbalance(rig_with(Fidelity::Switching, extras));
    assert!(apart < 1e-6, "{apart}");
}

/// The numeric solution's error per step is 1e-7 of what decays in it and 3e-6 of a harmonic; that of the integrals is
/// of the same order, and averages out over a run.
#[test]
fn energy_is_conserved_in_a_salient_and_saturated_motor() {
    let extras = Extras {
        harmonics: harmonics(),
        ..iron()
    };
    let apart = imbalance(rig_with(Fidelity::Switching, extras));
    assert!(apart < 2e-6, "{apart}");
}

/// Along the rotor's axis a small current follows with R/L_d, across it with R/L_q.
#[test]
fn a_salient_rotor_shows_its_inductances_at_rest() {
    let extras = Extras {
        saliency: 1.5,
        ..Extras::default()
    };
    // Mean 30.6 µH: 24.48 and 36.72.
    for (angle_turns, wanted_h) in [(0.0, 24.48e-6), (0.25, 36.72e-6)] {
        let mut plant = held_with(&extras, 0.0, angle_turns);
        let step = duties([0.6, 0.55, 0.55]);
        plant.period([step; 2], 24.0, PERIOD_S, 0.0);
        let first_a = plant.currents_a()[0];
        for _ in 0..200 {
            plant.period([step; 2], 24.0, PERIOD_S, 0.0);
        }
        let last_a = plant.currents_a()[0];
        let fall = -(1.0 - first_a / last_a).ln() / PERIOD_S;
        let shown_h = MOTOR.resistance_ohm / fall;
        assert!((shown_h / wanted_h - 1.0).abs() < 0.01, "{shown_h}");
    }
}

/// 1.5·p·(φ·i_q + (L_d − L_q)·i_d·i_q) at rest.
#[test]
fn a_salient_rotor_makes_reluctance_torque() {
    let extras = Extras {
        saliency: 2.0,
        ..Extras::default()
    };
    // A current along phase a with the rotor an eighth of a turn on: i_d = i·cos 45°, i_q = −i·sin 45°.
    let mut plant = held_with(&extras, 0.0, 0.125);
    let step = duties([0.65, 0.5, 0.5]);
    let mut flow = Flow::default();
    for _ in 0..400 {
        flow = plant.period([step; 2], 24.0, PERIOD_S, 0.0);
    }
    let [i, ..] = plant.currents_a();
    let (d, q) = (i * 0.5_f64.sqrt(), -i * 0.5_f64.sqrt());
    let difference_h = -2.0 / 3.0 * MOTOR.inductance_h;
    let wanted_nm = 1.5 * 12.0 * (MOTOR.flux_wb * q + difference_h * d * q);
    assert!(
        (flow.torque_nm / wanted_nm - 1.0).abs() < 0.01,
        "{} {wanted_nm}",
        flow.torque_nm
    );
}

#[test]
fn a_hot_winding_takes_less_current() {
    let winding = Winding {
        resistance_k_per_w: 5.0,
        capacity_j_per_k: 0.01,
    };
    let extras = Extras {
        winding: Some(winding),
        ..Extras::default()
    };
    let mut plant = held_with(&extras, 0.0, 0.0);
    let step = duties([0.55, 0.5, 0.5]);
    let mut flow = Flow::default();
    for _ in 0..20_000 {
        flow = plant.period([step; 2], 24.0, PERIOD_S, 0.0);
    }
    // At rest in thermal balance: R·(1 + α·5 K/W·P) with P = 3/2·u²/R.
    let excess_k = 5.0 * flow.copper_w;
    let winding_c = plant.winding_c().unwrap();
    assert!(
        (winding_c - 25.0 - excess_k).abs() < 0.1,
        "{winding_c} {excess_k}"
    );
    let wanted_ohm = MOTOR.resistance_ohm * (1.0 + 0.00393 * excess_k);
    let shown_ohm = flow.motor_w / flow.copper_w * plant.resistance_ohm();
    assert!((shown_ohm / wanted_ohm - 1.0).abs() < 1e-3);
    let u = 24.0 * 0.05 * 2.0 / 3.0;
    assert!((flow.copper_w / (1.5 * u * u / wanted_ohm) - 1.0).abs() < 0.01);
}

#[test]
fn a_blocked_shaft_stands_until_it_is_let_go() {
    let mut plant = Plant::new(
        Fidelity::Averaged,
        *MOTOR,
        Bench::default().load,
        100.0,
        0.1,
    );
    plant.block(true);
    plant.kick(50.0);
    let push = legs([Some(0.3), Some(0.0), None]);
    let angle_turns = plant.angle_turns();
    for _ in 0..100 {
        plant.period([push; 2], 24.0, PERIOD_S, 0.0);
    }
    assert_eq!(
        (plant.speed_rad_s(), plant.angle_turns()),
        (0.0, angle_turns)
    );
    plant.block(false);
    plant.kick(50.0);
    assert_eq!(plant.speed_rad_s(), 50.0);
    // A blow of 0.143 Nm on 1.43e-4 kg·m² for 10 ms takes 10 rad/s.
    plant.set_extra_torque_nm(-0.143);
    for _ in 0..100 {
        plant.period([Bridge::Off; 2], 24.0, 100e-6, 0.0);
    }
    plant.set_extra_torque_nm(0.0);
    let lost = 50.0 - plant.speed_rad_s();
    assert!((9.9..10.7).contains(&lost), "{lost}");
}

proptest! {
    /// As for the ideal motor, and with more of the flows than the period's means show: what a pulse puts into the
    /// currents and the diodes return by the period's end.
    #[test]
    fn energy_is_conserved_through_any_commands_in_a_real_motor(
        commands in prop::collection::vec(any_bridge(), 1..20),
        rpm in -9000.0..9000.0_f64,
        bus_v in 5.0..40.0_f64,
        averaged in any::<bool>(),
    ) {
        let extras = Extras { harmonics: harmonics(), ..iron() };
        let fidelity = if averaged { Fidelity::Averaged } else { Fidelity::Switching };
        let mut plant = held(fidelity, 0.0, 0.3);
        plant.fit(&extras);
        plant.impose(rpm * TAU / 60.0);
        let (mut balance, mut gross) = (0.0, 1e-9);
        for pair in commands.windows(2) {
            let before = plant.stored_j();
            let mut pulse = plant.clone();
            pulse.period([pair[0]; 2], bus_v, 50e-6, DEAD_TIME_S);
            let pulse_j = (pulse.stored_j() - before).abs();
            let flow = plant.period([pair[0], pair[1]], bus_v, 50e-6, DEAD_TIME_S);
            let shaft_w = flow.torque_nm * plant.speed_rad_s();
            let grown = plant.stored_j() - before;
            balance += 50e-6 * (flow.motor_w - flow.copper_w - shaft_w) - grown;
            gross += 50e-6 * (flow.motor_w.abs() + flow.copper_w + shaft_w.abs()) + pulse_j;
            prop_assert!(bus_v * flow.bus_a >= flow.motor_w - 1e-6);
            let [a, b, c] = plant.currents_a();
            prop_assert!((a + b + c).abs() < 1e-9 && a.abs() < 1e4);
        }
        // In one Runge-Kutta step from zero current the balance is off by 0.04·(R/L·h)³ of the flows, and a step is at
        // most a tenth of L/R.
        prop_assert!(balance.abs() < 4e-5 * gross, "{balance} of {gross}");
    }
}

#[test]
fn a_motor_that_has_drifted_is_one_of_that_resistance_and_flux() {
    let real = Extras {
        harmonics: vec![Harmonic {
            order: 5,
            share: 0.05,
            phase_rad: 0.3,
        }],
        saliency: 1.3,
        winding: Some(Winding {
            resistance_k_per_w: 5.0,
            capacity_j_per_k: 10.0,
        }),
        ..Extras::default()
    };
    for extras in [Extras::default(), real] {
        let of = |motor| {
            let mut plant = Plant::new(Fidelity::Averaged, motor, Load::default(), 0.0, 0.1);
            plant.fit(&extras);
            plant.impose(3000.0 * TAU / 60.0);
            plant
        };
        let mut drifted = of(*MOTOR);
        drifted.drift([2.0, 0.9]);
        drifted.drift([1.4, 0.92]);
        let mut wanted = of(Motor {
            resistance_ohm: 1.4 * MOTOR.resistance_ohm,
            flux_wb: 0.92 * MOTOR.flux_wb,
            ..*MOTOR
        });
        for _ in 0..2000 {
            let bridge = field_oriented(&drifted, 5.0, 24.0);
            let [flow, of] = [&mut drifted, &mut wanted]
                .map(|plant| plant.period([bridge; 2], 24.0, PERIOD_S, DEAD_TIME_S));
            assert!(
                (flow.torque_nm - of.torque_nm).abs() < 1e-9,
                "{flow:?} {of:?}"
            );
            assert!(
                (flow.copper_w - of.copper_w).abs() < 1e-6,
                "{flow:?} {of:?}"
            );
        }
        assert!((drifted.resistance_ohm() / wanted.resistance_ohm() - 1.0).abs() < 1e-9);
        assert!((drifted.flux_wb() / wanted.flux_wb() - 1.0).abs() < 1e-9);
    }
}
