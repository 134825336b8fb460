//! What breaks on the bench: the kinds of faults, and when each acts.

mod timeline;

pub use timeline::{InForce, Timeline};

/// Which switch of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Between the phase and the negative pole.
    Low,
    /// Between the phase and the positive pole.
    High,
}

/// What is wrong. Phases count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// The shaft is held at standstill.
    RotorBlocked,
    /// The wire to a phase is open.
    PhaseOpen(usize),
    /// A switch never turns on; its body diode still works.
    MosfetOpen(usize, Side),
    /// A switch is always on.
    MosfetShort(usize, Side),
    /// A current sensor reads this, A.
    SensorStuck(usize, f64),
    /// A current sensor's zero moves by this, A: linearly over the fault's time, and stays.
    OffsetDrift(usize, f64),
    /// The motor's resistance grows by this share of the bench's: linearly over the fault's time, and stays.
    ResistanceDrift(f64),
    /// The same of its flux.
    FluxDrift(f64),
    /// Extra noise on all currents, A rms.
    Noise(f64),
    /// A Hall sensor reads this level.
    HallStuck(usize, bool),
    /// The supply gives this many volts less.
    BusSag(f64),
    /// The supply is gone; the bus has only its capacitor.
    BusDisconnect,
    /// The supply gives no more than this, V.
    BrownOut(f64),
    /// The shaft turns faster by this, rad/s: at once, or linearly over the fault's time.
    RotorKick(f64),
    /// The air moves as fast as the propeller would at this speed, rad/s.
    Gust(f64),
    /// A torque on the shaft, Nm; positive turns it forward.
    Strike(f64),
    /// Nothing comes over the throttle wire.
    SignalLoss,
    /// Each bit of a frame on the wire is wrong with this probability.
    BitErrors(f64),
    /// Each edge on the wire is displaced, ns rms.
    Jitter(f64),
    /// The chip restarts; it is held in reset for the fault's time, if given.
    Reset,
    /// The flash refuses to be written or erased.
    FlashFail,
}

impl Kind {
    /// Returns true if both are the same except for a value.
    fn is_like(&self, other: &Self) -> bool {
        let place = |kind: &Self| match *kind {
            Self::PhaseOpen(phase)
            | Self::SensorStuck(phase, _)
            | Self::OffsetDrift(phase, _)
            | Self::HallStuck(phase, _) => Some((phase, None)),
            Self::MosfetOpen(phase, side) | Self::MosfetShort(phase, side) => {
                Some((phase, Some(side)))
            }
            _ => None,
        };
        std::mem::discriminant(self) == std::mem::discriminant(other) && place(self) == place(other)
    }

    /// Returns true if it may lower the bus so far that the chip resets.
    const fn weakens_bus(&self) -> bool {
        matches!(
            self,
            Self::BusSag(_) | Self::BusDisconnect | Self::BrownOut(_)
        )
    }
}

/// Bus voltage below which a chip is held in reset once a fault has weakened it, V: 3.3 V plus the
/// drop of its regulator.
pub const CHIP_V: f64 = 4.5;

/// An entry of the time line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// When it begins, s: at the first control period from then on.
    pub at_s: f64,
    /// How long it acts, s; until the end if not given.
    pub for_s: Option<f64>,
    /// What is wrong.
    pub kind: Kind,
}

impl Fault {
    fn end_s(&self) -> f64 {
        self.at_s + self.for_s.unwrap_or(f64::INFINITY)
    }

    fn has_begun(&self, t_s: f64) -> bool {
        t_s >= self.at_s
    }

    /// Returns true if it no longer acts.
    pub fn is_over(&self, t_s: f64) -> bool {
        t_s >= self.end_s()
    }

    fn acts(&self, t_s: f64) -> bool {
        self.has_begun(t_s) && !self.is_over(t_s)
    }

    /// Returns how far it has grown, 0..1, if it grows linearly over its time and stays.
    fn share(&self, t_s: f64) -> f64 {
        match self.for_s {
            _ if !self.has_begun(t_s) => 0.0,
            Some(for_s) if for_s > 0.0 => ((t_s - self.at_s) / for_s).min(1.0),
            _ => 1.0,
        }
    }

    /// Returns true if its effect changes from period to period.
    fn moves(&self, t_s: f64) -> bool {
        let grows = matches!(
            self.kind,
            Kind::OffsetDrift(..)
                | Kind::ResistanceDrift(_)
                | Kind::FluxDrift(_)
                | Kind::RotorKick(_)
        );
        // The chip resets and comes back as the bus falls and rises, which continues after the
        // fault.
        let follows = self.kind.weakens_bus() && self.has_begun(t_s);
        follows || grows && self.for_s.is_some() && self.acts(t_s)
    }
}
