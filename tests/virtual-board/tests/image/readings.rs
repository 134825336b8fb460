//! The image reads the truth even where the chip or the board is less than ideal. Run with `--release`.

use mavlink::dialects::ardupilotmega::ESC_INFO_DATA;
use siskin_firmware::circuit::b_g431b_esc1::{BOARD, ZERO_COUNTS};
use siskin_params::ParamId;

use crate::common::{Board, MS, Throttle, US, image};

/// Converter and rank of the currents of a, b and c.
const CURRENTS: [(usize, usize); 3] = [(0, 0), (1, 0), (0, 1)];

/// Returns the mean current into the motor that the phases' readings show without any current, A.
fn shown_a(board: &mut Board) -> [f64; 3] {
    const PERIODS: u32 = 200;
    let mut sums = [0; 3];
    for _ in 0..PERIODS {
        board.run(50 * US);
        let readings = board.world().injected();
        for (sum, (converter, rank)) in sums.iter_mut().zip(CURRENTS) {
            *sum += ZERO_COUNTS - i32::from(readings[converter][rank]);
        }
    }
    sums.map(|sum| f64::from(sum) / f64::from(PERIODS) * f64::from(BOARD.current_a_per_count))
}

/// Under load the shunts' grounds are a few mV above the chip's: a tenth of a millivolt per ampere, or
/// more.
#[test]
fn a_shift_of_the_shunts_grounds_is_no_current() {
    let mut board = Board::new(&image(), &[]);
    board.run(60 * MS);
    for grounds_v in [[0.0; 3], [0.005; 3], [0.01, -0.01, 0.0]] {
        board.world().shift_grounds(grounds_v);
        let shown = shown_a(&mut board);
        println!("{grounds_v:?} V: {shown:.2?} A");
        // The rounding to counts, and 0.014 A/mV left by the resistor to the supply.
        assert!(shown.iter().all(|a| a.abs() < 0.2), "{shown:?}");
    }
}

/// ES0431 2.5.8: a regular conversion next to injected ones may convert channel 0; the more of them there
/// are, and the more often the reading task is held up, the more often.
#[test]
fn the_thermistor_is_read_beside_the_currents() {
    for (pwm_hz, throttle) in [(24_000.0, Throttle::Silent), (48_000.0, Throttle::Dshot(0))] {
        the_thermistor_is_read(pwm_hz, throttle);
    }
}

fn the_thermistor_is_read(pwm_hz: f32, throttle: Throttle) {
    let mut board = Board::new(&image(), &[(ParamId::PwmFreqHz, pwm_hz)]);
    board.throttle = throttle;
    board.world().mislead_converters();
    board.run(2_500 * MS);
    let infos = board.heard.messages::<ESC_INFO_DATA>();
    assert!(!infos.is_empty());
    for (at, info) in infos {
        let centi_c = info.temperature[0];
        assert!((2_400..2_600).contains(&centi_c), "{centi_c} at {at} ns");
    }
    let texts = board.heard.texts();
    assert!(
        !texts.iter().any(|text| text.contains("temperature")),
        "{texts:?}"
    );
}
