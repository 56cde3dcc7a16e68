//! The XML-RPC methods of the master for parameters.

use super::{
    notifier::Notifier,
    parameter_updates::{parameter_updates, with_slash},
    parameters::Parameters,
    registrations::{Kind, Registrations},
};
use crate::{
    names::resolve,
    xmlrpc::{Reply, Value},
};

/// The parts of the master's state that the parameter methods read and change.
pub(super) struct ParameterApi<'a> {
    pub(super) parameters: &'a mut Parameters,
    pub(super) registrations: &'a mut Registrations,
    pub(super) notifier: &'a Notifier,
}

impl ParameterApi<'_> {
    /// Executes `method`. `Signature::check` has already checked and converted `arguments`.
    pub(super) fn dispatch(self, method: &str, caller: &str, arguments: &[Value]) -> Reply {
        let text = |at: usize| {
            arguments
                .get(at)
                .and_then(Value::as_str)
                .unwrap_or_default()
        };
        let key = resolve(text(0), caller);
        match method {
            "getParam" => match self.parameters.get(&key) {
                Some(value) => Reply::success(format!("Parameter [{key}]"), value.clone()),
                None => Reply::caller_error(format!("Parameter [{key}] is not set"), 0),
            },
            "setParam" => {
                let value = arguments.get(1).cloned().unwrap_or(Value::Nil);
                if !self.parameters.set(&key, value.clone()) {
                    return Reply::caller_error(
                        "Error: invalid arguments: cannot set root of parameter tree to \
                         non-dictionary",
                        0,
                    );
                }
                self.notify_subscribers(&key, &value, Some(caller));
                Reply::success(format!("parameter {key} set"), 0)
            }
            "deleteParam" => {
                if !self.parameters.delete(&key) {
                    return Reply::caller_error(format!("parameter [{key}] is not set"), 0);
                }
                self.notify_subscribers(&key, &Value::Struct(Vec::new()), None);
                Reply::success(format!("parameter {key} deleted"), 0)
            }
            "hasParam" => {
                let found = self.parameters.get(&key).is_some();
                Reply::success(key, found)
            }
            "getParamNames" => Reply::success("Parameter names", self.parameters.names()),
            "searchParam" => search(self.parameters, caller, text(0)),
            "subscribeParam" => {
                let key = resolve(text(1), caller);
                let watched = with_slash(&key);
                let value = self.parameters.get(&watched).cloned();
                let kind = Kind::ParameterSubscriber;
                let displaced = self.registrations.register(kind, &watched, caller, text(0));
                self.notifier.notify_displaced(displaced, caller);
                let value = value.unwrap_or(Value::Struct(Vec::new()));
                Reply::success(format!("Subscribed to parameter [{key}]"), value)
            }
            "unsubscribeParam" => {
                let key = resolve(text(1), caller);
                let kind = Kind::ParameterSubscriber;
                // rosmaster returns 1 whether or not the node had subscribed to the parameter.
                self.registrations
                    .unregister(kind, &with_slash(&key), caller, text(0));
                Reply::success(format!("Unsubscribe to parameter [{key}]"), 1)
            }
            _ => Reply::failure(format!("Internal failure: no method {method}"), 0),
        }
    }

    fn notify_subscribers(&self, key: &str, value: &Value, changer: Option<&str>) {
        let subscribers = self.registrations.entries(Kind::ParameterSubscriber);
        for update in parameter_updates(subscribers, key, value, changer) {
            for registrant in update.registrants {
                let arguments = [update.key.as_str().into(), update.value.clone()];
                self.notifier
                    .notify(&registrant.api, "paramUpdate", &update.key, arguments);
            }
        }
    }
}

fn search(parameters: &Parameters, caller: &str, key: &str) -> Reply {
    if key.starts_with('~') {
        return Reply::failure("Internal failure: invalid key", 0);
    }
    if !caller.starts_with('/') {
        return Reply::failure("Internal failure: namespace must be global", 0);
    }
    match parameters.search(caller, key) {
        Some(found) => Reply::success(format!("Found [{found}]"), found.as_str()),
        None => Reply::caller_error(
            format!("Cannot find parameter [{key}] in an upwards search"),
            "",
        ),
    }
}
