//! How long the interrupt takes in each mode, up to the highest PWM frequency that is accepted. Run with `--release`.

use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavCmd, MavResult};
use siskin_emulator::fault::InForce;
use siskin_firmware::circuit::b_g431b_esc1::BOARD;
use siskin_params::{ParamId, PwmBound};
use siskin_vboard::image::Image;
use siskin_vboard::load::Figures;
use siskin_vboard::time::CLOCK_HZ;

use crate::common::{Board, MS, Throttle, image, papers};

/// Most of a period that the longest interrupt of the image for flying may take.
const FLIGHT_SHARE: f64 = 0.7;

/// Periods of an identification that take over other units, with the bridge off: they may be late, which delays no duty.
const UNITS_PERIODS: u64 = 4;

/// Likewise of a choice at its own bound.
const BOUND_SHARE: f64 = 0.85;

/// PWM frequencies below the highest, Hz: the factory's, and twice that.
const FREQUENCIES_HZ: [f32; 2] = [24_000.0, 48_000.0];

type Setting = (ParamId, f32);

const COAST: Setting = (ParamId::MotStop, 0.0);
const BOTH_WAYS: Setting = (ParamId::Inp3d, 1.0);
const VOLTAGE: Setting = (ParamId::CtlMode, 2.0);
const SIX_STEP: Setting = (ParamId::CtlDrive, 1.0);
/// Slow enough for four periods per sextant at the lowest frequency.
const SLOW: Setting = (ParamId::CtlRpmMax, 4_500.0);
/// Nothing known of the motor, as delivered.
const UNKNOWN: [Setting; 4] = [
    (ParamId::MotRMohm, 0.0),
    (ParamId::MotLUh, 0.0),
    (ParamId::MotFluxMwb, 0.0),
    (ParamId::MotJGcm2, 0.0),
];

/// DShot's command for the first tone.
const BEEP: u16 = 1;

/// A supply far below what the drive needs.
fn sagged() -> InForce {
    InForce {
        sag_v: 20.0,
        ..InForce::default()
    }
}

/// What is played, and measured piece by piece.
struct Play {
    board: Board,
    period: f64,
    rows: Vec<(&'static str, Figures)>,
}

impl Play {
    fn new(image: &Image, settings: &[Setting], pwm_hz: f32) -> Self {
        let own = [(ParamId::InpArmMs, 50.0), (ParamId::PwmFreqHz, pwm_hz)];
        Self {
            board: Board::new(image, &[&own[..], settings].concat()),
            period: CLOCK_HZ as f64 / f64::from(pwm_hz),
            rows: Vec::new(),
        }
    }

    /// Measures what happens meanwhile.
    fn piece<T>(&mut self, name: &'static str, play: impl FnOnce(&mut Board) -> T) -> T {
        let now = self.board.now();
        self.board.world().load.begin(now);
        let result = play(&mut self.board);
        let figures = self.board.board.figures().expect("interrupts");
        self.rows.push((name, figures));
        result
    }

    fn throttle(&mut self, name: &'static str, throttle: u16, for_ms: u64) {
        self.piece(name, |board| {
            board.throttle = Throttle::Dshot(throttle);
            board.run(for_ms * MS);
        });
    }

    /// Plays from power-up to a stop and a start of the turning motor; asserts that it turns.
    fn flight(&mut self, both_ways: bool) {
        let [half, full, low] = if both_ways {
            [1_548, 2_047, 1_300]
        } else {
            [1_048, 2_047, 500]
        };
        self.throttle("rest", 0, 400);
        self.throttle("tone", BEEP, 150);
        self.throttle("rest", 0, 300);
        self.turns("start", half);
        for (name, throttle) in [
            ("half throttle", half),
            ("full throttle", full),
            ("low throttle", low),
        ] {
            self.turns(name, throttle);
        }
        self.throttle("stop", 0, 60);
        self.turns("again", half);
        if both_ways {
            self.turns("reversal", 548);
        }
        self.piece("under-voltage and retry", |board| {
            let (sound, sagged) = (InForce::default(), sagged());
            board.world().bench().disturb(&sound, &sagged);
            board.run(20 * MS);
            board.world().bench().disturb(&sagged, &sound);
            board.run(500 * MS);
        });
        let texts = self.board.heard.texts();
        assert!(
            texts.iter().any(|text| text.contains("under-voltage")),
            "{texts:?}"
        );
        self.throttle("stop to rest", 0, 1_500);
    }

    /// Measures a throttle; asserts that it drives the motor, below the middle of two directions backwards.
    fn turns(&mut self, name: &'static str, throttle: u16) {
        let sign = if name == "reversal" { -1.0 } else { 1.0 };
        self.piece(name, |board| {
            board.throttle = Throttle::Dshot(throttle);
            board.run_until(10 * MS, 6_000 * MS, |board| sign * board.rpm() > 500.0);
            board.run(200 * MS);
            let driven = sign * board.rpm() > 500.0 && !board.world().bridge().is_off();
            assert!(
                driven,
                "{name}: {} rpm, {:?}",
                board.rpm(),
                board.heard.texts()
            );
        });
    }

    /// Prints a row: median and most cycles. Returns the most as a share of a period.
    fn share(&self, what: &str, (name, figures): &(&str, Figures)) -> f64 {
        let Figures {
            cycles_median,
            cycles_most,
            ..
        } = figures;
        let share = *cycles_most as f64 / self.period;
        println!("{what:<34}{name:<24}{cycles_median:>6}{cycles_most:>6}  {share:.2}");
        share
    }

    /// Prints the table; returns the greatest share of a period. Asserts that it has played what it names.
    fn end(self, what: &str) -> f64 {
        let texts = self.board.heard.texts();
        let stopped = texts.iter().any(|text| text.contains("too slow"));
        assert!(!stopped, "{what}: {texts:?}");
        let shares = self.rows.iter().map(|row| self.share(what, row));
        shares.fold(0.0, f64::max)
    }
}

/// Returns the frequencies to play: the factory's, and those above it up to the bound.
fn frequencies_hz(settings: &[Setting]) -> Vec<f32> {
    let six_step = settings
        .iter()
        .any(|setting| UNKNOWN.contains(setting) || *setting == SIX_STEP);
    let bound_hz = bound_hz((ParamId::CtlDrive, if six_step { 1.0 } else { 0.0 }));
    let below = FREQUENCIES_HZ.into_iter().filter(|hz| *hz < bound_hz);
    below.chain([bound_hz]).collect()
}

/// Returns the highest frequency that the board accepts with a choice.
fn bound_hz(choice: Setting) -> f32 {
    let find = |choice| BOARD.pwm_bounds.iter().find(|bound| bound.choice == choice);
    // What has none of its own has the field-oriented drive's.
    let bound = find(choice).or_else(|| find((ParamId::CtlDrive, 0.0)));
    bound.map_or(ParamId::PwmFreqHz.entry().max, |PwmBound { hz, .. }| *hz)
}

/// Plays a drive of the image for flying at these frequencies.
fn flies(what: &str, settings: &[Setting], frequencies_hz: &[f32]) {
    let both_ways = settings.contains(&BOTH_WAYS);
    let mut greatest = 0.0_f64;
    for pwm_hz in frequencies_hz {
        let mut play = Play::new(&image(), settings, *pwm_hz);
        play.flight(both_ways);
        greatest = greatest.max(play.end(&format!("{what}, {} kHz", pwm_hz / 1e3)));
    }
    assert!(greatest < FLIGHT_SHARE, "{what}: {greatest:.3}");
}

/// What a period takes hardly depends on how many there are in a second: the variants play at the highest.
#[test]
fn the_default_drive_fits_at_any_frequency() {
    let frequencies_hz = frequencies_hz(&[]);
    let highest = &frequencies_hz[frequencies_hz.len() - 1..];
    flies("default", &[], &frequencies_hz);
    flies("default, coasting", &[COAST], highest);
    flies("default, both ways", &[BOTH_WAYS], highest);
    flies("default, voltage mode", &[VOLTAGE], highest);
}

#[test]
fn the_six_step_drive_fits_at_any_frequency() {
    let frequencies_hz = frequencies_hz(&[SIX_STEP]);
    let highest = &frequencies_hz[frequencies_hz.len() - 1..];
    flies("six-step", &[SIX_STEP, SLOW], &frequencies_hz);
    flies("six-step, coasting", &[SIX_STEP, SLOW, COAST], highest);
    flies("six-step, both ways", &[SIX_STEP, SLOW, BOTH_WAYS], highest);
    flies("motor unknown", &UNKNOWN, highest);
}

/// Plays a command until its last answer.
fn commanded(play: &mut Play, name: &'static str, command: MavCmd, param1: f32) {
    let result = play.piece(name, |board| {
        board.heard.frames.clear();
        board.command(command, param1);
        let mut result = None;
        board.run_until(20 * MS, 20_000 * MS, |board| {
            let acks = board.heard.messages::<COMMAND_ACK_DATA>();
            result = acks.last().map(|(_, ack)| ack.result);
            !matches!(result, None | Some(MavResult::MAV_RESULT_IN_PROGRESS))
        });
        result
    });
    let texts = play.board.heard.texts();
    assert_eq!(result, Some(MavResult::MAV_RESULT_ACCEPTED), "{texts:?}");
}

/// Identification tries a motor in the six-step drive, and its bound holds for any motor.
#[test]
fn self_test_and_identification_fit_at_any_frequency() {
    let (mut greatest, pwm_hz) = (0.0_f64, bound_hz(SIX_STEP));
    for (motor, settings) in [("known", &[][..]), ("unknown", &UNKNOWN)] {
        let mut play = Play::new(&image(), settings, pwm_hz);
        play.throttle("rest", 0, 1_000);
        commanded(
            &mut play,
            "self-test",
            MavCmd::MAV_CMD_RUN_PREARM_CHECKS,
            0.0,
        );
        commanded(&mut play, "identification", MavCmd::MAV_CMD_USER_1, 1.0);
        let long = (FLIGHT_SHARE * play.period) as u64;
        let late = play.board.world().load.longer_than(long);
        assert!(late <= UNITS_PERIODS, "{late} periods above {long} cycles");
        let what = format!("motor {motor}, {} kHz", pwm_hz / 1e3);
        let identification = play.rows.pop().expect("it is the last");
        play.share(&what, &identification);
        greatest = greatest.max(play.end(&what));
    }
    assert!(greatest < FLIGHT_SHARE, "{greatest:.3}");
}

/// What may come on top of an observer, and takes more than what stands in its place otherwise.
const COSTLY: [Setting; 3] = [
    (ParamId::CtlRegulator, 2.0),
    (ParamId::CtlModulation, 1.0),
    (ParamId::CtlSpeed, 1.0),
];

const SPEED: Setting = (ParamId::CtlSpeed, 1.0);
const SINE: Setting = (ParamId::CtlModulation, 1.0);

/// All choices that only the image with the papers has, with what costs most besides; and its six-step drive.
const PAPERS: [(Setting, &[Setting]); 8] = [
    ((ParamId::CtlObserver, 0.0), &[(ParamId::CtlRegulator, 0.0)]),
    ((ParamId::CtlObserver, 0.0), &[]),
    ((ParamId::CtlObserver, 1.0), &COSTLY),
    ((ParamId::CtlObserver, 2.0), &COSTLY),
    ((ParamId::CtlRegulator, 0.0), &[SPEED, SINE]),
    ((ParamId::CtlRegulator, 2.0), &[SPEED, SINE]),
    ((ParamId::CtlAdaptL, 1.0), &[SPEED, SINE]),
    (SIX_STEP, &[SLOW]),
];

#[test]
fn what_the_papers_image_accepts_fits_too() {
    let image = papers();
    let mut greatest = 0.0_f64;
    for (choice, others) in PAPERS {
        let pwm_hz = bound_hz(choice);
        let mut play = Play::new(&image, &[&[choice], others].concat(), pwm_hz);
        play.flight(false);
        let what = format!(
            "{} {}, {} kHz",
            choice.0.entry().name,
            choice.1,
            pwm_hz / 1e3
        );
        greatest = greatest.max(play.end(&what));
    }
    assert!(greatest < BOUND_SHARE, "{greatest:.3}");
}
