//! The master's methods.

use std::sync::Mutex;

use tokio::sync::watch;

use super::{
    arguments::{Check, check},
    notifier::{Notice, Notifier},
    parameter_updates::{parameter_updates, with_slash},
    parameters::Parameters,
    registrations::{Kind, Registrations},
};
use crate::{
    lock::lock,
    names::resolve,
    slave::pid,
    xmlrpc::{Fault, Value},
};

/// The name under which the master calls nodes.
const MASTER: &str = "/master";

/// What the master knows, and the way to tell nodes.
#[derive(Debug)]
pub(super) struct Api {
    uri: String,
    request_shutdown: watch::Sender<bool>,
    notifier: Notifier,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    registrations: Registrations,
    parameters: Parameters,
    /// (topic, type) in the order of arrival; a topic is never forgotten.
    topic_types: Vec<(String, String)>,
}

/// What a method takes after its caller, and the value it gives when something is wrong.
struct Signature {
    checks: &'static [Check],
    on_error: Value,
}

/// (code, message, value): 1 is success, -1 the caller's mistake, 0 a failure.
type Triple = (i32, String, Value);

impl Api {
    pub(super) fn new(uri: String, request_shutdown: watch::Sender<bool>) -> Self {
        Self {
            uri,
            request_shutdown,
            notifier: Notifier::default(),
            state: Mutex::default(),
        }
    }

    /// Answers one call.
    pub(super) fn answer(&self, method: &str, arguments: &[Value]) -> Result<Value, Fault> {
        if method == "system.multicall" {
            return self.multicall(arguments);
        }
        let Some(signature) = signature(method) else {
            let message = format!("<class 'Exception'>:method \"{method}\" is not supported");
            return Err(Fault { code: 1, message });
        };
        let (code, message, value) = match checked(&signature, arguments) {
            Ok((caller, arguments)) => self.carry_out(method, &caller, &arguments),
            Err(words) => (-1, words, signature.on_error),
        };
        Ok(Value::Array(vec![code.into(), message.into(), value]))
    }

    fn multicall(&self, arguments: &[Value]) -> Result<Value, Fault> {
        let calls = arguments
            .first()
            .and_then(Value::as_array)
            .unwrap_or_default();
        let answers = calls.iter().map(|call| {
            let method = call
                .member("methodName")
                .and_then(Value::as_str)
                .unwrap_or_default();
            let parameters = call
                .member("params")
                .and_then(Value::as_array)
                .unwrap_or_default();
            let answer = if method == "system.multicall" {
                Err(Fault {
                    code: 1,
                    message: "a multicall may not nest".to_owned(),
                })
            } else {
                self.answer(method, parameters)
            };
            match answer {
                Ok(value) => Value::Array(vec![value]),
                Err(fault) => Value::Struct(vec![
                    ("faultCode".to_owned(), fault.code.into()),
                    ("faultString".to_owned(), fault.message.into()),
                ]),
            }
        });
        Ok(answers.collect())
    }

    /// Every argument has passed its check here.
    fn carry_out(&self, method: &str, caller: &str, arguments: &[Value]) -> Triple {
        let mut state = lock(&self.state);
        let text = |at: usize| {
            arguments
                .get(at)
                .and_then(Value::as_str)
                .unwrap_or_default()
        };
        match method {
            "getUri" => success("", self.uri.as_str()),
            "getPid" => success("", pid()),
            "shutdown" => {
                tracing::info!(
                    caller,
                    reason = text(0),
                    "the master was asked to shut down"
                );
                self.request_shutdown.send_replace(true);
                success("shutdown", 0)
            }
            "registerPublisher" => self.register_publisher(&mut state, caller, arguments),
            "registerSubscriber" => self.register_subscriber(&mut state, caller, arguments),
            "registerService" => {
                let (service, uri, api) = (text(0), text(1), text(2));
                let displaced = state
                    .registrations
                    .register_service(service, caller, api, uri);
                self.tell_displaced(displaced, caller);
                success(
                    &format!("Registered [{caller}] as provider of [{service}]"),
                    1,
                )
            }
            "unregisterPublisher" => {
                let topic = text(0);
                let (words, found) =
                    state
                        .registrations
                        .unregister(Kind::Publisher, topic, caller, text(1));
                if found {
                    self.tell_subscribers(&state, topic);
                }
                success(&words, i32::from(found))
            }
            "unregisterSubscriber" => {
                let (words, found) =
                    state
                        .registrations
                        .unregister(Kind::Subscriber, text(0), caller, text(1));
                success(&words, i32::from(found))
            }
            "unregisterService" => {
                let (words, found) =
                    state
                        .registrations
                        .unregister_service(text(0), caller, text(1));
                success(&words, i32::from(found))
            }
            "lookupService" => match state.registrations.service_uri(text(0)) {
                Some(uri) => success(&format!("rosrpc URI: [{uri}]"), uri),
                None => mistake("no provider", ""),
            },
            "lookupNode" => match state.registrations.node_api(text(0)) {
                Some(api) => success("node api", api),
                None => mistake(&format!("unknown node [{}]", text(0)), ""),
            },
            "getPublishedTopics" => success("current topics", published_topics(&state, text(0))),
            "getTopicTypes" => {
                let types = state.topic_types.iter();
                let types = types.map(|(topic, kind)| Value::from([topic.as_str(), kind]));
                success("current system state", types.collect::<Value>())
            }
            "getSystemState" => success("current system state", system_state(&state)),
            _ => self.carry_out_parameter(&mut state, method, caller, arguments),
        }
    }

    fn register_publisher(&self, state: &mut State, caller: &str, arguments: &[Value]) -> Triple {
        let text = |at: usize| {
            arguments
                .get(at)
                .and_then(Value::as_str)
                .unwrap_or_default()
        };
        let (topic, kind, api) = (text(0), text(1), text(2));
        let displaced = state
            .registrations
            .register(Kind::Publisher, topic, caller, api);
        self.tell_displaced(displaced, caller);
        match state.topic_types.iter_mut().find(|(name, _)| name == topic) {
            Some(_) if kind == "*" => {}
            Some((_, known)) => kind.clone_into(known),
            None => state.topic_types.push((topic.to_owned(), kind.to_owned())),
        }
        self.tell_subscribers(state, topic);
        let subscribers = state.registrations.apis(Kind::Subscriber, topic);
        success(
            &format!("Registered [{caller}] as publisher of [{topic}]"),
            subscribers,
        )
    }

    fn register_subscriber(&self, state: &mut State, caller: &str, arguments: &[Value]) -> Triple {
        let text = |at: usize| {
            arguments
                .get(at)
                .and_then(Value::as_str)
                .unwrap_or_default()
        };
        let (topic, kind, api) = (text(0), text(1), text(2));
        let displaced = state
            .registrations
            .register(Kind::Subscriber, topic, caller, api);
        self.tell_displaced(displaced, caller);
        if kind != "*" && !state.topic_types.iter().any(|(name, _)| name == topic) {
            state.topic_types.push((topic.to_owned(), kind.to_owned()));
        }
        let publishers = state.registrations.apis(Kind::Publisher, topic);
        success(&format!("Subscribed to [{topic}]"), publishers)
    }

    fn carry_out_parameter(
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

    fn tell_displaced(&self, displaced: Option<String>, node: &str) {
        if let Some(api) = displaced {
            let reason = format!("[{node}] Reason: new node registered with same name");
            let arguments = vec![MASTER.into(), reason.into()];
            let notice = Notice {
                method: "shutdown",
                subject: node.to_owned(),
                arguments,
            };
            self.notifier.notify(&api, notice);
        }
    }

    fn tell_subscribers(&self, state: &State, topic: &str) {
        let publishers = state.registrations.apis(Kind::Publisher, topic);
        for api in state.registrations.apis(Kind::Subscriber, topic) {
            let arguments = vec![MASTER.into(), topic.into(), publishers.clone().into()];
            let subject = topic.to_owned();
            self.notifier.notify(
                &api,
                Notice {
                    method: "publisherUpdate",
                    subject,
                    arguments,
                },
            );
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

fn signature(method: &str) -> Option<Signature> {
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

fn checked(signature: &Signature, arguments: &[Value]) -> Result<(String, Vec<Value>), String> {
    let Some((caller, arguments)) = arguments.split_first() else {
        return Err("missing required caller_id parameter".to_owned());
    };
    if arguments.len() != signature.checks.len() {
        return Err("Error: bad call arity".to_owned());
    }
    let Value::String(caller) = caller else {
        return Err("caller_id must be a string".to_owned());
    };
    let pairs = signature.checks.iter().zip(arguments);
    let canonical: Result<_, _> = pairs
        .map(|(how, value)| check(*how, value, caller))
        .collect();
    Ok((caller.clone(), canonical?))
}

fn published_topics(state: &State, subgraph: &str) -> Value {
    let mut prefix = subgraph.to_owned();
    if !prefix.is_empty() && !prefix.ends_with('/') {
        prefix.push('/');
    }
    let topics = state.registrations.register_of(Kind::Publisher).iter();
    let topics = topics
        .filter(|(topic, _)| topic.starts_with(&prefix))
        .map(|(topic, _)| {
            let known = state.topic_types.iter().find(|(name, _)| name == topic);
            Value::from([topic.as_str(), known.map_or("*", |(_, kind)| kind)])
        });
    topics.collect()
}

fn system_state(state: &State) -> Value {
    let kinds = [Kind::Publisher, Kind::Subscriber, Kind::Service];
    let registers = kinds.into_iter().map(|kind| {
        let register = state.registrations.register_of(kind).iter();
        let entries = register.map(|(name, registrants)| {
            let nodes = registrants
                .iter()
                .map(|registrant| Value::from(registrant.node.as_str()));
            Value::Array(vec![name.as_str().into(), nodes.collect()])
        });
        entries.collect()
    });
    registers.collect()
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

fn success(words: &str, value: impl Into<Value>) -> Triple {
    (1, words.to_owned(), value.into())
}

fn mistake(words: &str, value: impl Into<Value>) -> Triple {
    (-1, words.to_owned(), value.into())
}
