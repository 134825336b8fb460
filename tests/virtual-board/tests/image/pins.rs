//! How the image sets up the pins that wires from outside the board reach. Run with `--release`.

use siskin_vboard::processor::{Surroundings as _, Width};

use crate::common::{Board, MS, image};

/// Port B's registers (RM0440, 9.4): a pin's mode, output type and pull.
const MODER: u32 = 0x4800_0400;
const OTYPER: u32 = 0x4800_0404;
const PUPDR: u32 = 0x4800_040c;

const ALTERNATE: u32 = 0b10;
const PULLED_UP: u32 = 0b01;

/// The serial line's input, which ends in nothing once the ST-LINK's half of the board is broken off: noise would be
/// bytes.
#[test]
fn the_serial_input_rests_high_without_a_partner() {
    let mut board = Board::new(&image(), &[]);
    board.run(30 * MS);
    assert_eq!(two_bits(&mut board, MODER, 4), ALTERNATE);
    assert_eq!(two_bits(&mut board, PUPDR, 4), PULLED_UP);
}

/// The first Hall sensor's pin, which has the telemetry while no sensor is chosen: a sensor plugged in there pulls it
/// low by its open collector, and a high output would be a short through the sensor.
#[test]
fn telemetry_does_not_drive_high_against_a_hall_sensor() {
    let mut board = Board::new(&image(), &[]);
    board.run(30 * MS);
    assert_eq!(two_bits(&mut board, MODER, 6), ALTERNATE);
    assert_eq!(two_bits(&mut board, PUPDR, 6), PULLED_UP);
    let open_drains = read(&mut board, OTYPER);
    assert_eq!(open_drains & 1 << 6, 1 << 6, "{open_drains:#x}");
}

fn two_bits(board: &mut Board, register: u32, pin: u32) -> u32 {
    read(board, register) >> (2 * pin) & 0b11
}

fn read(board: &mut Board, register: u32) -> u32 {
    let read = board.world().read(register, Width::Word);
    read.expect("a register of the port")
}
