//! Whom a changed parameter concerns.

use super::registrations::Registrant;
use crate::{names::canonical, xmlrpc::Value};

/// One message to those who watch `key`.
#[derive(Debug, PartialEq)]
pub(super) struct ParameterUpdate {
    pub(super) registrants: Vec<Registrant>,
    /// With a slash at its end, as rosmaster sends it.
    pub(super) key: String,
    pub(super) value: Value,
}

/// What rosmaster sends after `key` became `value` (an empty struct: deleted). `changer`, when
/// given, is not told about what it did itself above or at `key`.
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

/// Every name inside a branch, with a slash at its end.
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

/// The form under which parameters are watched: canonical, with a slash at the end.
pub(super) fn with_slash(key: &str) -> String {
    if key == "/" {
        key.to_owned()
    } else {
        format!("{}/", canonical(key))
    }
}
