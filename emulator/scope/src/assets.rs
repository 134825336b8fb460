//! The files of the page. Each is in the program.

use siskin_params::metadata::PARAMETER_METADATA;

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";
const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";

macro_rules! files {
    ($($path:literal $kind:ident $file:literal),* $(,)?) => {
        &[$(($path, $kind, include_str!(concat!("../page/", $file)))),*]
    };
}

/// Path, type and content.
static FILES: &[(&str, &str, &str)] = files! {
    "/" HTML "index.html",
    "/style.css" CSS "style.css",
    "/icon.svg" SVG "icon.svg",
    "/scope.js" JS "scope.js",
    "/socket.js" JS "socket.js",
    "/mavlink.js" JS "mavlink.js",
    "/esc.js" JS "esc.js",
    "/fleet.js" JS "fleet.js",
    "/switches.js" JS "switches.js",
    "/motor.js" JS "motor.js",
    "/records.js" JS "records.js",
    "/remote.js" JS "remote.js",
    "/samples.js" JS "samples.js",
    "/plots.js" JS "plots.js",
    "/envelope.js" JS "envelope.js",
    "/traces.js" JS "traces.js",
    "/phasor.js" JS "phasor.js",
    "/tiles.js" JS "tiles.js",
    "/throttle.js" JS "throttle.js",
    "/lab.js" JS "lab.js",
    "/texts.js" JS "texts.js",
    "/tests.js" JS "tests.js",
    "/parameters.js" JS "parameters.js",
    "/export.js" JS "export.js",
    "/uplot/uPlot.iife.min.js" JS "uplot/uPlot.iife.min.js",
    "/uplot/uPlot.min.css" CSS "uplot/uPlot.min.css",
    "/uplot/LICENSE" TEXT "uplot/LICENSE",
};

/// The type and the content of what a path names.
pub(crate) fn find(path: &str) -> Option<(&'static str, &'static str)> {
    if path == "/parameters.json" {
        return Some((JSON, PARAMETER_METADATA));
    }
    let mut files = FILES.iter();
    let (_, kind, content) = files.find(|(name, ..)| *name == path)?;
    Some((kind, content))
}
