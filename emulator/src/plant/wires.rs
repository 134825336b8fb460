//! The wires from the source to the bus: their inductance, with the source's resistance and the bus's capacitor.

/// The series circuit, all above 0 but the resistance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wires {
    /// Resistance of source and wires, Ω.
    pub(super) resistance_ohm: f64,
    /// Inductance of the wires, H.
    pub(super) inductance_h: f64,
    /// The bus capacitor, F.
    pub(super) capacitance_f: f64,
}

/// Voltage of the capacitor, V, and current in the wires, A.
pub(super) type Charged = (f64, f64);

/// What acts on the circuit: the source's voltage, V, and the bridge's current, A.
pub(super) type Driven = (f64, f64);

/// Most pieces in which a step is searched for the moment at which a one-way source stops.
const PIECES_MAX: f64 = 64.0;

/// Halvings of a piece in that search.
const HALVINGS: u32 = 40;

impl Wires {
    /// Returns the state after a time with a source that gives and takes current, in closed form.
    pub(super) fn both_ways(
        self,
        (volts, amperes): Charged,
        driven: Driven,
        time_s: f64,
    ) -> Charged {
        let (open_v, load_a) = driven;
        // Deviations x from the settled state follow x' = A·x. With A's mean eigenvalue −a, and (A + a)² = −ω², e^(A·t)
        // is e^(−a·t)·(cos ωt + (A + a)·sin ωt / ω), hyperbolic where ω² is negative.
        let settled_v = open_v - self.resistance_ohm * load_a;
        let (v, i) = (volts - settled_v, amperes - load_a);
        let a = 0.5 * self.resistance_ohm / self.inductance_h;
        let square = 1.0 / (self.inductance_h * self.capacitance_f) - a * a;
        let (even, odd) = if square > 0.0 {
            let omega = square.sqrt();
            let decay = libm::exp(-a * time_s);
            let (sin, cos) = libm::sincos(omega * time_s);
            (decay * cos, decay * sin / omega)
        } else {
            let rate = (-square).sqrt();
            let (slow, fast) = (
                libm::exp((rate - a) * time_s),
                libm::exp((-rate - a) * time_s),
            );
            let odd = if rate > 0.0 {
                0.5 * (slow - fast) / rate
            } else {
                time_s * slow
            };
            (0.5 * (slow + fast), odd)
        };
        let v_turned = a * v + i / self.capacitance_f;
        let i_turned = -v / self.inductance_h - a * i;
        (
            settled_v + even * v + odd * v_turned,
            load_a + even * i + odd * i_turned,
        )
    }

    /// Returns the state after a time with a source that gives current and takes none.
    pub(super) fn one_way(self, mut state: Charged, driven: Driven, time_s: f64) -> Charged {
        let (open_v, load_a) = driven;
        // Within a piece the current turns around at most once.
        let piece_s = (self.inductance_h * self.capacitance_f)
            .sqrt()
            .max(time_s / PIECES_MAX);
        let mut left_s = time_s;
        while left_s > 0.0 {
            let (volts, amperes) = state;
            if amperes <= 0.0 && volts >= open_v {
                // The capacitor alone, until it is down to the source's voltage.
                let rate = -load_a / self.capacitance_f;
                let until_s = if rate < 0.0 {
                    (open_v - volts) / rate
                } else {
                    f64::INFINITY
                };
                if until_s >= left_s {
                    return (volts + rate * left_s, 0.0);
                }
                left_s -= until_s;
                state = (open_v, 0.0);
                if load_a <= 0.0 {
                    return state;
                }
            }
            let mut step_s = piece_s.min(left_s);
            let mut next = self.both_ways(state, driven, step_s);
            if next.1 < 0.0 {
                step_s = self.stops_s(state, driven, step_s);
                next = (self.both_ways(state, driven, step_s).0, 0.0);
            }
            state = next;
            left_s -= step_s;
        }
        state
    }

    /// Returns the time at which the current stops, within a time after which it would flow backwards.
    fn stops_s(self, state: Charged, driven: Driven, time_s: f64) -> f64 {
        let (mut flows_s, mut stopped_s) = (0.0, time_s);
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (flows_s + stopped_s);
            if self.both_ways(state, driven, middle_s).1 < 0.0 {
                stopped_s = middle_s;
            } else {
                flows_s = middle_s;
            }
        }
        stopped_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 41.7e-6;

    fn wires(resistance_ohm: f64, inductance_h: f64) -> Wires {
        Wires {
            resistance_ohm,
            inductance_h,
            capacitance_f: 470e-6,
        }
    }

    /// The same by small steps: midpoint rule, and no current backwards if the source takes none.
    fn integrated(wires: Wires, state: Charged, (open_v, load_a): Driven, sinks: bool) -> Charged {
        let (mut volts, mut amperes) = state;
        let step_s = STEP_S / 40_000.0;
        let least_a = if sinks { f64::NEG_INFINITY } else { 0.0 };
        for _ in 0..40_000 {
            let slope = |volts: f64, amperes: f64| {
                let volts_left = open_v - volts - wires.resistance_ohm * amperes;
                (
                    (amperes - load_a) / wires.capacitance_f,
                    volts_left / wires.inductance_h,
                )
            };
            let (v, i) = slope(volts, amperes);
            let middle_a = (amperes + 0.5 * step_s * i).max(least_a);
            let (v, i) = slope(volts + 0.5 * step_s * v, middle_a);
            (volts, amperes) = (volts + step_s * v, (amperes + step_s * i).max(least_a));
        }
        (volts, amperes)
    }

    /// Ringing, critically and heavily damped; and across the moment at which a one-way source stops or starts.
    #[test]
    fn a_step_is_the_circuit_s() {
        let critical_h = 470e-6 * 0.05_f64.powi(2) / 4.0;
        for (resistance_ohm, inductance_h) in [
            (0.0, 2e-6),
            (0.02, 2e-6),
            (0.05, critical_h),
            (0.1, 50e-9),
            (0.1, 1e-3),
        ] {
            let wires = wires(resistance_ohm, inductance_h);
            for (state, driven) in [
                ((24.0, 0.0), (24.0, 30.0)),
                ((23.0, 40.0), (24.0, -20.0)),
                ((24.001, 0.0), (24.0, 40.0)),
                ((25.0, 1.0), (24.0, -5.0)),
            ] {
                for sinks in [true, false] {
                    let after = if sinks {
                        wires.both_ways(state, driven, STEP_S)
                    } else {
                        wires.one_way(state, driven, STEP_S)
                    };
                    let wanted = integrated(wires, state, driven, sinks);
                    let case =
                        format!("{wires:?} {state:?} {driven:?} {sinks}: {after:?} for {wanted:?}");
                    assert!((after.0 - wanted.0).abs() < 1e-4, "{case}");
                    assert!((after.1 - wanted.1).abs() < 1e-2, "{case}");
                }
            }
        }
    }

    /// A load of 30 A that stops lifts the bus by 30 A·√(L/C), 1.96 V, above the source.
    #[test]
    fn a_load_that_stops_leaves_the_wires_energy_to_the_capacitor() {
        let wires = wires(0.0, 2e-6);
        let (mut state, mut most_v) = ((24.0, 30.0), 0.0_f64);
        for _ in 0..200 {
            state = wires.one_way(state, (24.0, 0.0), 1e-6);
            most_v = most_v.max(state.0);
        }
        let rise_v = 30.0 * (2e-6_f64 / 470e-6).sqrt();
        assert!((most_v - 24.0 - rise_v).abs() < 1e-3, "{most_v}");
        assert_eq!(state, (most_v, 0.0));
    }
}
