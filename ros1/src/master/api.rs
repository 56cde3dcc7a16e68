//! The master's methods.

use std::sync::Mutex;

use tokio::sync::watch;

use super::{
    notifier::{Notice, Notifier},
    parameters::Parameters,
    registrations::{Kind, Registrations},
    signature::signature,
};
use crate::{
    lock::lock,
    slave::pid,
    xmlrpc::{Fault, Value},
};

/// The name under which the master calls nodes.
pub(super) const MASTER: &str = "/master";

/// What the master knows, and the way to tell nodes.
#[derive(Debug)]
pub(super) struct Api {
    uri: String,
    request_shutdown: watch::Sender<bool>,
    pub(super) notifier: Notifier,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) registrations: Registrations,
    pub(super) parameters: Parameters,
    /// (topic, type) in the order of arrival; a topic is never forgotten.
    topic_types: Vec<(String, String)>,
}

/// (code, message, value): 1 is success, -1 the caller's mistake, 0 a failure.
pub(super) type Triple = (i32, String, Value);

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
        let Some(signature) = signature(method) else {
            let message = format!("<class 'Exception'>:method \"{method}\" is not supported");
            return Err(Fault { code: 1, message });
        };
        let (code, message, value) = match signature.check(arguments) {
            Ok((caller, arguments)) => self.carry_out(method, &caller, &arguments),
            Err(words) => (-1, words, signature.on_error),
        };
        Ok(Value::Array(vec![code.into(), message.into(), value]))
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

    pub(super) fn tell_displaced(&self, displaced: Option<String>, node: &str) {
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

pub(super) fn success(words: &str, value: impl Into<Value>) -> Triple {
    (1, words.to_owned(), value.into())
}

pub(super) fn mistake(words: &str, value: impl Into<Value>) -> Triple {
    (-1, words.to_owned(), value.into())
}
