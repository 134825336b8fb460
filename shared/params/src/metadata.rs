//! The parameters' metadata as ground stations read it: general and parameter metadata of MAVLink's component metadata
//! protocol, made from the table by the build script.

/// The general metadata, JSON compressed by xz.
pub const GENERAL: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/general.json.xz"));

/// The metadata of all parameters, JSON compressed by xz.
pub const PARAMETER: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/parameter.json.xz"));

/// The metadata of all parameters as JSON, for programs that have the table at hand. No image holds it: what is served
/// is compressed.
pub const PARAMETER_METADATA: &str = include_str!(concat!(env!("OUT_DIR"), "/parameter.json"));
