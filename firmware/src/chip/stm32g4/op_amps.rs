//! Op-amps.

use embassy_stm32::pac::opamp::Opamp;
use embassy_stm32::pac::opamp::vals::{PgaGain, VmSel, VpSel};

/// Enables an op-amp that amplifies its first input by 16 relative to its VINM0, not to the chip's ground. Its
/// output goes to a converter inside the chip, or to its pin. The pins are analogue, as after reset.
pub(crate) fn amplify_by_16(op_amp: Opamp, inside: bool) {
    op_amp.csr().write(|w| {
        w.set_opahsm(true);
        w.set_vp_sel(VpSel::from_bits(0));
        w.set_vm_sel(VmSel::PGA);
        w.set_pga_gain(PgaGain::GAIN16_INPUT_VINM0);
        w.set_opaintoen(inside);
        w.set_opampen(true);
    });
}
