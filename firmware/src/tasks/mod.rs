//! Tasks around the control interrupt.
//!
//! | task | does | where |
//! |---|---|---|
//! | `throttle::listen` | edges into set-points and answers | its own executor, above the others |
//! | `main`, by [`MainTask::attend`] | the ESC: MAVLink in, telemetry, storage, health, light, watchdog | thread mode |
//! | `mavlink::transmit` | MAVLink out | thread mode |
//! | `kiss::transmit` | telemetry on the serial line | thread mode |

mod clock;
pub(crate) mod health;
pub(crate) mod kiss;
pub(crate) mod light;
pub(crate) mod mavlink;
mod start;
pub(crate) mod supervisor;
pub(crate) mod throttle;
pub(crate) mod trouble;

pub use mavlink::MainTask;
pub use start::{Fit, power_up, start};
