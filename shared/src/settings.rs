//! Settings of the throttle wire, from the parameters.

use siskin_params::choice::Inp3d;
use siskin_params::{ParamId, Params};
use siskin_throttle::Settings;
use siskin_throttle::authority::Timing;
use siskin_throttle::demand::Reading;
use siskin_throttle::endpoints::EndPoints;
use siskin_throttle::signal::Signal;

/// Returns how the throttle wire is read.
pub(crate) fn of(params: &Params) -> Settings {
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

#[cfg(test)]
mod tests {
    use siskin_params::Board;

    use super::*;

    #[test]
    fn a_protocol_is_refused_unless_it_is_a_signal_or_any() {
        let choices = ParamId::InpProto.text().choices;
        for number in 0..=u8::MAX {
            let is_signal = number == 0 || Signal::from_number(number).is_some();
            let refusal = ParamId::InpProto.beyond(f32::from(number), &Board::BENCH);
            assert_eq!(refusal.is_none(), is_signal, "{number}");
            assert_eq!(
                choices.iter().any(|choice| choice.0 == number),
                is_signal,
                "{number}"
            );
        }
        assert_eq!(Signal::all().count() + 1, choices.len());
    }
}
