//! The faults of the matrix, with the names and the reactions that each may have by its nature.

use serde::Serialize;

use super::drive::Drive;
use super::moment::Moment;
use crate::fault::{Kind, Side};

/// Duration of a fault that has none of its own, s.
const FAULT_S: f64 = 0.5;

/// Time within which what ends a drive must have ended it, s: two samples, or the chip's own reset.
const AT_ONCE_S: f64 = 200e-6;
/// Time within which a lost supply must be detected, s: its reading is smoothed over eight periods.
const SMOOTHED_S: f64 = 2e-3;
/// Time within which a lost rotor must be detected, s, or electrical turns, whichever is longer.
const LOST_S: f64 = 5e-3;
const LOST_TURNS: f64 = 3.0;
/// Time within which a pilot must be told of a fault that the motor flies on with, s.
const TOLD_S: f64 = 0.2;
/// `INP_LOSS_MS`, plus a frame and a round of the tasks, s.
const SIGNAL_S: f64 = 0.105;
/// Time within which comparators must have cut off a short once the current has exceeded their level, s.
const TRIP_S: f64 = 3e-6;

/// A fault of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Row {
    /// None, to check that nothing is named.
    Nothing,
    /// The shaft is held.
    RotorBlocked,
    /// It loses nine tenths of its speed within 10 ms.
    Strike,
    /// 0.3 Nm against the rotation for 20 ms: four times the load at half throttle.
    StrikeTorque,
    /// Air that moves as the propeller would at 2000 rpm.
    Gust,
    /// The wire of a phase is open.
    PhaseOpen,
    /// A high side never turns on.
    HighOpen,
    /// A low side never turns on.
    LowOpen,
    /// A high side is always on.
    HighShort,
    /// A low side is always on.
    LowShort,
    /// A current sensor reads zero.
    SensorZero,
    /// A current sensor reads full scale.
    SensorFull,
    /// A current sensor's zero moves by 5 A within 0.1 s.
    Drift,
    /// 1 A rms on the currents.
    Noise,
    /// A Hall sensor always reads the same, with `CTL_OBSERVER` 2.
    HallStuck,
    /// 4 V less.
    Sag,
    /// 16 V less: below `LIM_BUS_V_MIN`.
    DeepSag,
    /// The supply is gone; only the capacitor is left.
    Disconnect,
    /// 3 V for 0.1 s.
    BrownOut,
    /// The chip restarts.
    Reset,
    /// The flash refuses to change, and a parameter has just been set.
    FlashFail,
    /// Nothing comes over the throttle wire.
    SignalLoss,
    /// One bit in a hundred is wrong.
    BitErrors,
    /// 100 ns rms on each edge.
    Jitter,
}

/// The outcome of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reaction {
    /// The motor keeps turning as commanded.
    GoesOn,
    /// It turns again as commanded, after the bridge was off.
    Recovers,
    /// It is at rest, or coming to rest, as commanded.
    Rests,
    /// The bridge is off until the throttle is closed, and the reason is given.
    Stops,
    /// It is driven where it must not be, still tries at the end, or is off without a word.
    Fails,
}

use Reaction::{GoesOn, Recovers, Rests, Stops};

const OVER_CURRENT: &str = "over-current";
const OVER_VOLTAGE: &str = "bus over-voltage";
const UNDER_VOLTAGE: &str = "bus under-voltage";
const LOST: &str = "rotor position lost";
const STUCK: &str = "motor does not start";
const PHASE_OPEN: &str = "phase open";
const SENSOR: &str = "current sensor defect";
const SENSOR_DRIFTS: &str = "current sensor drifts";
const HALL: &str = "position sensor";
const FAILED_START: &str = "Start failed: retrying";
const FLASH: &str = "storage";
/// A restarting chip announces its name.
const RESTART: &str = "Siskin ESC";
const SIGNAL_LOST: &str = "Throttle: signal lost while armed";

/// What is expected of a cell.
pub(super) struct Expected {
    /// What may be named: the right cause first, then its neighbours.
    pub(super) causes: &'static [&'static str],
    /// Whether one of them must be named.
    pub(super) named: bool,
    /// The permitted reactions.
    pub(super) reactions: &'static [Reaction],
    /// Time within which the first of them must occur, s.
    pub(super) within_s: Option<f64>,
    /// Time within which comparators must have acted, s, once the current has exceeded their level.
    pub(super) trip_s: Option<f64>,
}

impl Row {
    /// All rows, in the order of the table.
    pub const ALL: [Self; 24] = [
        Self::Nothing,
        Self::RotorBlocked,
        Self::Strike,
        Self::StrikeTorque,
        Self::Gust,
        Self::PhaseOpen,
        Self::HighOpen,
        Self::LowOpen,
        Self::HighShort,
        Self::LowShort,
        Self::SensorZero,
        Self::SensorFull,
        Self::Drift,
        Self::Noise,
        Self::HallStuck,
        Self::Sag,
        Self::DeepSag,
        Self::Disconnect,
        Self::BrownOut,
        Self::Reset,
        Self::FlashFail,
        Self::SignalLoss,
        Self::BitErrors,
        Self::Jitter,
    ];

    /// Returns its name in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::RotorBlocked => "rotor blocked",
            Self::Strike => "strike, 90 % in 10 ms",
            Self::StrikeTorque => "strike, 0.3 Nm",
            Self::Gust => "gust",
            Self::PhaseOpen => "phase open",
            Self::HighOpen => "high side open",
            Self::LowOpen => "low side open",
            Self::HighShort => "high side shorted",
            Self::LowShort => "low side shorted",
            Self::SensorZero => "sensor stuck at zero",
            Self::SensorFull => "sensor stuck at full",
            Self::Drift => "sensor drifts 5 A",
            Self::Noise => "noise, 1 A",
            Self::HallStuck => "Hall sensor stuck",
            Self::Sag => "supply sags 4 V",
            Self::DeepSag => "supply sags 16 V",
            Self::Disconnect => "supply disconnected",
            Self::BrownOut => "brown-out",
            Self::Reset => "reset",
            Self::FlashFail => "flash fails",
            Self::SignalLoss => "signal lost",
            Self::BitErrors => "bit errors, 1 %",
            Self::Jitter => "jitter, 100 ns",
        }
    }

    /// Returns what is wrong, and for how long, s, with a shaft that turns at this speed, rad/s.
    pub(super) fn kind(self, speed_rad_s: f64) -> Option<(Kind, f64)> {
        let rpm = std::f64::consts::TAU / 60.0;
        let lasting = |kind| Some((kind, FAULT_S));
        match self {
            Self::Nothing => None,
            Self::RotorBlocked => lasting(Kind::RotorBlocked),
            Self::Strike => Some((Kind::RotorKick(-0.9 * speed_rad_s), 0.01)),
            Self::StrikeTorque => Some((Kind::Strike(-0.3), 0.02)),
            Self::Gust => lasting(Kind::Gust(2000.0 * rpm)),
            Self::PhaseOpen => lasting(Kind::PhaseOpen(1)),
            Self::HighOpen => lasting(Kind::MosfetOpen(1, Side::High)),
            Self::LowOpen => lasting(Kind::MosfetOpen(1, Side::Low)),
            Self::HighShort => lasting(Kind::MosfetShort(1, Side::High)),
            Self::LowShort => lasting(Kind::MosfetShort(1, Side::Low)),
            Self::SensorZero => lasting(Kind::SensorStuck(1, 0.0)),
            Self::SensorFull => lasting(Kind::SensorStuck(1, 40.0)),
            Self::Drift => Some((Kind::OffsetDrift(1, 5.0), 0.1)),
            Self::Noise => lasting(Kind::Noise(1.0)),
            Self::HallStuck => lasting(Kind::HallStuck(1, true)),
            Self::Sag => lasting(Kind::BusSag(4.0)),
            Self::DeepSag => lasting(Kind::BusSag(16.0)),
            Self::Disconnect => lasting(Kind::BusDisconnect),
            Self::BrownOut => Some((Kind::BrownOut(3.0), 0.1)),
            Self::Reset => Some((Kind::Reset, 0.0)),
            Self::FlashFail => lasting(Kind::FlashFail),
            Self::SignalLoss => lasting(Kind::SignalLoss),
            Self::BitErrors => lasting(Kind::BitErrors(0.01)),
            Self::Jitter => lasting(Kind::Jitter(100.0)),
        }
    }

    /// Returns true if it lasts until the motor has stopped and rested: only then does it show.
    pub(super) fn outlasts_flight(self) -> bool {
        self == Self::FlashFail
    }

    /// Returns true if it has no visible effect.
    fn is_hidden(self, moment: Moment, drive: Drive) -> bool {
        match self {
            // Half an ampere turns the motor, a quarter of the offset at which a sensor is reported.
            Self::PhaseOpen | Self::HighOpen | Self::LowOpen | Self::SensorZero => {
                (moment, drive) == (Moment::Idle, Drive::SixStep)
            }
            // It follows the crossings, whatever the observer.
            Self::HallStuck => drive == Drive::SixStep,
            _ => false,
        }
    }

    /// Returns the time within which there must be a reaction or a text, s, if any, with a shaft that turned at this
    /// many electrical turns a second.
    fn within_s(self, moment: Moment, drive: Drive, turns_per_s: f64) -> Option<f64> {
        let drives = moment.drives();
        match self {
            _ if self.is_hidden(moment, drive) => None,
            // A start is given time to fail.
            Self::RotorBlocked if moment == Moment::Start => Some(FAULT_S),
            Self::RotorBlocked if drives => Some(LOST_S.max(LOST_TURNS / turns_per_s)),
            Self::PhaseOpen | Self::HighOpen | Self::LowOpen | Self::HallStuck if drives => {
                Some(TOLD_S)
            }
            Self::SensorZero | Self::Drift if drives => Some(TOLD_S),
            Self::SensorFull | Self::BrownOut | Self::Reset => Some(AT_ONCE_S),
            Self::DeepSag => Some(SMOOTHED_S),
            // As long as its capacitor lasts.
            Self::Disconnect if drives => Some(FAULT_S),
            Self::SignalLoss => Some(SIGNAL_S),
            _ => None,
        }
    }

    /// Returns what its nature makes expected at a moment with a drive, with a shaft that turned at this many
    /// electrical turns a second.
    pub(super) fn expected(self, moment: Moment, drive: Drive, turns_per_s: f64) -> Expected {
        let drives = moment.drives();
        let shows = drives && !self.is_hidden(moment, drive);
        let shorted = match self {
            Self::LowShort => moment != Moment::Standstill,
            _ => self == Self::HighShort,
        };
        let expected = |causes, named, reactions| Expected {
            causes,
            named,
            // At rest, or coming to rest, a fault ends with its cause: the throttle is closed.
            reactions: if drives { reactions } else { &[Rests, Stops] },
            within_s: self.within_s(moment, drive, turns_per_s),
            trip_s: shorted.then_some(TRIP_S),
        };
        match self {
            // The drive withstands these; limits say where it binds.
            Self::Nothing
            | Self::Gust
            | Self::StrikeTorque
            | Self::Noise
            | Self::BitErrors
            | Self::Jitter
            | Self::Sag => expected(&[], false, &[GoesOn]),
            // What was set in flight is written at rest.
            Self::FlashFail => expected(&[FLASH], true, &[GoesOn]),
            // Faster than the currents follow: a back-EMF that vanishes within a period drives 14 A in the next at full
            // speed.
            Self::RotorBlocked if moment.is_fast() => expected(
                &[STUCK, LOST, FAILED_START, OVER_CURRENT],
                drives,
                &[Recovers],
            ),
            Self::RotorBlocked => expected(&[STUCK, LOST, FAILED_START], drives, &[Recovers]),
            // A lost rotor is caught.
            Self::Strike => expected(&[LOST, FAILED_START], false, &[GoesOn, Recovers]),
            // Without current nothing shows. A motor that flies on with two phases is better than none, if it is
            // reported.
            Self::PhaseOpen | Self::HighOpen | Self::LowOpen => expected(
                &[PHASE_OPEN, LOST, STUCK, FAILED_START],
                shows,
                &[GoesOn, Recovers, Stops],
            ),
            // With the low sides on, one more makes no difference; the high one shoots through.
            Self::LowShort if moment == Moment::Standstill => expected(&[], false, &[]),
            // A retry after its end turns the motor on.
            Self::HighShort => expected(&[OVER_CURRENT], true, &[Recovers, Stops]),
            // What the rotor drives through it between two retries is measured as a sensor's zero.
            Self::LowShort if drives => expected(&[OVER_CURRENT, SENSOR], true, &[Recovers, Stops]),
            Self::LowShort => expected(&[OVER_CURRENT], true, &[Stops]),
            // A slow motor takes less current than its sensor is off by, and is lost and restarted.
            Self::SensorZero | Self::Drift => expected(
                &[SENSOR_DRIFTS, SENSOR, OVER_CURRENT, FAILED_START],
                shows,
                &[GoesOn, Recovers, Stops],
            ),
            Self::SensorFull => expected(&[SENSOR, OVER_CURRENT], true, &[Recovers, Stops]),
            Self::HallStuck => expected(&[HALL], shows, &[GoesOn, Recovers, Stops]),
            // The rotor's own line-to-line voltage exceeds what is left: it feeds the supply through the diodes with
            // more than the trip allows. Once the supply is back the rotor is caught; the six-step drive cannot.
            Self::DeepSag if moment.is_fast() => {
                expected(&[UNDER_VOLTAGE, OVER_CURRENT], true, &[Recovers, Stops])
            }
            Self::DeepSag => expected(&[UNDER_VOLTAGE], true, &[Recovers, Stops]),
            // Braking holds the supply up; once the motor stands it runs down.
            Self::Disconnect if moment == Moment::Braking => {
                expected(&[OVER_VOLTAGE, UNDER_VOLTAGE], false, &[])
            }
            // A retry on the capacitor alone charges it from the rotor.
            Self::Disconnect if moment.is_fast() => expected(
                &[UNDER_VOLTAGE, OVER_CURRENT, OVER_VOLTAGE],
                drives,
                &[Recovers, Stops],
            ),
            // At rest the capacitor keeps the chip running until it is empty.
            Self::Disconnect => expected(&[UNDER_VOLTAGE], drives, &[Recovers, Stops]),
            Self::BrownOut => expected(&[RESTART, UNDER_VOLTAGE], true, &[Stops]),
            Self::Reset => expected(&[RESTART], true, &[Stops]),
            Self::SignalLoss => expected(&[SIGNAL_LOST], true, &[Stops]),
        }
    }
}
