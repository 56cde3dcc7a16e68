//! The master's methods for parameters.

use super::{
    api::{Api, MASTER, State, Triple, mistake, success},
    notifier::Notice,
    parameter_updates::{parameter_updates, with_slash},
    parameters::Parameters,
    registrations::Kind,
};
use crate::{names::resolve, xmlrpc::Value};

impl Api {
    /// Every argument has passed its check here.
    pub(super) fn carry_out_parameter(
        &self,
        state: &mut State,
        method: &str,
        caller: &str,
        arguments: &[Value],
    ) -> Triple {
        let text = |at: usize| {
            arguments
                .get(at)
                .and_then(Value::as_str)
                .unwrap_or_default()
        };
        let key = resolve(text(0), caller);
        match method {
            "getParam" => match state.parameters.get(&key) {
                Some(value) => success(&format!("Parameter [{key}]"), value.clone()),
                None => mistake(&format!("Parameter [{key}] is not set"), 0),
            },
            "setParam" => {
                let value = arguments.get(1).cloned().unwrap_or(Value::Nil);
                if !state.parameters.set(&key, value.clone()) {
                    return mistake(
                        "Error: invalid arguments: cannot set root of parameter tree to \
                         non-dictionary",
                        0,
                    );
                }
                self.tell_watchers(state, &key, &value, Some(caller));
                success(&format!("parameter {key} set"), 0)
            }
            "deleteParam" => {
                if !state.parameters.delete(&key) {
                    return mistake(&format!("parameter [{key}] is not set"), 0);
                }
                self.tell_watchers(state, &key, &Value::Struct(Vec::new()), None);
                success(&format!("parameter {key} deleted"), 0)
            }
            "hasParam" => success(&key, state.parameters.get(&key).is_some()),
            "getParamNames" => success("Parameter names", state.parameters.names()),
            "searchParam" => search(&state.parameters, caller, text(0)),
            "subscribeParam" => {
                let key = resolve(text(1), caller);
                let watched = with_slash(&key);
                let value = state.parameters.get(&watched).cloned();
                let kind = Kind::ParameterSubscriber;
                let displaced = state
                    .registrations
                    .register(kind, &watched, caller, text(0));
                self.tell_displaced(displaced, caller);
                let value = value.unwrap_or(Value::Struct(Vec::new()));
                success(&format!("Subscribed to parameter [{key}]"), value)
            }
            "unsubscribeParam" => {
                let key = resolve(text(1), caller);
                let kind = Kind::ParameterSubscriber;
                // rosmaster answers 1 whether or not there was a subscription.
                state
                    .registrations
                    .unregister(kind, &with_slash(&key), caller, text(0));
                success(&format!("Unsubscribe to parameter [{key}]"), 1)
            }
            _ => (0, format!("Internal failure: no method {method}"), 0.into()),
        }
    }

    fn tell_watchers(&self, state: &State, key: &str, value: &Value, changer: Option<&str>) {
        let watchers = state.registrations.register_of(Kind::ParameterSubscriber);
        for update in parameter_updates(watchers, key, value, changer) {
            for registrant in update.registrants {
                let key = update.key.clone();
                let arguments = vec![MASTER.into(), key.as_str().into(), update.value.clone()];
                let notice = Notice {
                    method: "paramUpdate",
                    subject: key,
                    arguments,
                };
                self.notifier.notify(&registrant.api, notice);
            }
        }
    }
}

fn search(parameters: &Parameters, caller: &str, key: &str) -> Triple {
    if key.starts_with('~') {
        return (0, "Internal failure: invalid key".to_owned(), 0.into());
    }
    if !caller.starts_with('/') {
        return (
            0,
            "Internal failure: namespace must be global".to_owned(),
            0.into(),
        );
    }
    match parameters.search(caller, key) {
        Some(found) => success(&format!("Found [{found}]"), found.as_str()),
        None => mistake(
            &format!("Cannot find parameter [{key}] in an upwards search"),
            "",
        ),
    }
}
