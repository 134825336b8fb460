//! The control period.

use super::state::NOT_PLAIN;
use super::{Bridge, Config, Direction, Phase, Sample, Setpoint, State};
use super::{launch, rest, six_step, slow, tone, turn};
use crate::control::delay::Delay;
use crate::control::observer::{self, compensated};
use crate::control::regulator::{self, synchronous};
use crate::control::{inductance, sensing};
use crate::protection;
use crate::units::{AdcCounts, Duty};

/// One control period: from the sample to what the bridge does in the period that follows.
///
/// Pure: no clock, no allocation, no logging, and no result but the state and the returned value.
/// Called once a PWM period, in the interrupt of the chip and in the emulator's loop.
///
/// Almost every period is a plain one: the phases switch under the default observer and regulator,
/// and nothing new is asked for. It is the same work as in any other, without the choices.
#[inline(never)]
pub fn step(config: &Config, state: &mut State, sample: Sample, setpoint: Setpoint) -> Bridge {
    let same = setpoint.kind() == state.plain;
    match (&config.observer, &config.regulator) {
        (observer::Config::Compensated(observer), regulator::Config::Synchronous(regulator))
            if same || state.plain != NOT_PLAIN && stays_plain(config, state, &setpoint) =>
        {
            if same {
                slow::turn(config, state, &setpoint);
            }
            plain((observer, regulator), (config, state), &sample, &setpoint)
        }
        _ => any(config, state, &sample, setpoint),
    }
}

/// Whether a period under another kind of set-point than the one before is as plain as that. Its slow
/// work is left out: it has another turn.
#[cold]
#[inline(never)]
fn stays_plain(config: &Config, state: &mut State, setpoint: &Setpoint) -> bool {
    if matches!(setpoint, Setpoint::Fault(_)) {
        return false;
    }
    state.turn = (state.turn + 1) % slow::CYCLE as u8;
    launch::follow(config, state, *setpoint);
    let drives = state.phase.drives();
    if drives {
        state.plain = setpoint.kind();
        state.seen.phase = state.phase;
    }
    drives
}

/// A plain period.
#[inline(always)]
fn plain(
    parts: (&compensated::Config, &synchronous::Config),
    (config, state): (&Config, &mut State),
    sample: &Sample,
    setpoint: &Setpoint,
) -> Bridge {
    if matches!(state.phase, Phase::Run | Phase::Stopping) {
        switching(false, parts, (config, state), sample)
    } else if state.phase.is_open_loop() {
        open_loop(parts, (config, state), sample, setpoint)
    } else {
        ended(config, state, sample)
    }
}

/// A plain period in which the phases switch.
#[inline(always)]
fn switching(
    open_loop: bool,
    parts: (&compensated::Config, &synchronous::Config),
    (config, state): (&Config, &mut State),
    sample: &Sample,
) -> Bridge {
    match sense(config, state, sample, true) {
        Some(currents) => {
            let drive = (config, state);
            turn::period((open_loop, Delay::One), parts, drive, (sample, currents))
        }
        None => Bridge::Off,
    }
}

/// A plain period of a start.
#[inline(never)]
fn open_loop(
    parts: (&compensated::Config, &synchronous::Config),
    (config, state): (&Config, &mut State),
    sample: &Sample,
    setpoint: &Setpoint,
) -> Bridge {
    launch::impose(config, state, setpoint);
    switching(true, parts, (config, state), sample)
}

/// A period in which the phases cease to switch. The observer goes on in the next one.
#[cold]
fn ended(config: &Config, state: &mut State, sample: &Sample) -> Bridge {
    let brakes = state.phase == Phase::Brake;
    let sound = sense(config, state, sample, brakes).is_some();
    state.applied[0] = [Duty::ZERO; 3];
    if sound && brakes {
        Bridge::Brake
    } else {
        Bridge::Off
    }
}

/// What the bridge does where the phases do not switch.
fn still(config: &Config, state: &mut State, sample: &Sample, currents: [AdcCounts; 3]) -> Bridge {
    if state.phase == Phase::Brake {
        let drive = (config, state);
        match &config.observer {
            observer::Config::Compensated(known) => turn::watch(known, drive, sample, currents),
            any => turn::watch(any, drive, sample, currents),
        }
        Bridge::Brake
    } else {
        Bridge::Off
    }
}

/// Any period.
#[inline(never)]
fn any(config: &Config, state: &mut State, sample: &Sample, setpoint: Setpoint) -> Bridge {
    if rest::is_off(config, state) {
        return rest::off(config, state, sample, setpoint);
    }
    let trips = matches!(setpoint, Setpoint::Fault(_));
    if state.phase.drives() && config.six_step.is_none() && !trips {
        // As in a plain period: of the supply that the sample before has shown.
        slow::turn(config, state, &setpoint);
        if !state.phase.drives() {
            return ended(config, state, sample);
        }
    }
    let off = matches!(state.phase, Phase::Idle | Phase::Sense);
    if state.unread == 0 && state.switched() {
        state.unread = 1;
    }
    let currents = sense(config, state, sample, !off);
    // None, until the phases are told to switch.
    state.applied[0] = [Duty::ZERO; 3];
    if let Setpoint::Fault(fault) = setpoint {
        state.trip(fault);
    }
    let bridge = match currents {
        Some(currents) if state.faults.is_empty() => {
            healthy(config, state, sample, currents, setpoint)
        }
        _ => Bridge::Off,
    };
    let plain = state.phase.drives()
        && state.faults.is_empty()
        && config.delay == Delay::One
        && config.six_step.is_none()
        && config.adapt_l.is_none();
    state.plain = if plain { setpoint.kind() } else { NOT_PLAIN };
    bridge
}

/// The currents of a sample; `None` where it is a fault.
#[inline(always)]
fn sense(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    flowing: bool,
) -> Option<[AdcCounts; 3]> {
    let mut currents = sensing::read(&state.sensing, sample.currents);
    if state.unread != 0 {
        // Not by a reference to `currents`, which would then be in memory in every period.
        currents = doubtful(config, state, sample);
    }
    let bus = rest::bus(config, sample);
    let flowing = flowing.then_some(currents);
    if let Some(fault) = protection::check(&config.protection, &mut state.protection, flowing, bus)
    {
        state.trip(fault);
        state.applied[0] = [Duty::ZERO; 3];
        return None;
    }
    Some(currents)
}

/// The currents of a sample at which a phase may be unreadable.
#[cold]
fn doubtful(config: &Config, state: &mut State, sample: &Sample) -> [AdcCounts; 3] {
    state.unread -= 1;
    let duties = state.duties(config.delay);
    state.applied[1] = state.applied[0];
    sensing::currents(&config.sensing, &state.sensing, sample.currents, duties)
}

/// A period without a fault.
fn healthy(
    config: &Config,
    state: &mut State,
    sample: &Sample,
    currents: [AdcCounts; 3],
    setpoint: Setpoint,
) -> Bridge {
    if let Some(six_step) = &config.six_step {
        return six_step::period(config, six_step, state, sample, currents, setpoint);
    }
    if state.phase == Phase::Brake && rest::stays(state, setpoint) {
        return still(config, state, sample, currents);
    }
    if state.phase == Phase::Tone
        && let Some(bridge) = tone::period(config, state, currents, setpoint)
    {
        return bridge;
    }
    launch::follow(config, state, setpoint);
    state.seen.phase = state.phase;
    if matches!(state.phase, Phase::Idle | Phase::Sense) {
        // The rotor is watched from the next period on.
        return Bridge::Off;
    }
    if let Some(bridge) = rest::period(config, state, sample, (currents, setpoint)) {
        return bridge;
    }
    if state.phase == Phase::Charge {
        let n = state.charge_periods - config.charge.periods;
        launch::begin(config, state, (sample, setpoint), n);
        return Bridge::Charge(config.charge.duty);
    }
    if state.phase.drives() {
        if state.phase.is_open_loop() {
            launch::impose(config, state, &setpoint);
        } else if let Some(adapt) = &config.adapt_l {
            let flux = observer::flux(&config.observer, &state.observer);
            let wave = inductance::step(adapt, &mut state.inductance, state.seen.i.d, flux);
            state.wanted.i.d = state.i_d + wave;
        }
    }
    let parts = (&config.observer, &config.regulator);
    if state.phase.drives() {
        let open_loop = state.phase.is_open_loop();
        state.seen.phase = state.phase;
        turn::period(
            (open_loop, config.delay),
            parts,
            (config, state),
            (sample, currents),
        )
    } else {
        still(config, state, sample, currents)
    }
}

impl Setpoint {
    /// A number for each kind.
    #[inline(always)]
    pub(super) fn kind(self) -> u8 {
        match self {
            Self::Stop => 0,
            Self::Zero => 1,
            Self::Fault(_) => 2,
            Self::Speed(_) => 3,
            Self::Torque(_) => 4,
            Self::Voltage(_) => 5,
            Self::Tone(_) => 6,
            Self::Test(_) => 7,
            Self::Pull(_) => 8,
        }
    }

    /// The same as seen by a motor that turns the other way.
    pub(super) fn turned(self) -> Self {
        match self {
            Self::Speed(speed) => Self::Speed(speed.saturating_neg()),
            Self::Torque(current) => Self::Torque(current.saturating_neg()),
            Self::Voltage(share) => Self::Voltage(share.saturating_neg()),
            Self::Test(current) => Self::Test(current.saturating_neg()),
            Self::Stop | Self::Zero | Self::Fault(_) | Self::Tone(_) | Self::Pull(_) => self,
        }
    }
}

impl State {
    /// Whether phases b and c change places for the control, which always turns one way.
    #[inline(always)]
    pub(super) fn swapped(&self, config: &Config) -> bool {
        (config.direction == Direction::Reversed) != self.reversed
    }

    /// Whether a phase has switched in the last two periods.
    fn switched(&self) -> bool {
        let [[a, b, c], [d, e, f]] = self.applied;
        a | b | c | d | e | f != Duty::ZERO
    }

    /// The duties of the period that has elapsed at this sample.
    #[inline(always)]
    fn duties(&self, delay: Delay) -> [Duty; 3] {
        self.applied[usize::from(delay == Delay::One)]
    }
}
