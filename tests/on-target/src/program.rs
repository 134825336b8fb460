//! What both programs begin and end with.

use cortex_m::Peripherals;
use semihosting::{io, process};
use siskin_control::build::build;
use siskin_control::drive::Config;
use siskin_on_target::request;

use crate::count::Counter;
use crate::words::Reader;

/// Replays the recorded run, and ends QEMU.
pub(crate) fn run(replay: impl FnOnce(&Counter) -> io::Result<()>) -> ! {
    let peripherals = Peripherals::take().expect("taken here and nowhere else");
    replay(&Counter::new(peripherals.SYST)).expect("the PC gives and takes the files");
    process::exit(0)
}

/// Returns the configuration with which the recorded run begins.
pub(crate) fn configuration(reader: &mut Reader) -> io::Result<Config> {
    let set_up = reader.next()?.expect("the set-up comes first");
    let (params, board) = request::read_set_up(&set_up);
    Ok(build(&params, &board).expect("the PC has built it"))
}
