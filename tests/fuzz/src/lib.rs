//! Shared code of the fuzz targets. Each takes any bytes and knows what may come of them; see `targets`,
//! and `run`, which builds and runs them.
#![forbid(unsafe_code)]

pub mod bytes;
pub mod desk;
