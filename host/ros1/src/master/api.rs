//! The XML-RPC methods of the master, except those for parameters.

use std::sync::Mutex;

use tokio::sync::watch;

use super::{
    notifier::Notifier,
    parameter_api::ParameterApi,
    parameters::Parameters,
    registrations::{Kind, Registrations},
    signature::signature,
};
use crate::{
    lock::lock,
    xmlrpc::{Fault, Reply, Value},
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
    /// Pairs (topic, type) in the order in which the topics were first registered. Topics are never
    /// removed.
    topic_types: Vec<(String, String)>,
}

impl Api {
    /// Creates a master without registrations. `request_shutdown` becomes true when a caller asks
    /// the master to shut down.
    pub(super) fn new(uri: String, request_shutdown: watch::Sender<bool>) -> Self {
        Self {
            uri,
            request_shutdown,
            notifier: Notifier::default(),
            state: Mutex::default(),
        }
    }

    /// Answers one XML-RPC call with a [`Reply`] as an array, or with a fault if the method is
    /// unknown.
    pub(super) fn answer(&self, method: &str, arguments: &[Value]) -> Result<Value, Fault> {
        let Some(signature) = signature(method) else {
            let message = format!("<class 'Exception'>:method \"{method}\" is not supported");
            return Err(Fault { code: 1, message });
        };
        let reply = match signature.check(arguments) {
            Ok((caller, arguments)) => self.dispatch(method, &caller, &arguments),
            Err(message) => Reply::caller_error(message, signature.on_error),
        };
        Ok(reply.into())
    }

    /// Executes `method`. `Signature::check` has already checked and converted `arguments`.
    fn dispatch(&self, method: &str, caller: &str, arguments: &[Value]) -> Reply {
        let mut state = lock(&self.state);
        let text = |at: usize| text(arguments, at);
        match method {
            "getUri" => Reply::success("", self.uri.as_str()),
            "getPid" => Reply::success("", Value::process_id()),
            "shutdown" => {
                tracing::info!(
                    caller,
                    reason = text(0),
                    "the master was asked to shut down"
                );
                self.request_shutdown.send_replace(true);
                Reply::success("shutdown", 0)
            }
            "registerPublisher" => self.register_publisher(&mut state, caller, arguments),
            "registerSubscriber" => self.register_subscriber(&mut state, caller, arguments),
            "registerService" => {
                let (service, uri, api) = (text(0), text(1), text(2));
                let displaced = state
                    .registrations
                    .register_service(service, caller, api, uri);
                self.notifier.notify_displaced(displaced, caller);
                let message = format!("Registered [{caller}] as provider of [{service}]");
                Reply::success(message, 1)
            }
            "unregisterPublisher" => {
                let topic = text(0);
                let (message, found) =
                    state
                        .registrations
                        .unregister(Kind::Publisher, topic, caller, text(1));
                if found {
                    self.notify_subscribers(&state, topic);
                }
                Reply::success(message, i32::from(found))
            }
            "unregisterSubscriber" => {
                let (message, found) =
                    state
                        .registrations
                        .unregister(Kind::Subscriber, text(0), caller, text(1));
                Reply::success(message, i32::from(found))
            }
            "unregisterService" => {
                let (message, found) =
                    state
                        .registrations
                        .unregister_service(text(0), caller, text(1));
                Reply::success(message, i32::from(found))
            }
            "lookupService" => match state.registrations.service_uri(text(0)) {
                Some(uri) => Reply::success(format!("rosrpc URI: [{uri}]"), uri),
                None => Reply::caller_error("no provider", ""),
            },
            "lookupNode" => match state.registrations.node_api(text(0)) {
                Some(api) => Reply::success("node api", api),
                None => Reply::caller_error(format!("unknown node [{}]", text(0)), ""),
            },
            "getPublishedTopics" => {
                Reply::success("current topics", published_topics(&state, text(0)))
            }
            "getTopicTypes" => {
                let types = state.topic_types.iter();
                let types = types.map(|(topic, kind)| Value::from([topic.as_str(), kind]));
                Reply::success("current system state", types.collect::<Value>())
            }
            "getSystemState" => Reply::success("current system state", system_state(&state)),
            _ => {
                let state = &mut *state;
                let parameter_api = ParameterApi {
                    parameters: &mut state.parameters,
                    registrations: &mut state.registrations,
                    notifier: &self.notifier,
                };
                parameter_api.dispatch(method, caller, arguments)
            }
        }
    }

    fn register_publisher(&self, state: &mut State, caller: &str, arguments: &[Value]) -> Reply {
        let (topic, kind) = (text(arguments, 0), text(arguments, 1));
        let api = text(arguments, 2);
        let displaced = state
            .registrations
            .register(Kind::Publisher, topic, caller, api);
        self.notifier.notify_displaced(displaced, caller);
        match state.topic_types.iter_mut().find(|(name, _)| name == topic) {
            Some(_) if kind == "*" => {}
            Some((_, known)) => kind.clone_into(known),
            None => state.topic_types.push((topic.to_owned(), kind.to_owned())),
        }
        self.notify_subscribers(state, topic);
        let subscribers = state.registrations.apis(Kind::Subscriber, topic);
        let message = format!("Registered [{caller}] as publisher of [{topic}]");
        Reply::success(message, subscribers)
    }

    fn register_subscriber(&self, state: &mut State, caller: &str, arguments: &[Value]) -> Reply {
        let (topic, kind) = (text(arguments, 0), text(arguments, 1));
        let api = text(arguments, 2);
        let displaced = state
            .registrations
            .register(Kind::Subscriber, topic, caller, api);
        self.notifier.notify_displaced(displaced, caller);
        if kind != "*" && !state.topic_types.iter().any(|(name, _)| name == topic) {
            state.topic_types.push((topic.to_owned(), kind.to_owned()));
        }
        let publishers = state.registrations.apis(Kind::Publisher, topic);
        Reply::success(format!("Subscribed to [{topic}]"), publishers)
    }

    fn notify_subscribers(&self, state: &State, topic: &str) {
        let publishers: Value = state.registrations.apis(Kind::Publisher, topic).into();
        for api in state.registrations.apis(Kind::Subscriber, topic) {
            let arguments = [topic.into(), publishers.clone()];
            self.notifier
                .notify(&api, "publisherUpdate", topic, arguments);
        }
    }
}

/// Returns the string argument at index `at`. `Signature::check` has already checked that the
/// argument exists.
fn text(arguments: &[Value], at: usize) -> &str {
    arguments
        .get(at)
        .and_then(Value::as_str)
        .unwrap_or_default()
}

fn published_topics(state: &State, subgraph: &str) -> Value {
    let mut prefix = subgraph.to_owned();
    if !prefix.is_empty() && !prefix.ends_with('/') {
        prefix.push('/');
    }
    let topics = state.registrations.entries(Kind::Publisher).iter();
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
        let entries = state.registrations.entries(kind).iter();
        let entries = entries.map(|(name, registrants)| {
            let nodes = registrants
                .iter()
                .map(|registrant| Value::from(registrant.node.as_str()));
            Value::Array(vec![name.as_str().into(), nodes.collect()])
        });
        entries.collect()
    });
    registers.collect()
}
