//! The chip's control on this machine: the shared code, fed with what the chip's interrupt reads.
//!
//! What the interrupt does around `step` is reimplemented here, after the firmware's `interrupt` and
//! `exchange`: which reading is what, how long a set-point lives, what a break does to it, and what a duty
//! is in timer clocks.

use siskin_control::build::build;
use siskin_control::drive::{Bridge, Config, Fault, Sample, Setpoint, State, step};
use siskin_firmware::circuit::b_g431b_esc1::{BOARD, ZERO_COUNTS};
use siskin_firmware::exchange::word::unpack;
use siskin_params::{BOSSO_MOTOR, Params};
use siskin_units::{AdcCounts, Duty};
use siskin_vboard::time::CLOCK_HZ;

/// Age at which a set-point is no longer obeyed, s.
const STALE_S: f32 = 0.01;

/// Port B's pin of the first Hall sensor.
const HALL_PIN: u32 = 6;

/// What an interrupt reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inputs {
    /// The injected sequences of both converters.
    pub(crate) injected: [[u16; 4]; 2],
    /// The levels of port B.
    pub(crate) port_b: u32,
    /// The set-point word.
    pub(crate) word: u32,
    /// TIM1's break flag.
    pub(crate) broken: bool,
    /// Whether the flash is being written, and nothing is controlled.
    pub(crate) writing: bool,
}

/// What an interrupt must leave in the timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Outputs {
    /// The compare values of the legs.
    pub(crate) compares: [u16; 3],
    /// Whether the outputs are on.
    pub(crate) on: bool,
}

/// The control.
pub(crate) struct Mirror {
    config: Config,
    state: State,
    top: u16,
    word: u32,
    setpoint: Setpoint,
    age_periods: u32,
    stale_periods: u32,
    outputs: Outputs,
}

impl Mirror {
    /// Creates the chip's with the first paper's motor and default parameters, before its first interrupt.
    pub(crate) fn new() -> Self {
        let mut params = Params::of(&BOSSO_MOTOR);
        params.fit(&BOARD);
        let config = build(&params, &BOARD).expect("the defaults fit the board");
        let period_s = config.scale.period_s;
        Self {
            state: State::new(&config),
            top: (0.5 * CLOCK_HZ as f32 * period_s).round() as u16,
            word: 0,
            setpoint: Setpoint::Stop,
            age_periods: 0,
            stale_periods: (STALE_S / period_s).round() as u32,
            outputs: Outputs {
                compares: [0; 3],
                on: false,
            },
            config,
        }
    }

    /// Runs one interrupt.
    pub(crate) fn period(&mut self, inputs: &Inputs) -> Outputs {
        if inputs.writing {
            self.outputs.on = false;
            return self.outputs;
        }
        self.listen(inputs.word);
        let setpoint = if inputs.broken {
            Setpoint::Fault(Fault::OverCurrent)
        } else {
            self.setpoint
        };
        let bridge = step(&self.config, &mut self.state, sample(inputs), setpoint);
        self.drive(bridge);
        self.outputs
    }

    /// Writes the words of the control state to `out`.
    pub(crate) fn words(&self, out: &mut Vec<u32>) {
        out.clear();
        self.state.trace(&self.config, &mut |word| out.push(word));
    }

    /// Returns the drive's phase by name.
    pub(crate) fn phase(&self) -> String {
        format!("{:?}", self.state.snapshot().phase)
    }

    fn listen(&mut self, word: u32) {
        if word != self.word {
            self.word = word;
            self.setpoint = unpack(word);
            self.age_periods = 0;
        } else if self.age_periods < self.stale_periods {
            self.age_periods += 1;
        } else {
            self.setpoint = Setpoint::Stop;
        }
    }

    fn drive(&mut self, bridge: Bridge) {
        let top = self.top;
        let of_top = |duty: Duty| ((i64::from(duty.to_bits()) * i64::from(top)) >> 31) as u16;
        self.outputs.on = bridge != Bridge::Off;
        self.outputs.compares = match bridge {
            // The compare values stay.
            Bridge::Off => return,
            Bridge::Charge(share) => [top - of_top(share); 3],
            Bridge::Brake => [0; 3],
            Bridge::Duty(duties) => duties.map(of_top),
            Bridge::Legs(legs) => legs.map(|leg| leg.map_or(0, of_top)),
        };
    }
}

/// Assigns the readings, in the order of the sequences: a, c, terminal c, supply on the first converter; b,
/// terminals a and b on the second.
fn sample(inputs: &Inputs) -> Sample {
    let [
        [current_a, current_c, terminal_c, bus],
        [current_b, terminal_a, terminal_b, _],
    ] = inputs.injected;
    // A current into the motor flows up through the shunt: the reading falls.
    let current = |reading: u16| AdcCounts::from_num(ZERO_COUNTS - i32::from(reading));
    Sample {
        currents: [current_a, current_b, current_c].map(current),
        bus: AdcCounts::from_num(bus),
        terminals: [terminal_a, terminal_b, terminal_c].map(AdcCounts::from_num),
        hall: (inputs.port_b >> HALL_PIN & 7) as u8,
    }
}
