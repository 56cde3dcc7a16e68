//! The method `system.multicall`: several calls in one request. All XML-RPC servers in ROS support
//! it.

use super::value::{Fault, Value};

pub(super) const MULTICALL: &str = "system.multicall";

/// Answers each call in a list. The result for one call is an array that holds the value, or a
/// struct that describes the fault.
pub(super) fn multicall<F>(arguments: &[Value], answer: &F) -> Result<Value, Fault>
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault>,
{
    let [Value::Array(calls)] = arguments else {
        return Err(Fault {
            code: 1,
            message: format!("{MULTICALL} takes one array of calls"),
        });
    };
    Ok(calls.iter().map(|call| answer_one(call, answer)).collect())
}

fn answer_one<F>(call: &Value, answer: &F) -> Value
where
    F: Fn(&str, &[Value]) -> Result<Value, Fault>,
{
    let method = call
        .member("methodName")
        .and_then(Value::as_str)
        .unwrap_or_default();
    let arguments = call
        .member("params")
        .and_then(Value::as_array)
        .unwrap_or_default();
    let outcome = if method == MULTICALL {
        Err(Fault {
            code: 1,
            message: format!("{MULTICALL} cannot contain itself"),
        })
    } else {
        answer(method, arguments)
    };
    match outcome {
        Ok(value) => Value::Array(vec![value]),
        Err(fault) => fault.into(),
    }
}
