//! The master's parameter tree: structs are branches, all other values are leaves. Also determines
//! which parameter subscribers are notified of a change.

use super::registrations::Registrant;
use crate::{names::canonical, xmlrpc::Value};

/// All parameters as one tree.
#[derive(Debug)]
pub(super) struct Parameters {
    /// The whole tree, which is always a struct.
    root: Value,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { root: Value::Struct(Vec::new()) }
    }
}

impl Parameters {
    /// Returns the value or the branch at `key`, which must be a full name.
    pub(super) fn get(&self, key: &str) -> Option<&Value> {
        parts(key).try_fold(&self.root, |branch, part| branch.member(part))
    }

    /// Sets the parameter `key`, or replaces the whole branch `key`. A leaf on the path to `key` is
    /// replaced by a branch. Returns false if `key` is the root and `value` is not a struct.
    pub(super) fn set(&mut self, key: &str, value: Value) -> bool {
        if key == "/" {
            let branch = matches!(value, Value::Struct(_));
            if branch {
                self.root = value;
            }
            return branch;
        }
        let mut place = &mut self.root;
        for part in parts(key) {
            if !matches!(place, Value::Struct(_)) {
                *place = Value::Struct(Vec::new());
            }
            let Value::Struct(members) = place else {
                return false;
            };
            let known = members.iter().position(|(name, _)| name == part);
            let at = known.unwrap_or_else(|| {
                members.push((part.to_owned(), Value::Struct(Vec::new())));
                members.len() - 1
            });
            place = &mut members[at].1;
        }
        *place = value;
        true
    }

    /// Removes the parameter or the branch `key`. Returns false if `key` does not exist or is the
    /// root.
    pub(super) fn delete(&mut self, key: &str) -> bool {
        let full = canonical(key);
        let Some((branch, leaf)) = full.rsplit_once('/').filter(|(_, leaf)| !leaf.is_empty())
        else {
            return false;
        };
        let branch = parts(branch).try_fold(&mut self.root, |place, part| match place {
            Value::Struct(members) => {
                members.iter_mut().find(|(name, _)| name == part).map(|(_, value)| value)
            }
            _ => None,
        });
        let Some(Value::Struct(members)) = branch else {
            return false;
        };
        let before = members.len();
        members.retain(|(name, _)| name != leaf);
        members.len() < before
    }

    /// Returns the full names of all leaves in depth-first order.
    pub(super) fn names(&self) -> Vec<String> {
        let mut names = Vec::new();
        append_names(&mut names, "/", &self.root);
        names
    }

    /// Looks for the first part of `key` in `namespace`, then in each namespace above it. Returns
    /// the full name of `key` in the first namespace that has that part. As in rosmaster, the other
    /// parts of `key` need not exist.
    pub(super) fn search(&self, namespace: &str, key: &str) -> Option<String> {
        if key.starts_with('/') {
            return self.get(key).map(|_| key.to_owned());
        }
        let first = parts(key).next()?;
        let spaces: Vec<&str> = parts(namespace).collect();
        (0..=spaces.len()).rev().find_map(|depth| {
            let space: String = spaces[..depth].iter().flat_map(|part| ["/", part]).collect();
            self.get(&format!("{space}/{first}")).map(|_| format!("{space}/{key}"))
        })
    }
}

/// Appends the full names of all leaves of `value`, whose name with a trailing slash is `branch`.
fn append_names(names: &mut Vec<String>, branch: &str, value: &Value) {
    let Value::Struct(members) = value else {
        return;
    };
    for (name, member) in members {
        if matches!(member, Value::Struct(_)) {
            append_names(names, &format!("{branch}{name}/"), member);
        } else {
            names.push(format!("{branch}{name}"));
        }
    }
}

/// Returns the names between the slashes of `key`.
fn parts(key: &str) -> impl Iterator<Item = &str> {
    key.split('/').filter(|part| !part.is_empty())
}

/// A changed parameter, and the subscribers to be notified of it.
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
    let mut notify = |registrants: Vec<Registrant>, key: &str, value: &Value| {
        updates.push(ParameterUpdate { registrants, key: key.to_owned(), value: value.clone() });
    };
    for (watched, registrants) in subscribers {
        let space = with_slash(watched);
        let mut others = registrants.clone();
        if key.starts_with(&space) {
            others.retain(|registrant| Some(registrant.node.as_str()) != changer);
            notify(others, &key, value);
        } else if is_branch
            && space.starts_with(&key)
            && !changed.iter().any(|(name, _)| name == watched)
        {
            notify(others, watched, &Value::Struct(Vec::new()));
        }
    }
    for (name, member) in changed {
        if let Some((_, registrants)) = subscribers.iter().find(|(watched, _)| *watched == name) {
            notify(registrants.clone(), &name, member);
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

/// Returns `key` in canonical form with a trailing slash, as subscriptions are stored.
pub(super) fn with_slash(key: &str) -> String {
    if key == "/" { key.to_owned() } else { format!("{}/", canonical(key)) }
}
