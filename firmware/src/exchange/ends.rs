//! The ends of the exchange, given out once, so that the types enforce single writers.

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use siskin_control::drive::{Config, Setpoint, Snapshot};

use super::latest::{self, Latest};
use super::swap::{self, Swap};
use super::word;

static OPENED: AtomicBool = AtomicBool::new(false);
static SETPOINT: AtomicU32 = AtomicU32::new(0);
static SNAPSHOT: Latest<Snapshot> = Latest::new();
static CONFIG: Swap<Config> = Swap::new();

/// The ends of the exchange.
pub struct Ends {
    /// For the interrupt.
    pub interrupt: InterruptEnd,
    /// For the task that commands the motor.
    pub setpoint: SetpointWriter,
    /// For the tasks that report its state.
    pub snapshot: SnapshotReader,
    /// For the task that owns the parameters.
    pub config: ConfigWriter,
}

/// Returns the ends on the first call, `None` afterwards.
///
/// A set-point that is not renewed for more than `stale_periods` control periods becomes `Stop`.
pub fn open(stale_periods: u32) -> Option<Ends> {
    if OPENED.swap(true, Ordering::Relaxed) {
        return None;
    }
    // SAFETY: reached once.
    let (writer, reader) = unsafe { Latest::<Snapshot>::hands() };
    // SAFETY: as above.
    let (offerer, beginner) = unsafe { Swap::<Config>::hands() };
    Some(Ends {
        interrupt: InterruptEnd {
            stale_periods,
            snapshot: writer,
            config: beginner,
        },
        setpoint: SetpointWriter { sequence: 0 },
        snapshot: SnapshotReader {
            hand: Mutex::new(RefCell::new(reader)),
        },
        config: ConfigWriter { hand: offerer },
    })
}

/// The interrupt's end, before it has a configuration.
pub struct InterruptEnd {
    stale_periods: u32,
    snapshot: latest::Writer,
    config: swap::Beginner,
}

impl InterruptEnd {
    /// Puts the first configuration into use, as `make` fills it in place.
    pub fn begin(self, make: impl FnOnce(&mut Config)) -> RunningEnd {
        RunningEnd {
            word: 0,
            setpoint: Setpoint::Stop,
            age_periods: 0,
            stale_periods: self.stale_periods,
            snapshot: self.snapshot,
            config: CONFIG.begin(self.config, make),
        }
    }
}

/// The interrupt's end.
pub struct RunningEnd {
    /// The last word, and its set-point.
    word: u32,
    setpoint: Setpoint,
    age_periods: u32,
    stale_periods: u32,
    snapshot: latest::Writer,
    config: swap::User,
}

impl RunningEnd {
    /// Takes a new set-point, if any. Call it once per period, since it counts the set-point's age.
    #[inline(always)] // in each period
    pub(crate) fn listen(&mut self) {
        let word = SETPOINT.load(Ordering::Relaxed);
        if word != self.word {
            self.renew(word);
        } else if self.age_periods < self.stale_periods {
            self.age_periods += 1;
        } else {
            self.setpoint = Setpoint::Stop;
        }
    }

    /// Returns the set-point for this period.
    #[inline(always)] // in each period
    pub(crate) fn setpoint(&self) -> &Setpoint {
        &self.setpoint
    }

    /// Takes a new word. Successive words differ in their sequence number.
    #[inline(never)] // only some periods
    fn renew(&mut self, word: u32) {
        self.word = word;
        self.setpoint = word::unpack(word);
        self.age_periods = 0;
    }

    /// Switches to an offered configuration, if any, after calling `change` with the old one and the new one.
    #[inline(always)] // in each period
    pub(crate) fn adopt(&mut self, change: impl FnOnce(&Config, &Config)) {
        CONFIG.adopt(&mut self.config, change);
    }

    /// Calls `work` with the configuration in use.
    #[inline(always)] // in each period
    pub(crate) fn with_config<R>(&self, work: impl FnOnce(&Config) -> R) -> R {
        CONFIG.with(&self.config, work)
    }

    /// Publishes the snapshot to the tasks.
    #[inline(always)] // in each period
    pub(crate) fn publish(&mut self, snapshot: Snapshot) {
        SNAPSHOT.publish(&mut self.snapshot, snapshot);
    }
}

/// The end of the task that commands the motor.
pub struct SetpointWriter {
    sequence: u32,
}

impl SetpointWriter {
    /// Sets and renews the set-point. The interrupt could miss a write only after 31 of them within one control
    /// period.
    pub fn write(&mut self, setpoint: Setpoint) {
        self.sequence = self.sequence.wrapping_add(1);
        SETPOINT.store(word::pack(setpoint, self.sequence), Ordering::Relaxed);
    }
}

/// The end of the tasks that report the motor's state. They share it by reference, and read one at a time.
pub struct SnapshotReader {
    hand: Mutex<CriticalSectionRawMutex, RefCell<latest::Reader>>,
}

impl SnapshotReader {
    /// Returns the latest snapshot, or `None` before the first.
    pub fn read(&self) -> Option<Snapshot> {
        self.hand.lock(|hand| SNAPSHOT.read(&mut hand.borrow_mut()))
    }
}

/// The end of the task that owns the parameters.
pub struct ConfigWriter {
    hand: swap::Offerer,
}

impl ConfigWriter {
    /// Offers a configuration that `make` fills in place, if it returns true; the interrupt adopts it as a
    /// whole in its next period. Returns false if nothing was offered, as while the previous one is not adopted
    /// yet.
    pub fn offer(&mut self, make: impl FnOnce(&mut Config) -> bool) -> bool {
        CONFIG
            .free(&mut self.hand)
            .is_some_and(|free| free.offer(make))
    }
}
