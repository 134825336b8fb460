//! State of field-oriented control.

use siskin_units::math::SinCos;
use siskin_units::trace::Trace;
use siskin_units::{Angle, Current, Speed, Voltage, traced};

use crate::control::inductance;
use crate::control::regulator::{self, Reference};
use crate::control::speed::Bounds;
use crate::control::transform::{AlphaBeta, Dq, PhaseOrder};
use crate::control::{dead_time, observer, speed, start, torque, weakening};
use crate::drive::config::Config;
use crate::drive::schedule::Slot;

/// State of field-oriented control.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::drive) struct State {
    pub(in crate::drive) loops: Loops,
    pub(in crate::drive) observer: observer::State,
}

traced! {
    /// Everything but the observer.
    #[derive(Clone, Debug, PartialEq)]
    pub(in crate::drive) struct Loops {
        /// The last period's slot in the schedule.
        pub(in crate::drive) slot: Slot,
        /// The phase order as the control sees it.
        pub(in crate::drive) phase_order: PhaseOrder,
        /// Reference of the current regulator.
        pub(in crate::drive) reference: Reference,
        pub(in crate::drive) regulator: regulator::State,
        /// Delay compensation: the frame's rotation until the voltage acts.
        pub(in crate::drive) delay_rotation: SinCos,
        /// Dead-time signs: the reference current as the compensation uses it.
        pub(in crate::drive) dead_time_sign: dead_time::Certainty,
        /// The last two commanded voltages in the stator's frame, latest first.
        pub(in crate::drive) commanded_voltages: [AlphaBeta<Voltage>; 2],
        pub(in crate::drive) inductance: inductance::State,
        pub(in crate::drive) speed: speed::State,
        pub(in crate::drive) torque: torque::State,
        pub(in crate::drive) weakening: weakening::State,
        /// Change of ω* in the last period.
        pub(in crate::drive) reference_step: Speed,
        /// i_d* at the present speed.
        pub(in crate::drive) i_d_reference: Current,
        /// Bounds of i_q* at the present speed.
        pub(in crate::drive) i_q_bounds: Bounds,
        /// Anti-windup: i_q* minus i_q where the voltage was limited.
        pub(in crate::drive) i_q_shortfall: Current,
        /// The open-loop start.
        pub(in crate::drive) start: start::State,
    }
}

impl Loops {
    fn new() -> Self {
        Self {
            slot: 0,
            phase_order: PhaseOrder::NORMAL,
            reference: Reference::default(),
            regulator: regulator::State::default(),
            delay_rotation: SinCos::of(Angle::ZERO),
            dead_time_sign: Dq::default(),
            commanded_voltages: [AlphaBeta::default(); 2],
            inductance: inductance::State::default(),
            speed: speed::State::default(),
            torque: torque::State::default(),
            weakening: weakening::State::default(),
            reference_step: Speed::ZERO,
            i_d_reference: Current::ZERO,
            i_q_bounds: Bounds::default(),
            i_q_shortfall: Current::ZERO,
            start: start::State::default(),
        }
    }
}

impl State {
    /// Creates the power-up state.
    pub(in crate::drive) fn new() -> Self {
        Self {
            loops: Loops::new(),
            observer: observer::State::default(),
        }
    }

    /// Resets to the power-up state. Part by part: a temporary whole state would take the interrupt's stack.
    #[inline(never)] // seldom
    pub(in crate::drive) fn restart(&mut self) {
        self.loops = Loops::new();
        self.observer = observer::State::default();
    }

    /// Ends a drive: the next one inherits only the inductance factor.
    pub(in crate::drive) fn rest(&mut self) {
        let loops = &mut self.loops;
        loops.commanded_voltages = [AlphaBeta::default(); 2];
        loops.reference_step = Speed::ZERO;
        loops.i_q_shortfall = Current::ZERO;
        loops.torque = torque::State::default();
        loops.weakening = weakening::State::default();
        loops.reference = Reference::default();
        loops.inductance.begin();
        loops.start = start::State::default();
        loops.speed = speed::State::default();
        loops.regulator = regulator::State::default();
    }

    /// Emits every word; of the observers, the selected one's.
    #[inline(always)] // as for `State::trace`
    pub(in crate::drive) fn trace(&self, config: &Config, out: &mut impl FnMut(u32)) {
        self.loops.trace(out);
        self.observer.trace(&config.observer, out);
    }
}
