//! The throttle wire's side of an ESC: everything that must keep up with the wire's edges, whatever the
//! other tasks do.
//!
//! On the chip it belongs to a task of higher priority than the one with [`Esc`](crate::esc::Esc),
//! which reaches it through [`Reach`], for a moment at a time. Data that one side needs of the other
//! are copied then.

use core::mem::discriminant;

use heapless::Vec;

use crate::answer::info;
use crate::answer::{self, Answer, Answers, Ask, Basis, Reply, Serial};
use crate::drive::{Fault, Setpoint, Snapshot};
use crate::input::access::Access;
use crate::input::authority::{Authority, Command, Denied, DriveStatus, TestError};
use crate::input::command::Order;
use crate::input::line::Event;
use crate::input::signal::Signal;
use crate::input::{Heard, Input, News};
use crate::params::{self, Board, Params, scale};
use crate::setpoint::Mapping;
use crate::telemetry::Telemetry;
use crate::tune::Note;
use crate::units::Scale;

/// Time for which the tasks' demands on the drive hold, µs: they poll each millisecond, and a task that has died
/// turns no motor.
const POLLED_US: u64 = 100_000;

/// A throttle wire, the answers on it, and its demands on the drive.
// In this order: what is used most stands where the chip's short instructions reach it.
#[repr(C)]
pub struct Throttle {
    /// While the flash is written: the bridge must stay at rest until the processor is back.
    storing: bool,
    /// The time, and when the tasks' demands on the drive end if they do not renew them, µs.
    now_us: u64,
    polled_until_us: u64,
    polled: Polled,
    /// Orders of DShot commands since the last poll, and those that wait to be done: one of each kind,
    /// and there are seven for the tasks.
    orders: Vec<Order, 7>,
    info: [u8; info::BYTES],
    mapping: Mapping,
    basis: Basis,
    answers: Answers,
    /// The state from the tasks, for answers.
    telemetry: Telemetry,
    input: Input,
}

/// The tasks' part of each poll.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Polled {
    /// The note that is due, to be played while nothing turns the motor.
    pub(crate) note: Option<Note>,
    /// The set-point of a self-test or an identification, in place of notes.
    pub(crate) test: Option<Setpoint>,
    /// True if the temperature is past its limit.
    pub(crate) too_hot: bool,
    /// True if nothing may turn the motor.
    pub(crate) barred: bool,
}

/// The state of the wire.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing {
    pub(crate) command: Command,
    pub(crate) armed: bool,
    pub(crate) signal: Option<Signal>,
    /// True if valid frames or pulses come in.
    pub(crate) traffic: bool,
    pub(crate) bad_frames: u32,
    pub(crate) bad_share: f32,
}

/// A way to the throttle's side for the tasks, which it may interrupt.
pub trait Reach {
    /// Does this with it, at one moment. On the chip its edges wait meanwhile, so it must be short.
    fn reach<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T;
}

impl Reach for Throttle {
    fn reach<T>(&mut self, act: impl FnOnce(&mut Throttle) -> T) -> T {
        act(self)
    }
}

impl Throttle {
    /// A quiet wire at power-up, captured by a timer of `tick_hz`, with these parameters of this board.
    ///
    /// Never inlined: on the chip it is made where it stays.
    #[inline(never)]
    pub fn new(tick_hz: u32, params: &Params, board: &Board) -> Self {
        let scale = scale(params, board);
        let mut input = Input::new(tick_hz, params::input(params));
        // Until the tasks tell that the board has tested itself.
        input.authority_mut().bar(true);
        Self {
            input,
            answers: Answers::new(tick_hz),
            mapping: Mapping::new(params, &scale),
            basis: Basis::new(scale),
            telemetry: Telemetry::new(),
            info: info::info(params, false, &board.image),
            polled: Polled::default(),
            now_us: 0,
            polled_until_us: 0,
            orders: Vec::new(),
            storing: false,
        }
    }

    /// An edge on the throttle wire: when the capturing timer saw it, and the level after it. Returns
    /// what the sender asks for, to be given to [`Throttle::answer`].
    pub fn edge(&mut self, now_us: u64, at_ticks: u32, level: bool) -> Option<Ask> {
        let heard = self.input.edge(now_us, at_ticks, level)?;
        self.heard(heard)
    }

    /// Takes all edges of a DShot frame at once, by the line's level before them and the first and the second
    /// of each bit, much sooner than [`Throttle::edge`] does one by one; nothing, and none of them is taken,
    /// if they are no frame, or one of another signal than that which is known. What is found is to be given
    /// to [`Throttle::hear`], before its answer or, where that cannot wait, behind it.
    #[inline(always)] // in time for the reply
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        self.input.whole(rests_high, bit)
    }

    /// Takes the event of [`Throttle::whole`]. Returns the same as [`Throttle::edge`].
    pub fn hear(&mut self, now_us: u64, event: &Event) -> Option<Ask> {
        let heard = self.input.heard(now_us, event)?;
        self.heard(heard)
    }

    /// Tells the time of the timer that captures the wire's edges, once a control period or more
    /// often. Returns the same as [`Throttle::edge`].
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
                // The latest of its kind holds.
                let kind = discriminant(&order);
                self.take_order(|known| discriminant(known) == kind);
                let _ = self.orders.push(order);
            }
            None => {}
        }
        Ask::of(&heard.event)
    }

    /// Forgets what the sender of a lost signal has asked for, and what waits for a motor at rest when it is
    /// asked to turn.
    fn follow_wire(&mut self) {
        if self.input.take_loss() {
            self.answers.lost();
        }
        if !self.input.authority().rests_by_wire() {
            self.orders.clear();
        }
    }

    /// The answer to the flight controller, on the throttle wire and on the serial line, with the
    /// drive's present state.
    pub fn answer(&mut self, ask: Ask, snapshot: &Snapshot) -> Answer {
        let reply = self.reply(ask, self.speed_bits(snapshot));
        let Serial { kiss, info } = self.serial(ask, snapshot);
        Answer { reply, kiss, info }
    }

    /// The reply of [`Throttle::answer`], with the speed's bits made ready before; the rest is to follow.
    pub fn reply(&mut self, ask: Ask, speed_bits: u32) -> Option<Reply> {
        self.answers.reply(ask, speed_bits, &self.telemetry)
    }

    /// The rest of [`Throttle::answer`].
    pub fn serial(&mut self, ask: Ask, snapshot: &Snapshot) -> Serial {
        self.answers
            .serial(ask, snapshot, &self.basis, &self.telemetry)
    }

    /// The bits of a reply that tells the speed, before anything has been asked.
    pub fn speed_bits(&self, snapshot: &Snapshot) -> u32 {
        answer::speed_bits(snapshot, &self.basis)
    }

    /// The drive's set-point.
    pub fn setpoint(&self) -> Setpoint {
        if self.polled.too_hot {
            return Setpoint::Fault(Fault::OverTemperature);
        }
        if self.storing {
            return Setpoint::Stop;
        }
        let command = self.command();
        match (self.polled.test, self.polled.note) {
            (Some(test), _) if command.rests() && self.now_us < self.polled_until_us => test,
            (None, Some(note)) if command.rests() => self.mapping.tone(note),
            _ => self.mapping.setpoint(command),
        }
    }

    /// The motor's command by the wire or by a test.
    pub fn command(&self) -> Command {
        self.input.authority().command()
    }

    /// The signal that the wire is known to carry, or has been forced to.
    pub fn signal(&self) -> Option<Signal> {
        self.input.known()
    }

    /// Lets time pass, and takes in the drive's state.
    pub(crate) fn poll(&mut self, now_us: u64, telemetry: &Telemetry) -> Standing {
        self.telemetry = *telemetry;
        self.polled_until_us = now_us + POLLED_US;
        self.input.poll(now_us, telemetry.drive(self.command()));
        self.follow_wire();
        let authority = self.input.authority();
        Standing {
            command: authority.command(),
            armed: authority.armed(),
            signal: self.input.signal(now_us),
            traffic: authority.signal_present(now_us),
            bad_frames: self.input.bad_frames(),
            bad_share: self.input.bad_share(),
        }
    }

    /// The wire's next news for a person.
    pub(crate) fn news(&mut self, now_us: u64) -> Option<News> {
        self.input.news(now_us)
    }

    /// Begins a calibration by stick, or ends it.
    pub(crate) fn calibrate(&mut self, now_us: u64, begin: bool) {
        if begin {
            self.input.calibrate(now_us);
        } else {
            self.input.end_calibration();
        }
    }

    /// The next order of the wire for the tasks, if the motor stands; else some wait, and the others are
    /// dropped.
    pub(crate) fn next_order(&mut self, stopped: bool) -> Option<Order> {
        if stopped {
            return self.take_order(|_| true);
        }
        while self.take_order(|order| !order.waits()).is_some() {}
        None
    }

    /// Takes the first order of such.
    fn take_order(&mut self, is: impl Fn(&Order) -> bool) -> Option<Order> {
        let at = self.orders.iter().position(is)?;
        // To its end, past those behind it: the library's way to remove it moves bytes by a copy that
        // takes 1.6 KB of the chip's RAM.
        for behind in at + 1..self.orders.len() {
            self.orders.swap(behind - 1, behind);
        }
        self.orders.pop()
    }

    /// Takes in the tasks' part.
    pub(crate) fn take_polled(&mut self, polled: Polled) {
        self.polled = polled;
        self.input.authority_mut().bar(polled.barred);
    }

    /// Takes the answer for a wire that asks for the ESC's information.
    pub(crate) fn tell_info(&mut self, info: [u8; info::BYTES]) {
        self.info = info;
    }

    /// Goes on with other parameters.
    pub(crate) fn adopt(&mut self, params: &Params, scale: Scale) {
        self.mapping = Mapping::new(params, &scale);
        self.basis = Basis::new(scale);
        self.input.set(params::input(params));
    }

    /// Keeps the motor at rest until [`Throttle::stored`], if nothing asks it to turn; else does
    /// nothing.
    pub(crate) fn store(&mut self) -> bool {
        self.storing = self.command().rests();
        self.storing
    }

    /// Returns true while the flash is being written. Edges are stale then: the processor may have been
    /// stalled for longer than the capturing timer counts.
    pub fn is_storing(&self) -> bool {
        self.storing
    }

    /// The flash is written.
    pub(crate) fn stored(&mut self) {
        self.storing = false;
    }
}

/// The authority of a throttle that is reached.
pub(crate) struct Reached<'a, R>(pub(crate) &'a mut R);

impl<R: Reach> Reached<'_, R> {
    fn authority<T>(&mut self, act: impl FnOnce(&mut Authority) -> T) -> T {
        self.0.reach(|throttle| act(throttle.input.authority_mut()))
    }
}

impl<R: Reach> Access for Reached<'_, R> {
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
}
