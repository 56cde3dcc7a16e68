//! The checks that rosmaster applies to the arguments of a call, with the same error messages.

use crate::{names::resolve, xmlrpc::Value};

/// Check and conversion of one argument. Each variant except `Any` holds the argument's name for
/// error messages.
#[derive(Debug, Clone, Copy)]
pub(super) enum Check {
    /// A non-empty name, resolved to its full form.
    Name(&'static str),
    /// A non-empty name other than `/`, resolved to its full form.
    NotRoot(&'static str),
    /// A URI that starts with `http://` or `rosrpc://`.
    Uri(&'static str),
    /// Type of a topic: `package/Type`, or `*` for any type.
    Type(&'static str),
    /// A non-empty string, kept as received.
    Text(&'static str),
    /// Either an empty string, which is kept, or a name, which is resolved to its full form.
    Subgraph(&'static str),
    /// Any value except nil.
    Value(&'static str),
    Any,
}

/// Checks one argument of a call by the node `caller`. Returns the converted value, or the error
/// message that rosmaster would return.
pub(super) fn check(check: Check, value: &Value, caller: &str) -> Result<Value, String> {
    match check {
        Check::Any => Ok(value.clone()),
        Check::Value(name) => match value {
            Value::Nil => Err(must_be_specified_for_value(name)),
            value => Ok(value.clone()),
        },
        Check::Text(name) => match value {
            Value::String(text) if !text.is_empty() => Ok(value.clone()),
            value if is_falsy(value) => Err(must_be_specified(name)),
            _ => Err(format!("ERROR: parameter [{name}] must be a string")),
        },
        Check::Subgraph(name) => match value {
            Value::String(text) if text.is_empty() => Ok(value.clone()),
            Value::String(text) => Ok(Value::String(resolve(text, caller))),
            _ => Err(format!("ERROR: parameter [{name}] must be a string")),
        },
        Check::Type(name) => match value {
            Value::String(text) if text == "*" || text.split('/').count() == 2 => Ok(value.clone()),
            Value::String(text) if !text.is_empty() => Err(format!(
                "ERROR: parameter [{name}] is not a valid package resource name"
            )),
            _ => Err(must_be_non_empty(name)),
        },
        Check::Uri(name) => match value {
            Value::String(text) if text.starts_with("http://") || text.starts_with("rosrpc://") => {
                Ok(value.clone())
            }
            Value::String(text) if !text.is_empty() => {
                Err(format!("ERROR: parameter [{name}] is not an RPC URI"))
            }
            _ => Err(format!("ERROR: parameter [{name}] is not an XMLRPC URI")),
        },
        Check::Name(name) => global_name(name, value, caller),
        Check::NotRoot(name) => {
            let full = global_name(name, value, caller)?;
            if value.as_str() == Some("/") {
                return Err(format!(
                    "ERROR: parameter [{name}] cannot be the global namespace"
                ));
            }
            Ok(full)
        }
    }
}

fn global_name(name: &str, value: &Value, caller: &str) -> Result<Value, String> {
    match value {
        Value::String(text) if text.contains([':', ' ']) => {
            Err(format!("ERROR: parameter [{name}] contains illegal chars"))
        }
        Value::String(text) if !text.is_empty() => Ok(Value::String(resolve(text, caller))),
        _ => Err(must_be_non_empty(name)),
    }
}

fn must_be_specified(name: &str) -> String {
    format!("ERROR: parameter [{name}] must be specified and non-empty")
}

fn must_be_specified_for_value(name: &str) -> String {
    format!("ERROR: parameter [{name}] must be specified")
}

fn must_be_non_empty(name: &str) -> String {
    format!("ERROR: parameter [{name}] must be a non-empty string")
}

/// Returns whether Python treats `value` as false: rosmaster rejects such values as missing.
fn is_falsy(value: &Value) -> bool {
    match value {
        Value::Int(number) => *number == 0,
        Value::Bool(flag) => !flag,
        Value::Double(number) => *number == 0.0,
        Value::String(text) => text.is_empty(),
        Value::Array(items) => items.is_empty(),
        Value::Struct(members) => members.is_empty(),
        Value::Nil => true,
        Value::Base64(_) | Value::DateTime(_) => false,
    }
}
