//! The throttle wire's news in words.

use mavlink::dialects::ardupilotmega::MavSeverity;
use siskin_throttle::News;
use siskin_throttle::calibration::Step;

/// Returns severity and text of news, in two pieces; `None` for news that only a tune announces.
pub(super) fn words(news: News) -> Option<(MavSeverity, [&'static str; 2])> {
    Some(match news {
        News::Identified(signal) => (
            MavSeverity::MAV_SEVERITY_INFO,
            ["Throttle: ", signal.name()],
        ),
        News::Lost { armed: true } => (
            MavSeverity::MAV_SEVERITY_WARNING,
            ["Throttle: signal lost", " while armed"],
        ),
        News::Lost { armed: false } => (
            MavSeverity::MAV_SEVERITY_NOTICE,
            ["Throttle: signal lost", ""],
        ),
        News::Unknown => (
            MavSeverity::MAV_SEVERITY_WARNING,
            ["Throttle: ", "unknown signal"],
        ),
        News::OpenThrottle => (
            MavSeverity::MAV_SEVERITY_WARNING,
            ["Throttle is open: lower it to arm", ""],
        ),
        News::Calibration(step) => (
            MavSeverity::MAV_SEVERITY_NOTICE,
            [
                "Stick calibration: ",
                match step {
                    Step::Full => "full taken, now lower it",
                    Step::Done(_) => "both ends taken",
                    Step::Again => "lower it to identify",
                    Step::Identify => "over",
                    Step::Cancelled => "given up",
                },
            ],
        ),
        News::Armed => return None,
    })
}
