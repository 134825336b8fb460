//! What a page is told first.

use serde_json::{Map, Value};
use siskin_control::protection::{Condition, Fault, Limit};

/// The greeting with what the program has to say: the version, and the faults and limits by their bits in
/// HEARTBEAT's custom mode come with it.
pub fn greeting(mut hello: Map<String, Value>) -> String {
    let faults = Fault::ALL.map(Fault::condition);
    let limits = Limit::ALL.map(Limit::condition);
    let named = |conditions: &[Condition]| -> Value {
        let each = conditions.iter();
        let each = each.map(|row| (row.number.to_string(), Value::from(row.text)));
        Value::Object(each.collect())
    };
    hello.insert("version".into(), env!("CARGO_PKG_VERSION").into());
    hello.insert("faults".into(), named(&faults));
    hello.insert("limits".into(), named(&limits));
    serde_json::json!({ "hello": hello }).to_string()
}
