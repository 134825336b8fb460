//! The chip's program for the control step: replays the recorded periods and answers with what they did.

#![no_std]
#![no_main]

mod count;
mod program;
mod words;

use core::hint::black_box;

use cortex_m_rt::entry;
use semihosting::io;
use siskin_control::drive::{Bridge, Config, Sample, Setpoint, State, step};
use siskin_on_target::{answer, request};

use count::Counter;
use words::{Reader, Writer};

#[entry]
fn main() -> ! {
    program::run(replay)
}

fn replay(counter: &Counter) -> io::Result<()> {
    let mut reader = Reader::open()?;
    let mut writer = Writer::create()?;
    let config = program::configuration(&mut reader)?;
    let mut state = State::new(&config);
    while let Some(words) = reader.next()? {
        let input = request::read_period(&words);
        let (bridge, instructions) = counter.count(|| period(&config, &mut state, &input));
        writer.put(&answer::result(&config, &state, bridge))?;
        writer.put(&[instructions])?;
    }
    writer.flush()
}

/// The part that is counted: from call to return.
#[inline(never)]
fn period(config: &Config, state: &mut State, input: &(Sample, Setpoint)) -> Bridge {
    let (sample, setpoint) = *input;
    black_box(step(config, state, sample, setpoint))
}
