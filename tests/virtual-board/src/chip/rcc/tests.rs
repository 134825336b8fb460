use super::*;
use crate::chip::Signal;

fn write(rcc: &mut Rcc, offset: u32, value: u32) -> Result<Vec<Signal>, Unmodelled> {
    write_at(0, rcc, offset, value)
}

fn write_at(
    now: Cycles,
    rcc: &mut Rcc,
    offset: u32,
    value: u32,
) -> Result<Vec<Signal>, Unmodelled> {
    let mut signals = Vec::new();
    let mut context = Context {
        now,
        signals: &mut signals,
    };
    rcc.write(offset, value, &mut context)?;
    Ok(signals)
}

fn read(rcc: &mut Rcc, offset: u32) -> u32 {
    let mut signals = Vec::new();
    let mut context = Context {
        now: 0,
        signals: &mut signals,
    };
    rcc.read(offset, &mut context).unwrap()
}

const BOOST: Supply = Supply {
    boost: true,
    wait_states: 4,
};

/// PLLM 4, PLLN 85, PLLR 2 with its output on, from HSI.
const PLL: u32 = 1 << 24 | 85 << 8 | 3 << 4 | 2;

/// Half of the PLL's clock.
const HALF: u32 = 8 << 4 | 3;

fn with_pll() -> Rcc {
    let mut rcc = Rcc::new();
    write(&mut rcc, 0x0c, PLL).unwrap();
    write(&mut rcc, 0x00, 1 << 24 | 0x500).unwrap();
    rcc
}

fn at_170_mhz() -> Rcc {
    let mut rcc = with_pll();
    write(&mut rcc, 0x08, HALF).unwrap();
    write_at(170, &mut rcc, 0x08, 3).unwrap();
    rcc
}

#[test]
fn the_last_half_of_170_mhz_comes_a_microsecond_after_the_first() {
    let step = Err(ClockError::Step {
        clock_hz: 170_000_000,
    });
    let mut rcc = with_pll();
    write(&mut rcc, 0x08, 3).unwrap();
    assert_eq!(rcc.clock_hz(BOOST), step);

    let mut rcc = with_pll();
    write_at(1000, &mut rcc, 0x08, HALF).unwrap();
    assert_eq!(rcc.clock_hz(BOOST), Ok(85_000_000));
    write_at(1169, &mut rcc, 0x08, 3).unwrap();
    assert_eq!(rcc.clock_hz(BOOST), step);
    // From HSI again.
    write_at(2000, &mut rcc, 0x08, 1).unwrap();
    write_at(2000, &mut rcc, 0x08, HALF).unwrap();
    write_at(2170, &mut rcc, 0x08, 3).unwrap();
    assert_eq!(rcc.clock_hz(BOOST), Ok(170_000_000));
}

#[test]
fn the_clock_is_170_mhz_with_boost_and_four_wait_states() {
    let mut rcc = Rcc::new();
    let slow = Supply {
        boost: false,
        wait_states: 0,
    };
    assert_eq!(rcc.clock_hz(slow), Ok(16_000_000));
    assert_eq!(write(&mut rcc, 0x08, 3), Err(Unmodelled), "no PLL yet");

    let mut rcc = at_170_mhz();
    assert_eq!(read(&mut rcc, 0x00), 0x0300_0500);
    assert_eq!(read(&mut rcc, 0x08), 0b1111);
    assert_eq!(rcc.clock_hz(BOOST), Ok(170_000_000));
    let clock_hz = 170_000_000;
    assert_eq!(
        rcc.clock_hz(Supply {
            boost: false,
            ..BOOST
        }),
        Err(ClockError::Core {
            clock_hz,
            greatest_hz: 150_000_000
        })
    );
    assert_eq!(
        rcc.clock_hz(Supply {
            wait_states: 3,
            ..BOOST
        }),
        Err(ClockError::Flash {
            clock_hz,
            wait_states: 3,
            needed: 4
        })
    );
    // Half of it by AHB's prescaler.
    write(&mut rcc, 0x08, HALF).unwrap();
    assert_eq!(rcc.clock_hz(BOOST), Ok(85_000_000));
}

#[test]
fn a_pll_beyond_its_range_is_told() {
    let mut rcc = Rcc::new();
    // 4 MHz times 87 is 348 MHz.
    write(&mut rcc, 0x0c, 1 << 24 | 87 << 8 | 3 << 4 | 2).unwrap();
    write(&mut rcc, 0x00, 1 << 24 | 0x500).unwrap();
    write(&mut rcc, 0x08, 3).unwrap();
    let error = rcc.clock_hz(BOOST).unwrap_err();
    assert!(error.to_string().contains("348000000"), "{error}");
}

#[test]
fn what_runs_is_not_changed_and_other_oscillators_are_refused() {
    let mut rcc = at_170_mhz();
    for (offset, value) in [
        (0x0c, PLL ^ 1 << 8),
        (0x00, 0x500),
        (0x00, 1 << 24),
        (0x00, 1 << 24 | 1 << 16 | 0x500),
        (0x08, 2),
        (0x08, 4 << 8 | 3),
        (0x88, 2),
        (0x10, 0),
    ] {
        let written = write(&mut rcc, offset, value);
        assert_eq!(written, Err(Unmodelled), "{offset:#x} {value:#x}");
    }
    write(&mut rcc, 0x88, 2 << 28 | 0b0101).unwrap();
    assert_eq!(rcc.sources().adc12sel(), Adcsel::SYS);
}

#[test]
fn a_part_has_its_clock_when_it_is_enabled() {
    let mut rcc = Rcc::new();
    let [tim1, opamp, pwr] = [0x4001_2c44, 0x4001_0308, 0x4000_7080];
    assert!([tim1, opamp, pwr].iter().all(|at| !rcc.has_clock(*at)));
    // RCC, IWDG and the flash's registers.
    assert!(
        [0x4002_1000, 0x4000_3000, 0x4002_2000]
            .iter()
            .all(|at| rcc.has_clock(*at))
    );
    write(&mut rcc, 0x60, 1 << 11).unwrap();
    assert!(rcc.has_clock(tim1) && !rcc.has_clock(opamp));
    write(&mut rcc, 0x60, 1).unwrap();
    assert!(!rcc.has_clock(tim1) && rcc.has_clock(opamp));
    assert_eq!(read(&mut rcc, 0x58), 1 << 10);
    write(&mut rcc, 0x58, 1 << 28).unwrap();
    assert!(rcc.has_clock(pwr));
}

#[test]
fn a_reset_bit_resets_its_part_once() {
    let mut rcc = Rcc::new();
    let signals = write(&mut rcc, 0x40, 1 << 11 | 1).unwrap();
    let wanted = [Signal::ResetPart(0x40, 0), Signal::ResetPart(0x40, 11)];
    assert_eq!(signals, wanted);
    assert_eq!(read(&mut rcc, 0x40), 1 << 11 | 1);
    assert_eq!(write(&mut rcc, 0x40, 1 << 11).unwrap(), []);
    assert_eq!(write(&mut rcc, 0x40, 0).unwrap(), []);
    let again = write(&mut rcc, 0x40, 1).unwrap();
    assert_eq!(again, [Signal::ResetPart(0x40, 0)]);
}

#[test]
fn causes_add_up_until_they_are_removed() {
    let mut rcc = at_170_mhz();
    let [pin, power, software, watchdog] = [26, 27, 28, 29].map(|bit| 1 << bit);
    assert_eq!(read(&mut rcc, 0x94), pin | power);
    rcc.reset(Cause::Watchdog);
    assert_eq!(read(&mut rcc, 0x94), pin | power | watchdog);
    assert_eq!(read(&mut rcc, 0x08), 0b0101, "HSI again");
    write(&mut rcc, 0x94, 1 << 23 | 1).unwrap();
    assert_eq!(read(&mut rcc, 0x94), 1 << 23 | 0b11);
    rcc.reset(Cause::Software);
    assert_eq!(read(&mut rcc, 0x94), pin | software);
    rcc.reset(Cause::Power);
    assert_eq!(read(&mut rcc, 0x94), pin | power);
}

#[test]
fn the_backup_domain_is_locked_and_outlives_resets_but_not_the_power() {
    let mut rcc = Rcc::new();
    let lsi = 1 << 15 | 2 << 8;
    assert_eq!(write(&mut rcc, 0x90, lsi), Err(Unmodelled));
    rcc.open_backup(true);
    write(&mut rcc, 0x90, lsi).unwrap();
    rcc.reset(Cause::Software);
    assert_eq!(read(&mut rcc, 0x90), lsi);
    assert_eq!(write(&mut rcc, 0x90, lsi), Err(Unmodelled), "locked again");
    rcc.open_backup(true);
    // No other clock without resetting the domain.
    write(&mut rcc, 0x90, 0).unwrap();
    assert_eq!(read(&mut rcc, 0x90), 2 << 8);
    write(&mut rcc, 0x90, 1 << 16 | lsi).unwrap();
    write(&mut rcc, 0x90, 0).unwrap();
    assert_eq!(read(&mut rcc, 0x90), 0);
    write(&mut rcc, 0x90, lsi).unwrap();
    rcc.reset(Cause::Power);
    assert_eq!(read(&mut rcc, 0x90), 0);
}
