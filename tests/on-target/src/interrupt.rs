//! The chip's program for the whole interrupt. The board's registers are memory here: the recorded counts
//! are put there before each period, and the answer is what the interrupt publishes.

#![no_std]
#![no_main]

mod count;
mod program;
mod words;

use cortex_m_rt::entry;
use semihosting::io;
use siskin_firmware::exchange;
use siskin_firmware::interrupt::{Interrupt, Stand};
use siskin_on_target::{answer, request};

use count::Counter;
use words::{Reader, Writer};

/// A task renews the set-point once a millisecond, or at once if another one is wanted: at the slowest PWM,
/// once in this many periods.
const RENEWED_EVERY: usize = 8;

const STALE_PERIODS: u32 = 10;

static STAND: Stand = Stand::new();

#[entry]
fn main() -> ! {
    program::run(replay)
}

fn replay(counter: &Counter) -> io::Result<()> {
    let mut reader = Reader::open()?;
    let mut writer = Writer::create()?;
    let config = program::configuration(&mut reader)?;
    let mut ends = exchange::open(STALE_PERIODS).expect("opened here and nowhere else");
    let mut interrupt = Interrupt::new(
        STAND.registers(),
        ends.interrupt.begin(|place| *place = config),
    );
    let mut before = None;
    for n in 0.. {
        let Some(words) = reader.next()? else { break };
        let (sample, setpoint) = request::read_period(&words);
        STAND.set_sample(&sample);
        if n % RENEWED_EVERY == 0 || before != Some(setpoint) {
            ends.setpoint.write(setpoint);
            before = Some(setpoint);
        }
        let ((), instructions) = counter.count(|| period(&mut interrupt));
        let snapshot = ends.snapshot.read().expect("one has been published");
        writer.put(&[answer::snapshot(&snapshot), instructions])?;
    }
    writer.flush()
}

/// The part that is counted: from call to return. The processor's exception entry and exit, which save and
/// restore registers, are not instructions.
#[inline(never)]
fn period(interrupt: &mut Interrupt) {
    interrupt.run();
}
