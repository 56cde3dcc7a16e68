//! The arguments of each XML-RPC method of the master, and the checks that rosmaster applies to
//! them, with the same error messages.

use crate::{names::resolve, xmlrpc::Value};

/// Checks for the arguments of one method. The first argument, the caller's name, is not listed
/// because every method has it.
pub(super) struct Signature {
    checks: &'static [Check],
    /// Value (third item) of the reply if a check fails.
    pub(super) on_error: Value,
}

impl Signature {
    /// Checks all arguments. Returns the caller's name and the other arguments, converted; on
    /// failure, returns rosmaster's error message.
    pub(super) fn check(&self, arguments: &[Value]) -> Result<(String, Vec<Value>), String> {
        let Some((caller, arguments)) = arguments.split_first() else {
            return Err("missing required caller_id parameter".to_owned());
        };
        if arguments.len() != self.checks.len() {
            return Err("Error: bad call arity".to_owned());
        }
        let Value::String(caller) = caller else {
            return Err("caller_id must be a string".to_owned());
        };
        let pairs = self.checks.iter().zip(arguments);
        let canonical: Result<_, _> = pairs
            .map(|((kind, name), value)| {
                converted(*kind, value, caller)
                    .map_err(|error| format!("ERROR: parameter [{name}] {error}"))
            })
            .collect();
        Ok((caller.clone(), canonical?))
    }
}

/// Returns the signature of a method; `None` if the master has no such method.
pub(super) fn signature(method: &str) -> Option<Signature> {
    const KEY: Check = (Kind::Text, "key");
    const TOPIC: Check = (Kind::NotRoot, "topic");
    const SERVICE: Check = (Kind::NotRoot, "service");
    const API: Check = (Kind::Uri, "caller_api");
    let zero = Value::Int(0);
    let (checks, on_error): (&[Check], Value) = match method {
        "shutdown" => (&[(Kind::Any, "reason")], zero),
        "getUri" => (&[], "".into()),
        "getPid" => (&[], (-1).into()),
        "deleteParam" | "getParam" | "searchParam" => (&[KEY], zero),
        "setParam" => (&[KEY, (Kind::Value, "value")], zero),
        "subscribeParam" | "unsubscribeParam" => (&[API, KEY], zero),
        "hasParam" => (&[KEY], false.into()),
        "getParamNames" => (&[], zero),
        "registerService" => (&[SERVICE, (Kind::Uri, "service_api"), API], zero),
        "lookupService" => (&[SERVICE], "".into()),
        "unregisterService" => (&[SERVICE, (Kind::Uri, "service_api")], zero),
        "registerSubscriber" | "registerPublisher" => {
            (&[TOPIC, (Kind::Type, "topic_type"), API], Value::Array(Vec::new()))
        }
        "unregisterSubscriber" | "unregisterPublisher" => (&[TOPIC, API], zero),
        "lookupNode" => (&[(Kind::Name, "node")], "".into()),
        "getPublishedTopics" => (&[(Kind::Subgraph, "subgraph")], zero),
        "getTopicTypes" => (&[], Value::Array(Vec::new())),
        "getSystemState" => (&[], Value::Array(vec![Value::Array(Vec::new()); 3])),
        _ => return None,
    };
    Some(Signature { checks, on_error })
}

/// Check and conversion of one argument, and the argument's name for error messages.
type Check = (Kind, &'static str);

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// A non-empty name, resolved to its full form.
    Name,
    /// A non-empty name other than `/`, resolved to its full form.
    NotRoot,
    /// A URI that starts with `http://` or `rosrpc://`.
    Uri,
    /// Type of a topic: `package/Type`, or `*` for any type.
    Type,
    /// A non-empty string, passed on unchanged.
    Text,
    /// An empty string, passed on unchanged, or a name, resolved to its full form.
    Subgraph,
    /// Any value except nil.
    Value,
    Any,
}

/// Checks one argument of a call by the node `caller`. Returns the converted value, or the end of
/// the error message that rosmaster would return.
fn converted(kind: Kind, value: &Value, caller: &str) -> Result<Value, &'static str> {
    const NON_EMPTY: &str = "must be a non-empty string";
    let text = value.as_str();
    let valid = |valid: bool, error| valid.then(|| value.clone()).ok_or(error);
    match kind {
        Kind::Any => Ok(value.clone()),
        Kind::Value => valid(*value != Value::Nil, "must be specified"),
        Kind::Text if is_falsy(value) => Err("must be specified and non-empty"),
        Kind::Text => valid(text.is_some(), "must be a string"),
        Kind::Subgraph => match text {
            Some("") => Ok(value.clone()),
            Some(text) => Ok(resolve(text, caller).into()),
            None => Err("must be a string"),
        },
        Kind::Type => match text {
            Some("") | None => Err(NON_EMPTY),
            Some(text) => valid(
                text == "*" || text.split('/').count() == 2,
                "is not a valid package resource name",
            ),
        },
        Kind::Uri => match text {
            Some("") | None => Err("is not an XMLRPC URI"),
            Some(text) => valid(
                text.starts_with("http://") || text.starts_with("rosrpc://"),
                "is not an RPC URI",
            ),
        },
        Kind::Name | Kind::NotRoot => match text {
            Some("") | None => Err(NON_EMPTY),
            Some(text) if text.contains([':', ' ']) => Err("contains illegal chars"),
            Some("/") if matches!(kind, Kind::NotRoot) => Err("cannot be the global namespace"),
            Some(text) => Ok(resolve(text, caller).into()),
        },
    }
}

/// Returns whether `value` is false in Python. rosmaster rejects such values as missing.
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
