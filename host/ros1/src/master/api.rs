//! The XML-RPC methods of the master.

use std::sync::Mutex;

use tokio::sync::watch;

use super::{
    arguments::signature,
    notifier::Notifier,
    parameters::{Parameters, parameter_updates, with_slash},
    registrations::{Kind, Registrations},
};
use crate::{
    names::resolve,
    sync::lock,
    xmlrpc::{Fault, Value, caller_error, failure, success},
};

/// State of the master, and the handler of its XML-RPC calls.
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
    /// Pairs (topic, type), in the order of the topics' first registration; never removed.
    topic_types: Vec<(String, String)>,
}

impl Api {
    /// Creates a master without registrations. `request_shutdown` becomes true when a caller asks
    /// the master to shut down.
    pub(super) fn new(uri: String, request_shutdown: watch::Sender<bool>) -> Self {
        Self { uri, request_shutdown, notifier: Notifier::default(), state: Mutex::default() }
    }

    /// Answers one XML-RPC call with the array (code, message, value), or with a fault if the
    /// master has no such method.
    pub(super) fn answer(&self, method: &str, arguments: &[Value]) -> Result<Value, Fault> {
        let Some(signature) = signature(method) else {
            let message = format!("<class 'Exception'>:method \"{method}\" is not supported");
            return Err(Fault::new(message));
        };
        Ok(match signature.check(arguments) {
            Ok((caller, arguments)) => self.dispatch(method, &caller, &arguments),
            Err(message) => caller_error(message, signature.on_error),
        })
    }

    /// Executes `method`. `Signature::check` has already checked and converted `arguments`.
    fn dispatch(&self, method: &str, caller: &str, arguments: &[Value]) -> Value {
        let state = &mut *lock(&self.state);
        let registrations = &mut state.registrations;
        let text = |at: usize| text(arguments, at);
        match method {
            "getUri" => success("", self.uri.as_str()),
            "getPid" => success("", Value::process_id()),
            "shutdown" => {
                tracing::info!(caller, reason = text(0), "the master was asked to shut down");
                self.request_shutdown.send_replace(true);
                success("shutdown", 0)
            }
            "registerPublisher" => {
                let (topic, kind) = (text(0), text(1));
                self.register_node(registrations, Kind::Publisher, topic, caller, text(2));
                match state.topic_types.iter_mut().find(|(name, _)| name == topic) {
                    Some(_) if kind == "*" => {}
                    Some((_, known)) => kind.clone_into(known),
                    None => state.topic_types.push((topic.to_owned(), kind.to_owned())),
                }
                self.notify_subscribers(registrations, topic);
                let message = format!("Registered [{caller}] as publisher of [{topic}]");
                success(message, registrations.apis(Kind::Subscriber, topic))
            }
            "registerSubscriber" => {
                let (topic, kind) = (text(0), text(1));
                self.register_node(registrations, Kind::Subscriber, topic, caller, text(2));
                if kind != "*" && !state.topic_types.iter().any(|(name, _)| name == topic) {
                    state.topic_types.push((topic.to_owned(), kind.to_owned()));
                }
                let publishers = registrations.apis(Kind::Publisher, topic);
                success(format!("Subscribed to [{topic}]"), publishers)
            }
            "registerService" => {
                let (service, uri, api) = (text(0), text(1), text(2));
                let displaced = registrations.register_service(service, caller, api, uri);
                self.notifier.notify_displaced(displaced, caller);
                let message = format!("Registered [{caller}] as provider of [{service}]");
                success(message, 1)
            }
            "unregisterPublisher" => {
                let topic = text(0);
                let (message, found) =
                    registrations.unregister(Kind::Publisher, topic, caller, text(1));
                if found {
                    self.notify_subscribers(registrations, topic);
                }
                success(message, i32::from(found))
            }
            "unregisterSubscriber" => {
                let (message, found) =
                    registrations.unregister(Kind::Subscriber, text(0), caller, text(1));
                success(message, i32::from(found))
            }
            "unregisterService" => {
                let (message, found) = registrations.unregister_service(text(0), caller, text(1));
                success(message, i32::from(found))
            }
            "lookupService" => match registrations.service_uri(text(0)) {
                Some(uri) => success(format!("rosrpc URI: [{uri}]"), uri),
                None => caller_error("no provider", ""),
            },
            "lookupNode" => match registrations.node_api(text(0)) {
                Some(api) => success("node api", api),
                None => caller_error(format!("unknown node [{}]", text(0)), ""),
            },
            "getPublishedTopics" => success("current topics", published_topics(state, text(0))),
            "getTopicTypes" => {
                let types = state.topic_types.iter();
                let types = types.map(|(topic, kind)| Value::from([topic.as_str(), kind]));
                success("current system state", types.collect::<Value>())
            }
            "getSystemState" => success("current system state", system_state(registrations)),
            _ => self.dispatch_parameter(state, method, caller, arguments),
        }
    }

    /// Registers `node` and asks a node of the same name, if any, to shut down.
    fn register_node(
        &self,
        registrations: &mut Registrations,
        kind: Kind,
        key: &str,
        node: &str,
        api: &str,
    ) {
        let displaced = registrations.register(kind, key, node, api);
        self.notifier.notify_displaced(displaced, node);
    }

    fn notify_subscribers(&self, registrations: &Registrations, topic: &str) {
        let publishers: Value = registrations.apis(Kind::Publisher, topic).into();
        for api in registrations.apis(Kind::Subscriber, topic) {
            let arguments = [topic.into(), publishers.clone()];
            self.notifier.notify(&api, "publisherUpdate", topic, arguments);
        }
    }

    fn dispatch_parameter(
        &self,
        state: &mut State,
        method: &str,
        caller: &str,
        arguments: &[Value],
    ) -> Value {
        let (parameters, registrations) = (&mut state.parameters, &mut state.registrations);
        let text = |at: usize| text(arguments, at);
        let key = resolve(text(0), caller);
        match method {
            "getParam" => match parameters.get(&key) {
                Some(value) => success(format!("Parameter [{key}]"), value.clone()),
                None => caller_error(format!("Parameter [{key}] is not set"), 0),
            },
            "setParam" => {
                let value = arguments.get(1).cloned().unwrap_or(Value::Nil);
                if !parameters.set(&key, value.clone()) {
                    return caller_error(
                        "Error: invalid arguments: cannot set root of parameter tree to \
                         non-dictionary",
                        0,
                    );
                }
                self.notify_parameter_subscribers(registrations, &key, &value, Some(caller));
                success(format!("parameter {key} set"), 0)
            }
            "deleteParam" => {
                if !parameters.delete(&key) {
                    return caller_error(format!("parameter [{key}] is not set"), 0);
                }
                let deleted = Value::Struct(Vec::new());
                self.notify_parameter_subscribers(registrations, &key, &deleted, None);
                success(format!("parameter {key} deleted"), 0)
            }
            "hasParam" => {
                let found = parameters.get(&key).is_some();
                success(key, found)
            }
            "getParamNames" => success("Parameter names", parameters.names()),
            "searchParam" => search(parameters, caller, text(0)),
            "subscribeParam" => {
                let key = resolve(text(1), caller);
                let watched = with_slash(&key);
                let value = parameters.get(&watched).cloned();
                let kind = Kind::ParameterSubscriber;
                self.register_node(registrations, kind, &watched, caller, text(0));
                let value = value.unwrap_or(Value::Struct(Vec::new()));
                success(format!("Subscribed to parameter [{key}]"), value)
            }
            "unsubscribeParam" => {
                let key = resolve(text(1), caller);
                let kind = Kind::ParameterSubscriber;
                // rosmaster returns 1 whether or not the node had subscribed to the parameter.
                registrations.unregister(kind, &with_slash(&key), caller, text(0));
                success(format!("Unsubscribe to parameter [{key}]"), 1)
            }
            _ => failure(format!("Internal failure: no method {method}"), 0),
        }
    }

    fn notify_parameter_subscribers(
        &self,
        registrations: &Registrations,
        key: &str,
        value: &Value,
        changer: Option<&str>,
    ) {
        let subscribers = registrations.entries(Kind::ParameterSubscriber);
        for update in parameter_updates(subscribers, key, value, changer) {
            for registrant in update.registrants {
                let arguments = [update.key.as_str().into(), update.value.clone()];
                self.notifier.notify(&registrant.api, "paramUpdate", &update.key, arguments);
            }
        }
    }
}

/// Returns the string argument at index `at`. `Signature::check` has checked that it exists.
fn text(arguments: &[Value], at: usize) -> &str {
    arguments.get(at).and_then(Value::as_str).unwrap_or_default()
}

fn published_topics(state: &State, subgraph: &str) -> Value {
    let mut prefix = subgraph.to_owned();
    if !prefix.is_empty() && !prefix.ends_with('/') {
        prefix.push('/');
    }
    let topics = state.registrations.entries(Kind::Publisher).iter();
    let topics = topics.filter(|(topic, _)| topic.starts_with(&prefix)).map(|(topic, _)| {
        let known = state.topic_types.iter().find(|(name, _)| name == topic);
        Value::from([topic.as_str(), known.map_or("*", |(_, kind)| kind)])
    });
    topics.collect()
}

fn system_state(registrations: &Registrations) -> Value {
    let kinds = [Kind::Publisher, Kind::Subscriber, Kind::Service];
    let registers = kinds.into_iter().map(|kind| {
        let entries = registrations.entries(kind).iter();
        let entries = entries.map(|(name, registrants)| {
            let nodes = registrants.iter().map(|registrant| Value::from(registrant.node.as_str()));
            Value::Array(vec![name.as_str().into(), nodes.collect()])
        });
        entries.collect()
    });
    registers.collect()
}

fn search(parameters: &Parameters, caller: &str, key: &str) -> Value {
    if key.starts_with('~') {
        return failure("Internal failure: invalid key", 0);
    }
    if !caller.starts_with('/') {
        return failure("Internal failure: namespace must be global", 0);
    }
    match parameters.search(caller, key) {
        Some(found) => success(format!("Found [{found}]"), found.as_str()),
        None => caller_error(format!("Cannot find parameter [{key}] in an upwards search"), ""),
    }
}
