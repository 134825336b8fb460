//! Numbers in JSON.

use serde_json::Value;

/// Returns the number with the digits of a 32-bit value: 30.6, where widening would print
/// 30.600000381469727. Non-finite values are null.
pub(crate) fn number(value: f32) -> Value {
    value
        .to_string()
        .parse::<f64>()
        .map_or(Value::Null, Value::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_short_form() {
        assert_eq!(number(30.6).to_string(), "30.6");
        assert_eq!(number(12.0).to_string(), "12.0");
        assert_eq!(number(f32::NAN), Value::Null);
        assert_eq!(number(f32::INFINITY), Value::Null);
    }
}
