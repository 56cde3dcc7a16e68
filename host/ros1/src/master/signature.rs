//! The checks for the arguments of each XML-RPC method of the master.

use super::arguments::{Check, check};
use crate::xmlrpc::Value;

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
            .map(|(how, value)| check(*how, value, caller))
            .collect();
        Ok((caller.clone(), canonical?))
    }
}

/// Returns the signature of a method; `None` if the master has no such method.
pub(super) fn signature(method: &str) -> Option<Signature> {
    const KEY: Check = Check::Text("key");
    const TOPIC: Check = Check::NotRoot("topic");
    const SERVICE: Check = Check::NotRoot("service");
    const API: Check = Check::Uri("caller_api");
    let zero = Value::Int(0);
    let (checks, on_error): (&[Check], Value) = match method {
        "shutdown" => (&[Check::Any], zero),
        "getUri" => (&[], "".into()),
        "getPid" => (&[], (-1).into()),
        "deleteParam" | "getParam" | "searchParam" => (&[KEY], zero),
        "setParam" => (&[KEY, Check::Value("value")], zero),
        "subscribeParam" | "unsubscribeParam" => (&[API, KEY], zero),
        "hasParam" => (&[KEY], false.into()),
        "getParamNames" => (&[], zero),
        "registerService" => (&[SERVICE, Check::Uri("service_api"), API], zero),
        "lookupService" => (&[SERVICE], "".into()),
        "unregisterService" => (&[SERVICE, Check::Uri("service_api")], zero),
        "registerSubscriber" | "registerPublisher" => (
            &[TOPIC, Check::Type("topic_type"), API],
            Value::Array(Vec::new()),
        ),
        "unregisterSubscriber" | "unregisterPublisher" => (&[TOPIC, API], zero),
        "lookupNode" => (&[Check::Name("node")], "".into()),
        "getPublishedTopics" => (&[Check::Subgraph("subgraph")], zero),
        "getTopicTypes" => (&[], Value::Array(Vec::new())),
        "getSystemState" => (&[], Value::Array(vec![Value::Array(Vec::new()); 3])),
        _ => return None,
    };
    Some(Signature { checks, on_error })
}
