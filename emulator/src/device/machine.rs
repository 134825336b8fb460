//! The emulated ESC as a machine, driven by its throttle wire.

use super::Device;
use crate::fault::Fault;
use crate::link::LinkId;
use crate::machine::{Machine, Onlooker, Stopped};
use crate::rig::Bench;
use crate::summary::Rejected;
use crate::wire::Wire;

impl Machine for Device {
    fn now_ns(&self) -> u64 {
        self.now_ns()
    }

    fn is_before(&self, until_ns: u64) -> bool {
        self.is_before(until_ns)
    }

    fn wire(&mut self, _: usize) -> &mut Wire {
        self.wire()
    }

    fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker) {
        self.receive(stream, bytes, onlooker);
    }

    fn forget(&mut self, stream: LinkId) {
        self.forget(stream);
    }

    fn advance(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Stopped> {
        self.advance(until_ns, |_, _| None, onlooker, send);
        Ok(())
    }

    fn inject(&mut self, _: usize, fault: Fault) -> Result<(), &'static str> {
        self.inject(fault);
        Ok(())
    }

    fn mend(&mut self, _: usize) -> Result<(), &'static str> {
        self.mend();
        Ok(())
    }

    fn fit(&mut self, _: usize, bench: &Bench) -> Result<(), &'static str> {
        self.fit(bench)?;
        self.around_mut().bus_mut().set_supply(bench.supply);
        Ok(())
    }

    fn rejected(&self, _: usize) -> Rejected {
        self.rejected()
    }
}
