//! The throttle side of the ESC: everything that must keep up with the wire's edges, whatever the other tasks
//! do.
//!
//! On the chip it belongs to a task of higher priority than [`Esc`](crate::esc::Esc)'s, which accesses it
//! through [`LockThrottle`], briefly. Each side copies what it needs of the other during such an access.

use core::mem::discriminant;

use heapless::Vec;
use siskin_params::{Board, Params};
use siskin_throttle::access::Access;
use siskin_throttle::answer::{Ask, Reply};
use siskin_throttle::authority::{Authority, Command, Denied, DriveStatus, TestError};
use siskin_throttle::command::Order;
use siskin_throttle::line::Event;
use siskin_throttle::signal::Signal;
use siskin_throttle::{Heard, Input, News};
use siskin_units::Scale;

use crate::answer::info;
use crate::answer::{self, Answer, Answers, Basis, Serial};
use crate::build::scale;
use crate::drive::{Fault, Setpoint, Snapshot};
use crate::setpoint::{Mapping, Use};
use crate::settings;
use crate::telemetry::Telemetry;

/// How long the tasks' demands on the drive hold, µs: tasks poll every millisecond, and a dead one must not
/// turn a motor.
const DEMANDS_US: u64 = 100_000;

/// A throttle wire, the answers on it, and its demands on the drive.
// Ordered by use: the most used fields are within reach of the chip's short instructions.
#[repr(C)]
pub struct Throttle {
    /// The flash is being written: the bridge must stay at rest until the processor is back.
    storing: bool,
    /// The current time, and when the tasks' demands on the drive expire unless renewed, µs.
    now_us: u64,
    demands_until_us: u64,
    demands: TaskDemands,
    /// Orders from DShot commands since the last poll, and those that wait: one of each kind, of which seven
    /// are for the tasks.
    orders: Vec<Order, 7>,
    info: [u8; info::BYTES],
    mapping: Mapping,
    basis: Basis,
    answers: Answers,
    /// The tasks' state, for answers.
    telemetry: Telemetry,
    input: Input,
}

/// What the tasks demand at each poll.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TaskDemands {
    /// What is to energise the motor while nothing turns it.
    pub(crate) wanted: Option<Use>,
    /// The temperature is over its limit.
    pub(crate) too_hot: bool,
    /// Nothing may turn the motor.
    pub(crate) barred: bool,
}

/// The state of the wire.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WireStatus {
    pub(crate) command: Command,
    pub(crate) armed: bool,
    pub(crate) signal: Option<Signal>,
    /// Valid frames or pulses arrive.
    pub(crate) traffic: bool,
    pub(crate) bad_frames: u32,
    pub(crate) bad_share: f32,
}

/// Gives tasks access to the throttle side, which may preempt them.
pub trait LockThrottle {
    /// Calls `act` with it, atomically. On the chip edges are held off meanwhile, so keep it short.
    fn lock<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T;
}

impl LockThrottle for Throttle {
    fn lock<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T {
        act(self)
    }
}

impl Throttle {
    /// Creates a quiet wire at power-up, captured by a timer of `tick_hz`, from this board's parameters.
    ///
    /// Never inlined: on the chip it is constructed in place.
    #[inline(never)]
    pub fn new(tick_hz: u32, params: &Params, board: &Board) -> Self {
        let scale = scale(params, board);
        let mut input = Input::new(tick_hz, settings::of(params));
        // Barred until the tasks report the power-up self-test.
        input.authority_mut().bar(true);
        Self {
            input,
            answers: Answers::new(tick_hz),
            mapping: Mapping::new(params, &scale),
            basis: Basis::new(scale),
            telemetry: Telemetry::new(),
            info: info::info(params, false, &board.image),
            demands: TaskDemands::default(),
            now_us: 0,
            demands_until_us: 0,
            orders: Vec::new(),
            storing: false,
        }
    }

    /// Takes no stick calibration from the first signal: the chip was reset without a loss of power, and the stick may
    /// be anywhere.
    pub fn resume(&mut self) {
        self.input.end_calibration();
    }

    /// Takes an edge of the throttle wire: its capture time, and the level after it. Returns what the sender
    /// asks for, to be passed to [`Throttle::answer`].
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) -> Option<Ask> {
        let heard = self.input.edge(now_us, at_ticks, level)?;
        self.heard(heard)
    }

    /// Takes all edges of a DShot frame at once, from the line's level before them and the leading and trailing
    /// edge of each bit, much faster than [`Throttle::edge`] on each. Returns `None`, and takes none of them,
    /// if they are no frame or belong to a signal other than the known one. Pass the result to
    /// [`Throttle::hear`], before answering or, where the answer cannot wait, after it.
    #[inline(always)] // in time for the reply
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        self.input.whole(rests_high, bit)
    }

    /// Processes the event from [`Throttle::whole`]. Returns the same as [`Throttle::edge`].
    pub fn hear(&mut self, now_us: u64, event: &Event) -> Option<Ask> {
        let heard = self.input.heard(now_us, event)?;
        self.heard(heard)
    }

    /// Advances the wire to the capture timer's current time. Call it at least once per control period. Returns
    /// the same as [`Throttle::edge`].
    pub fn settle(&mut self, now_us: u64, now_ticks: u32) -> Option<Ask> {
        self.now_us = now_us;
        let heard = self.input.settle(now_us, now_ticks)?;
        self.heard(heard)
    }

    fn heard(&mut self, heard: Heard) -> Option<Ask> {
        self.follow_wire();
        match heard.order {
            Some(Order::Info) => self.answers.send_info(self.info),
            Some(Order::Extended(on)) => self.answers.set_extended(on),
            Some(order) => {
                // The latest of its kind wins.
                let kind = discriminant(&order);
                self.take_order(|known| discriminant(known) == kind);
                let _ = self.orders.push(order);
            }
            None => {}
        }
        Ask::of(&heard.event)
    }

    /// Forgets what the sender of a lost signal requested, and, once the wire demands throttle, orders that
    /// wait for the motor to stop.
    fn follow_wire(&mut self) {
        if self.input.take_loss() {
            self.answers.lost();
        }
        if !self.input.authority().rests_by_wire() {
            self.orders.clear();
        }
    }

    /// Returns the answers to the flight controller, on the throttle wire and on the serial line, for the
    /// drive's current state.
    pub fn answer(&mut self, ask: Ask, snapshot: &Snapshot) -> Answer {
        let reply = self.reply(ask, self.speed_bits(snapshot));
        let Serial { kiss, info } = self.serial(ask, snapshot);
        Answer { reply, kiss, info }
    }

    /// Returns the reply part of [`Throttle::answer`] from a speed encoded beforehand; call
    /// [`Throttle::serial`] next.
    pub fn reply(&mut self, ask: Ask, speed_bits: u32) -> Option<Reply> {
        self.answers.reply(ask, speed_bits, &self.telemetry)
    }

    /// Returns the rest of [`Throttle::answer`].
    pub fn serial(&mut self, ask: Ask, snapshot: &Snapshot) -> Serial {
        self.answers
            .serial(ask, snapshot, &self.basis, &self.telemetry)
    }

    /// Encodes the speed for a reply in advance.
    pub fn speed_bits(&self, snapshot: &Snapshot) -> u32 {
        answer::speed_bits(snapshot, &self.basis)
    }

    /// Returns the drive's set-point.
    pub fn setpoint(&self) -> Setpoint {
        if self.demands.too_hot {
            return Setpoint::Fault(Fault::OverTemperature);
        }
        if self.storing {
            return Setpoint::Stop;
        }
        let wanted = match &self.demands.wanted {
            Some(Use::Measure(_)) if self.now_us >= self.demands_until_us => None,
            wanted => wanted.as_ref(),
        };
        self.mapping.setpoint(self.input.authority().grant(wanted))
    }

    /// Returns the motor's command from the wire or a test.
    pub fn command(&self) -> Command {
        self.input.authority().command()
    }

    /// Returns the known or forced signal of the wire.
    pub fn signal(&self) -> Option<Signal> {
        self.input.known()
    }

    /// Advances time and takes in the drive's state.
    pub(crate) fn poll(&mut self, now_us: u64, telemetry: &Telemetry) -> WireStatus {
        self.telemetry = *telemetry;
        self.demands_until_us = now_us + DEMANDS_US;
        self.input.poll(now_us, telemetry.drive(self.command()));
        self.follow_wire();
        let authority = self.input.authority();
        WireStatus {
            command: authority.command(),
            armed: authority.armed(),
            signal: self.input.signal(now_us),
            traffic: authority.signal_present(now_us),
            bad_frames: self.input.bad_frames(),
            bad_share: self.input.bad_share(),
        }
    }

    /// Returns the wire's next news for the user.
    pub(crate) fn news(&mut self, now_us: u64) -> Option<News> {
        self.input.news(now_us)
    }

    /// Starts a stick calibration, or ends it.
    pub(crate) fn calibrate(&mut self, now_us: u64, begin: bool) {
        if begin {
            self.input.calibrate(now_us);
        } else {
            self.input.end_calibration();
        }
    }

    /// Returns the wire's next order for the tasks if the motor stands; otherwise drops the orders that do not
    /// wait.
    pub(crate) fn next_order(&mut self, stopped: bool) -> Option<Order> {
        if stopped {
            return self.take_order(|_| true);
        }
        while self.take_order(|order| !order.waits()).is_some() {}
        None
    }

    /// Removes the first order that satisfies `is`.
    fn take_order(&mut self, is: impl Fn(&Order) -> bool) -> Option<Order> {
        let at = self.orders.iter().position(is)?;
        // Swap it to the end and pop: the library's `remove` pulls in a byte copy that takes 1.6 KB of the
        // chip's RAM.
        for behind in at + 1..self.orders.len() {
            self.orders.swap(behind - 1, behind);
        }
        self.orders.pop()
    }

    /// Takes over the tasks' demands.
    pub(crate) fn set_demands(&mut self, demands: TaskDemands) {
        self.demands = demands;
        self.input.authority_mut().bar(demands.barred);
    }

    /// Sets the answer to a request for the ESC's information.
    pub(crate) fn set_info(&mut self, info: [u8; info::BYTES]) {
        self.info = info;
    }

    /// Applies other parameters.
    pub(crate) fn adopt(&mut self, params: &Params, scale: Scale) {
        self.mapping = Mapping::new(params, &scale);
        self.basis = Basis::new(scale);
        self.input.set(settings::of(params));
    }

    /// Keeps the motor at rest until [`Throttle::stored`] and returns true, unless something asks it to turn.
    pub(crate) fn store(&mut self) -> bool {
        self.storing = self.command().rests();
        self.storing
    }

    /// Returns true while the flash is being written. Edges are then stale: the processor may have been stalled
    /// for longer than the capture timer's range.
    pub fn is_storing(&self) -> bool {
        self.storing
    }

    /// Ends the writing of the flash.
    pub(crate) fn stored(&mut self) {
        self.storing = false;
    }
}

/// The authority of a throttle behind [`LockThrottle`].
pub(crate) struct LockedAuthority<'a, R>(pub(crate) &'a mut R);

impl<R: LockThrottle> LockedAuthority<'_, R> {
    fn authority<T>(&mut self, act: impl FnOnce(&mut Authority) -> T) -> T {
        self.0.lock(|throttle| act(throttle.input.authority_mut()))
    }
}

impl<R: LockThrottle> Access for LockedAuthority<'_, R> {
    fn command(&mut self) -> Command {
        self.authority(Access::command)
    }

    fn armed(&mut self) -> bool {
        self.authority(Access::armed)
    }

    fn disarm(&mut self) {
        self.authority(Authority::disarm);
    }

    fn arm(&mut self, now_us: u64) -> Result<(), Denied> {
        self.authority(|authority| authority.arm(now_us))
    }

    fn actuator_test(
        &mut self,
        now_us: u64,
        value: f32,
        duration_s: f32,
        drive: DriveStatus,
    ) -> Result<(), TestError> {
        self.authority(|authority| authority.actuator_test(now_us, value, duration_s, drive))
    }

    fn may_test(&mut self, now_us: u64, drive: DriveStatus) -> bool {
        self.authority(|authority| authority.may_test(now_us, drive))
    }

    fn barred(&mut self) -> bool {
        self.authority(Access::barred)
    }
}
