//! Determines which parameter subscribers are notified of a change.

use super::registrations::Registrant;
use crate::{names::canonical, xmlrpc::Value};

/// One notification of all subscribers of a parameter.
#[derive(Debug, PartialEq)]
pub(super) struct ParameterUpdate {
    pub(super) registrants: Vec<Registrant>,
    /// Full name of the parameter with a trailing slash, as rosmaster sends it.
    pub(super) key: String,
    pub(super) value: Value,
}

/// Returns the notifications that rosmaster sends after `key` was set to `value`; an empty struct
/// as `value` means that `key` was deleted. The node `changer`, which made the change, is not
/// notified for its own subscriptions to `key` or to a branch above `key`.
pub(super) fn parameter_updates(
    subscribers: &[(String, Vec<Registrant>)],
    key: &str,
    value: &Value,
    changer: Option<&str>,
) -> Vec<ParameterUpdate> {
    let key = with_slash(key);
    let mut changed = Vec::new();
    let is_branch = matches!(value, Value::Struct(_));
    push_branch(&mut changed, &key, value);
    let mut updates = Vec::new();
    for (watched, registrants) in subscribers {
        let space = with_slash(watched);
        if key.starts_with(&space) {
            let others = registrants
                .iter()
                .filter(|r| Some(r.node.as_str()) != changer);
            updates.push(ParameterUpdate {
                registrants: others.cloned().collect(),
                key: key.clone(),
                value: value.clone(),
            });
        } else if is_branch
            && space.starts_with(&key)
            && !changed.iter().any(|(name, _)| name == watched)
        {
            updates.push(ParameterUpdate {
                registrants: registrants.clone(),
                key: watched.clone(),
                value: Value::Struct(Vec::new()),
            });
        }
    }
    for (name, member) in changed {
        if let Some((_, registrants)) = subscribers.iter().find(|(watched, _)| *watched == name) {
            updates.push(ParameterUpdate {
                registrants: registrants.clone(),
                key: name,
                value: member.clone(),
            });
        }
    }
    updates
}

/// Appends, for every parameter below `branch`, its full name with a trailing slash and its value.
fn push_branch<'a>(names: &mut Vec<(String, &'a Value)>, branch: &str, value: &'a Value) {
    let Value::Struct(members) = value else {
        return;
    };
    for (name, member) in members {
        let name = format!("{branch}{name}/");
        names.push((name.clone(), member));
        push_branch(names, &name, member);
    }
}

/// Returns the canonical form of `key` with a trailing slash. Subscriptions are stored in this
/// form.
pub(super) fn with_slash(key: &str) -> String {
    if key == "/" {
        key.to_owned()
    } else {
        format!("{}/", canonical(key))
    }
}
