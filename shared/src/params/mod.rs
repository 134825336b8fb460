//! Parameters: the table, the values, and the configuration built from them.

mod assumed;
mod board;
mod build;
mod fit;
mod from_motor;
mod packed;
mod preset;
mod pwm;
mod table;
mod values;

pub(crate) use assumed::POLE_PAIRS;
pub(crate) use board::TRIP_SHARE;
pub use board::{Board, Greatest, LeastDeadTime, PwmBound};
pub use build::{BuildError, FluxSettings, build, build_in, input, scale};
pub(crate) use build::{lost_periods, test_current, thresholds, unbalance_max};
pub use from_motor::FromMotor;
pub use preset::{BOSSO_BENCH, BOSSO_MOTOR, BOSSO_TABLE_III, PRESETS, Preset};
pub use table::{Choice, Kind, ParamId, Parameter, TABLE, Text, choice};
pub use values::{Params, SetError};
