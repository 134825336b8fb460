//! Starts everything.

use embassy_executor::Spawner;
use embassy_stm32::uid::uid;
use siskin_control::esc::{Esc, PowerUp};
use siskin_control::mavlink::Receiver;
use siskin_control::record;
use siskin_control::store;
use siskin_control::throttle::{LockThrottle, Throttle};
use siskin_params::choice::CtlObserver;
use siskin_params::{Board, Image, ParamId, Params};
use static_cell::StaticCell;

use super::health::Health;
use super::light::Light;
use super::mavlink::MainTask;
use super::supervisor::Supervisor;
use super::throttle::{Capture, Listener, Port, Replier};
use super::trouble::Teller;
use super::{kiss, mavlink, throttle};
use crate::board::wire::TICK_HZ;
use crate::board::{BOARD, Bridge, Converters, Hardware, KISS_TAKES_A_SENSOR};
use crate::exchange::{InterruptEnd, SnapshotReader};
use crate::storage::{Storage, range};
use crate::{chip, exchange, interrupt, last_words};

/// Set-point age at which the interrupt stops obeying it: ten missed renewals.
const STALE_S: f32 = 0.01;

/// Bytes received between two looks of the task: 5 ms of the fastest link.
const LINE_BYTES: usize = 512;

/// Starts the control interrupt and all tasks except the ESC's own, which it returns.
///
/// # Panics
/// If called again.
#[inline(never)] // its stack is free for what comes next
pub fn start(spawner: Spawner, mut hardware: Hardware, esc: &mut Esc, fit: Fit) -> MainTask<'_> {
    tell(esc, fit);
    if let Some(text) = chip::clock_trouble() {
        esc.warn_of(text);
    }
    recall_rest(esc, &mut hardware.flash);
    let mut port = open_port(esc.params());
    let reset = chip::take_reset();
    if !reset.power_up {
        port.lock(Throttle::resume);
    }
    if let Some(text) = last_words::take(reset.starved) {
        esc.warn_of(&text);
    }
    if record::KEPT {
        let record = interrupt::record();
        record.open();
        esc.serve(record);
    }
    let pwm_hz = esc.pwm_hz();
    let baud = esc.params().get(ParamId::TelBaud) as u32;
    let kiss_is_free = !(KISS_TAKES_A_SENSOR && esc.params().chosen(CtlObserver::Hall));

    let stale_periods = (pwm_hz * STALE_S) as u32;
    let ends = exchange::open(stale_periods).expect("opened here and nowhere else");
    static SNAPSHOT: StaticCell<SnapshotReader> = StaticCell::new();
    let snapshot = &*SNAPSHOT.init(ends.snapshot);
    let limit_a = esc.params().get(ParamId::LimPhaseA);
    start_interrupt(esc, hardware.bridge, hardware.converters, ends.interrupt);
    let ((edges, asked), (reply, update)) = hardware.throttle.open();
    let listener = Listener {
        port,
        capture: Capture::new(edges, asked),
        setpoint: ends.setpoint,
        snapshot,
        frame_ticks: None,
    };
    throttle::start(listener, Replier::new(reply, update));

    let (out, line) = hardware.mavlink.open(baud).split();
    static BYTES: StaticCell<[u8; LINE_BYTES]> = StaticCell::new();
    let line = line.into_ring_buffered(BYTES.init_with(|| [0; LINE_BYTES]));

    let once = "spawned here and nowhere else";
    spawner.spawn(mavlink::transmit(out).expect(once));
    if kiss_is_free {
        spawner.spawn(kiss::transmit(hardware.kiss.open()).expect(once));
    }
    MainTask {
        esc,
        throttle: port,
        line,
        config: ends.config,
        snapshot,
        flash: hardware.flash,
        health: Health::new(hardware.temperature),
        receiver: Receiver::new(),
        teller: Teller::new(),
        light: Light::new(hardware.light),
        supervisor: Supervisor::new(hardware.watchdog),
        changed: false,
        limit_a,
        restart_polls: None,
    }
}

/// How well the stored parameters fit the board.
#[derive(Default)]
pub struct Fit {
    /// The last one that was brought within its bounds, and why.
    changed: Option<(ParamId, &'static str)>,
}

/// Creates the ESC with the stored parameters. The store is read twice: while the ESC is constructed, the stack only has
/// room for the parameters.
// Out of line, like the functions below: the stack one takes is free for the next.
#[inline(never)]
pub fn power_up(flash: &mut Storage, fit: &mut Fit) -> Esc {
    let board = board();
    let mut params = stored_params(flash);
    fit.changed = params.fit(&board);
    let drive = PowerUp::new(&params, &board);
    let bytes_per_s = params.get(ParamId::TelBaud) as u32 / 10;
    Esc::alone(params, board, drive, bytes_per_s)
}

/// Makes the ESC report what became of the stored parameters.
#[inline(never)] // its stack is free for what comes next
fn tell(esc: &mut Esc, fit: Fit) {
    if let Some((id, reason)) = fit.changed {
        esc.warn_in_pieces(id.entry().name, [": ", reason, ""]);
    }
}

/// Returns this board, with its serial number.
#[inline(never)] // two call it
fn board() -> Board {
    Board {
        image: Image {
            serial: uid(),
            ..BOARD.image
        },
        ..BOARD
    }
}

#[inline(never)] // its stack is free for what comes next
fn stored_params(flash: &mut Storage) -> Params {
    store::load(flash, range()).kept.params
}

#[inline(never)] // its stack is free for what comes next
fn recall_rest(esc: &mut Esc, flash: &mut Storage) {
    esc.recall(&store::load(flash, range()));
}

/// Parameters that do not fit will do: the motor is off, and the wire follows once they are replaced. A copy of those in
/// force instead would take 0.2 KB of stack more.
#[inline(never)] // its stack is free for what comes next
fn open_port(params: &Params) -> Port {
    Port::open(|| Throttle::new(TICK_HZ, params, &board()))
}

/// Starts the control interrupt with the parameters' configuration.
#[inline(never)] // its stack is free for what comes next
fn start_interrupt(esc: &Esc, bridge: Bridge, converters: Converters, end: InterruptEnd) {
    interrupt::set_trip(esc.params().get(ParamId::LimPhaseA));
    let end = end.begin(|place| {
        esc.config_in(place).expect("it has been built before");
    });
    interrupt::start(bridge, converters, end);
}
