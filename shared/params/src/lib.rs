//! The parameters: their table, a value of each, and what follows from the motor and the board.
//!
//! A value outside its row of the [`TABLE`] is refused. Where one is not known or 0, another follows from the motor:
//!
//! ```
//! use siskin_params::{BOSSO_MOTOR, ParamId, Params, SetError};
//!
//! let mut params = Params::of(&BOSSO_MOTOR);
//! assert_eq!(params.set(ParamId::MotPolePairs, 6.5), Err(SetError::NotWhole));
//! params.set(ParamId::PwmFreqHz, 0.0).expect("in range");
//! assert_eq!(params.in_force().get(ParamId::PwmFreqHz), 24_000.0);
//! ```
//!
//! [`parts`] are what an image may leave out of the drive, each a feature of this crate; a [`choice`] whose part is left
//! out is kept, and another is in force. [`metadata`] is the table as ground stations read it.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod assumed;
mod board;
pub mod checksum;
mod delay;
mod fit;
mod from_motor;
pub mod metadata;
mod packed;
pub mod parts;
mod preset;
mod pwm;
mod table;
mod values;

pub use assumed::POLE_PAIRS;
pub use board::{Board, Greatest, Image, LeastDeadTime, PwmBound, Shunts, TRIP_SHARE};
pub use delay::Delay;
pub use from_motor::{FromMotor, LEAST_SHARE};
pub use preset::{BOSSO_BENCH, BOSSO_MOTOR, BOSSO_TABLE_III, PRESETS, Preset, RACING};
pub use pwm::BUS_UNITS_MIN;
pub use table::{Choice, Kind, ParamId, Parameter, TABLE, Text, choice};
pub use values::{Params, SetError};
