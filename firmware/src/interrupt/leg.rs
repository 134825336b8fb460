//! The states of the bridge's phases, and the timer's bits that make them.

use embassy_stm32::pac::timer::regs::{CcerAdv, CcmrOutputGp16};
use embassy_stm32::pac::timer::vals::Ocm;
use siskin_units::Duty;

use super::timing::compare;
use crate::board::PHASES;

/// The state of a phase for one period.
#[derive(Clone, Copy)]
pub(super) enum Leg {
    /// Both switches off.
    Off,
    /// Low side on for this share, around the top; high side off.
    Low(Duty),
    /// High side on for this share, low side for the rest.
    Switching(Duty),
}

impl Leg {
    /// Returns a channel's bits as the first of its mode register: while the reference output is high, the high side is
    /// on, or the low side alone.
    #[inline(always)] // constants for `Modes::off`
    fn output(self) -> u32 {
        let mut output = CcmrOutputGp16::default();
        output.set_ocm(
            0,
            match self {
                // The reference is forced low.
                Self::Off => Ocm::FORCE_INACTIVE,
                // High above the compare value: around the top.
                Self::Low(_) => Ocm::PWM_MODE2,
                Self::Switching(_) => Ocm::PWM_MODE1,
            },
        );
        output.set_ocpe(0, true);
        output.0
    }

    /// Returns a channel's bits as the first of the enable register. In a phase that is off, one enabled output keeps the
    /// other driven.
    #[inline(always)] // constants for `Modes::off`
    fn enables(self) -> u32 {
        let mut enables = CcerAdv::default();
        enables.set_cce(0, !matches!(self, Self::Low(_)));
        enables.set_ccne(0, !matches!(self, Self::Off));
        enables.0
    }

    /// Returns the compare value, of a counter with this top.
    pub(super) fn compare(self, top: u16) -> u32 {
        match self {
            Self::Off => 0,
            Self::Low(share) => u32::from(top).saturating_sub(compare(share, top)),
            Self::Switching(duty) => compare(duty, top),
        }
    }
}

/// The modes and enable bits of all channels.
#[derive(Clone, Copy)]
pub(super) struct Modes {
    /// Of channels 1 and 2, and of 3 and 4.
    pub(super) outputs: [CcmrOutputGp16; 2],
    /// Of all four.
    pub(super) enables: CcerAdv,
}

impl Modes {
    /// Returns those of phases with both switches off.
    pub(super) fn off() -> Self {
        Self::of_channels(Leg::Off, Leg::Off, Leg::Off)
    }

    /// Returns those of the phases' states.
    pub(super) fn of(legs: [Leg; 3]) -> Self {
        Self::of_channels(legs[PHASES[0]], legs[PHASES[1]], legs[PHASES[2]])
    }

    #[inline(always)] // constants for `off`
    fn of_channels(first: Leg, second: Leg, third: Leg) -> Self {
        // Channel 4 is the trigger.
        let mut trigger = CcmrOutputGp16::default();
        trigger.set_ocm(1, Ocm::PWM_MODE2);
        let mut enables = CcerAdv::default();
        enables.set_cce(3, true);
        Self {
            outputs: [
                CcmrOutputGp16(first.output() | second.output() << 8),
                CcmrOutputGp16(third.output() | trigger.0),
            ],
            enables: CcerAdv(
                first.enables() | second.enables() << 4 | third.enables() << 8 | enables.0,
            ),
        }
    }
}
