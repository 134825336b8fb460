//! Settings of the throttle wire, from the parameters.

use siskin_throttle::Settings;
use siskin_throttle::authority::Timing;
use siskin_throttle::demand::Reading;
use siskin_throttle::endpoints::EndPoints;
use siskin_throttle::signal::Signal;

use crate::params::choice::Inp3d;
use crate::params::{ParamId, Params};

/// Returns how the throttle wire is read.
pub fn input(params: &Params) -> Settings {
    let time_us = |id| u64::from((params.get(id) * 1000.0) as u32);
    let width_us = |id| params.get(id) as u16;
    Settings {
        protocol: Signal::from_number(params.number(ParamId::InpProto)),
        timing: Timing {
            arm_us: time_us(ParamId::InpArmMs),
            loss_us: time_us(ParamId::InpLossMs),
        },
        reading: Reading {
            two_directions: params.chosen(Inp3d::On),
            ends: EndPoints {
                min_us: width_us(ParamId::InpPulseMinUs),
                max_us: width_us(ParamId::InpPulseMaxUs),
            },
        },
    }
}
