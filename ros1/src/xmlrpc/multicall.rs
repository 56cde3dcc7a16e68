//! Many calls in one: `system.multicall`, which every XML-RPC server of ROS has.

use super::value::{Fault, Value};

/// The method's name.
pub(super) const MULTICALL: &str = "system.multicall";

/// Answers each call of the list: with an array of one value, or with a fault's struct.
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
    Ok(calls.iter().map(|call| one(call, answer)).collect())
}

fn one<F>(call: &Value, answer: &F) -> Value
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
            message: format!("{MULTICALL} may not stand in itself"),
        })
    } else {
        answer(method, arguments)
    };
    match outcome {
        Ok(value) => Value::Array(vec![value]),
        Err(fault) => fault.into(),
    }
}
