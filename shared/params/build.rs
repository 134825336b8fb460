//! Makes the metadata that ground stations read over MAVLink out of the table of parameters: general
//! and parameter metadata of MAVLink's component metadata protocol, as JSON, compressed by xz.
//!
//! The schemas are `component_metadata/general.schema.json` and `parameter.schema.json` of
//! <https://github.com/mavlink/mavlink>. Both files are of version 1: the second schema asks for 3 or
//! more, but QGroundControl takes no other than 1 (`CompInfoParam::setJson`), and PX4's are of that.

use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::path::Path;
use std::{env, fs};

use lzma_rust2::{CheckType, XzOptions, XzWriter};
use table::{Kind, ParamId, TABLE};

#[allow(unreachable_pub, reason = "as for the table")]
#[path = "src/checksum.rs"]
mod checksum;

#[allow(dead_code, unreachable_pub, reason = "as for the table")]
#[path = "src/parts.rs"]
mod parts;

#[allow(
    dead_code,
    unreachable_pub,
    reason = "the crate's own file, of which this reads a part"
)]
#[path = "src/table.rs"]
mod table;

/// `COMP_METADATA_TYPE_PARAMETER`.
const PARAMETER: u8 = 1;

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/table.rs");
    println!("cargo::rerun-if-changed=src/checksum.rs");
    println!("cargo::rerun-if-changed=src/parts.rs");
    let folder = env::var_os("OUT_DIR").expect("cargo sets it");
    let folder = Path::new(&folder);
    let parameters = parameters();
    let parameter = compress(&parameters)?;
    let general = compress(&general(checksum::checksum(0, &parameter)))?;
    fs::write(folder.join("parameter.json"), parameters)?;
    fs::write(folder.join("parameter.json.xz"), parameter)?;
    fs::write(folder.join("general.json.xz"), general)
}

/// What there is: the parameter metadata, by its place and checksum.
fn general(checksum: u32) -> String {
    let version = env!("CARGO_PKG_VERSION");
    format!(
        "{{\"version\":1,\"vendorName\":\"Siskin\",\"modelName\":\"Siskin ESC\",\
         \"firmwareVersion\":\"{version}\",\"metadataTypes\":[{{\"type\":{PARAMETER},\
         \"uri\":\"mftp:///parameter.json.xz\",\"fileCrc\":{checksum}}}]}}"
    )
}

/// Every parameter. The type is that of the wire, where all are floats.
fn parameters() -> String {
    let all: Vec<_> = ParamId::ALL.into_iter().map(parameter).collect();
    format!("{{\"version\":1,\"parameters\":[{}]}}", all.join(","))
}

fn parameter(id: ParamId) -> String {
    let (entry, text) = (&TABLE[id as usize], id.text());
    let mut fields = Fields(String::new());
    // What many have in common stands together, which xz shortens most.
    fields.text("type", "Float");
    fields.text(
        "group",
        if text.is_used() {
            group(entry.name)
        } else {
            "Not in this image"
        },
    );
    fields.text("name", entry.name);
    if !text.unit.is_empty() {
        fields.text("units", text.unit);
    }
    let least = entry.kind.zero().map_or(entry.min, |_| 0.0);
    fields.bare("min", least);
    fields.bare("max", entry.max);
    if entry.kind == Kind::Derived {
        fields.bare("readOnly", true);
    } else {
        fields.bare("default", entry.default);
    }
    if matches!(entry.kind, Kind::Whole | Kind::Order) {
        fields.bare("decimalPlaces", 0);
    }
    if entry.kind == Kind::Order {
        fields.bare("volatile", true);
    }
    if text.restart {
        fields.bare("rebootRequired", true);
    }
    fields.text("shortDesc", text.description);
    if !text.choices.is_empty() {
        let choice = |(value, meaning): &(u8, &str)| {
            let mut fields = Fields(String::new());
            fields.bare("value", value);
            fields.text("description", meaning);
            fields.object()
        };
        let here = |(value, _): &&(u8, &str)| !id.lacks(f32::from(*value));
        let choices: Vec<_> = text.choices.iter().filter(here).map(choice).collect();
        fields.bare("values", format_args!("[{}]", choices.join(",")));
    }
    fields.object()
}

/// What a ground station shows above the parameters of a group.
fn group(name: &str) -> &'static str {
    match name.split('_').next() {
        Some("MAV") => "MAVLink",
        Some("MOT") => "Motor",
        Some("CTL") => "Control",
        Some("PWM") => "PWM",
        Some("INP") => "Throttle",
        Some("LIM") => "Limits",
        Some("STA") => "Start",
        Some("TEL") => "Telemetry",
        _ => panic!("build.rs has no group for {name}"),
    }
}

/// The fields of an object.
struct Fields(String);

impl Fields {
    fn text(&mut self, name: &str, text: &str) {
        let plain = |letter: char| letter.is_ascii_graphic() || letter == ' ';
        assert!(
            text.chars().all(plain) && !text.contains(['"', '\\']),
            "not to be written as it is: {text}"
        );
        self.bare(name, format_args!("\"{text}\""));
    }

    fn bare(&mut self, name: &str, value: impl Display) {
        let comma = if self.0.is_empty() { "" } else { "," };
        write!(self.0, "{comma}\"{name}\":{value}").expect("a string takes everything");
    }

    fn object(self) -> String {
        format!("{{{}}}", self.0)
    }
}

/// The same bytes on every machine. XZ Embedded, which ground stations unpack it with, knows CRC-32.
fn compress(text: &str) -> io::Result<Vec<u8>> {
    let mut options = XzOptions::with_preset(9);
    options.set_check_sum_type(CheckType::Crc32);
    options.lzma_options.dict_size = 1 << 16;
    // A text is not aligned.
    options.lzma_options.pb = 0;
    options.lzma_options.nice_len = 273;
    let mut writer = XzWriter::new(Vec::new(), options)?;
    writer.write_all(text.as_bytes())?;
    writer.finish()
}
