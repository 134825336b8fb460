//! Siskin on a board: the control crate's [`step`](siskin_control::drive::step) in the PWM
//! interrupt, and tasks around it.
//!
//! ```text
//! cargo build -p siskin-firmware --release --target thumbv7em-none-eabihf --features b-g431b-esc1
//! ```
//!
//! | file | what it is |
//! |---|---|
//! | `board/` | one file a board: clock, pins, converters, what a count is worth |
//! | `pwm.rs` | TIM1: centre-aligned complementary PWM with dead time, and the converters' trigger |
//! | `sense.rs` | the converters' counts and the Hall sensors' levels into a `Sample` |
//! | `control.rs` | the interrupt: sample, `step`, bridge |
//! | `exchange.rs` | the memory that the interrupt and the tasks share |
//! | `panic.rs` | what ends everything: the bridge off first |
//!
//! What is there: start-up at 170 MHz, the interrupt at the end of the injected conversions once a
//! PWM period at priority 0 with everything else below, the bridge as `step` wants it, and a light
//! that shows faults.
//!
//! What is not there yet: nothing has run on a board. There is no throttle input, so the set-point
//! is `Stop` for ever, the control stays idle and the bridge off. There is no MAVLink, no stored
//! parameters (the table's defaults hold), no temperature (`LIM_TEMP_C` does nothing), no
//! over-current trip in hardware, no watchdog, and the interrupt runs from flash.

#![no_std]
#![no_main]

#[cfg(not(feature = "b-g431b-esc1"))]
compile_error!("choose a board: --features b-g431b-esc1");

mod board;
mod control;
mod exchange;
mod panic;
mod pwm;
mod sense;

use control::Control;
use embassy_executor::Spawner;
use embassy_stm32::gpio::Output;
use embassy_time::{Duration, Ticker, Timer};
use exchange::SnapshotReader;
use siskin_control::drive::Setpoint;
use siskin_control::params::{ParamId, Params, build};

/// How often the tasks renew the set-point.
const RENEWAL: Duration = Duration::from_millis(1);

/// Age at which the interrupt stops obeying a set-point: ten missed renewals.
const STALE_S: f32 = 0.01;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let hardware = board::Hardware::claim(embassy_stm32::init(board::clock()));
    control::lower_all_interrupts();

    let params = Params::default();
    let Ok(config) = build(&params, &board::BOARD) else {
        panic!("the default parameters do not fit this board");
    };
    let pwm_hz = params.get(ParamId::PwmFreqHz);
    let pwm = pwm::Pwm::new(hardware.bridge, pwm_hz, params.get(ParamId::PwmDeadtimeNs));
    let ends = exchange::open((pwm_hz * STALE_S) as u32).expect("opened here and nowhere else");
    control::start(Control::new(
        config,
        pwm,
        sense::Sensors::new(hardware.converters),
        ends.interrupt,
    ));

    let light = show(hardware.light, ends.snapshot).expect("spawned here and nowhere else");
    spawner.spawn(light);

    let mut setpoint = ends.setpoint;
    let mut ticker = Ticker::every(RENEWAL);
    loop {
        setpoint.write(Setpoint::Stop);
        ticker.next().await;
    }
}

/// Flashes once when all is well, and n + 2 times for the fault with the lowest number n; then comes
/// a pause. Dark: the control does not run.
#[embassy_executor::task]
async fn show(mut light: Output<'static>, snapshot: SnapshotReader) {
    loop {
        let flashes = snapshot.read().map_or(0, |s| {
            s.faults.iter().next().map_or(1, |fault| fault as u64 + 2)
        });
        for _ in 0..flashes {
            light.set_high();
            Timer::after_millis(50).await;
            light.set_low();
            Timer::after_millis(200).await;
        }
        Timer::after_millis(1750).await;
    }
}
