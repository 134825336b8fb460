//! Numbers, in JSON and for people.

use serde_json::Value;

/// Returns the number with the digits of a 32-bit value: 30.6, where widening would print
/// 30.600000381469727. Non-finite values are null, and what rounding has left of a zero is 0.
pub(crate) fn number(value: f32) -> Value {
    let value = zeroed(value);
    value
        .to_string()
        .parse::<f64>()
        .map_or(Value::Null, Value::from)
}

/// Returns the value, or 0 in place of a negative zero and of a number that is none of a measurement: a filter that
/// decays towards zero ends in subnormal ones.
pub(crate) fn zeroed(value: f32) -> f32 {
    if value.is_normal() || !value.is_finite() {
        value
    } else {
        0.0
    }
}

/// Formats a number with this many decimals; what rounds to zero has no sign.
pub(crate) fn fixed(value: impl Into<f64>, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.into());
    match text.strip_prefix('-') {
        Some(digits)
            if !digits
                .bytes()
                .any(|byte| matches!(byte, b'1'..=b'9' | b'i' | b'N')) =>
        {
            digits.to_owned()
        }
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        for (value, decimals, text) in [
            (-0.004, 2, "0.00"),
            (-0.006, 2, "-0.01"),
            (-0.4, 0, "0"),
            (-10.0, 1, "-10.0"),
            (f64::NEG_INFINITY, 1, "-inf"),
        ] {
            assert_eq!(fixed(value, decimals), text);
        }
    }

    #[test]
    fn numbers_keep_their_short_form() {
        assert_eq!(number(30.6).to_string(), "30.6");
        assert_eq!(number(12.0).to_string(), "12.0");
        for nothing in [-0.0, -1.4e-43, 1e-40] {
            assert_eq!(number(nothing).to_string(), "0.0", "{nothing:e}");
        }
        assert_eq!(number(f32::NAN), Value::Null);
        assert_eq!(number(f32::INFINITY), Value::Null);
    }
}
