//! Names of the ROS graph: global `/a/b`, relative `b`, private `~c`, and remaps.

use std::collections::HashMap;

/// A name that ROS does not allow.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name:?} is not a ROS name: it starts with a letter, / or ~ and goes on with letters, \
     digits, _ and /, without an empty part"
)]
pub struct NameError {
    /// What was given.
    pub name: String,
}

/// A node's own name and the remaps it was started with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Names {
    node: String,
    remaps: HashMap<String, String>,
}

impl Names {
    /// The node `name` in `namespace`; each remap is (from, to) as written on a command line.
    ///
    /// # Errors
    /// A name is not a ROS name, or the node's name is private.
    pub(crate) fn new(
        namespace: &str,
        name: &str,
        remaps: &[(String, String)],
    ) -> Result<Self, NameError> {
        let error = |name: &str| NameError {
            name: name.to_owned(),
        };
        if name.is_empty() || name.starts_with('~') || namespace.starts_with('~') {
            return Err(error(name));
        }
        check(name)?;
        if !matches!(namespace, "" | "/") {
            check(namespace)?;
        }
        let joined = if name.starts_with('/') {
            name.to_owned()
        } else {
            format!("/{namespace}/{name}")
        };
        let node = canonical(&joined);
        let mut resolved = HashMap::new();
        for (from, to) in remaps {
            check(from)?;
            check(to)?;
            resolved.insert(resolve(from, &node), resolve(to, &node));
        }
        Ok(Self {
            node,
            remaps: resolved,
        })
    }

    /// The node's full name, `/namespace/name`.
    pub(crate) fn node(&self) -> &str {
        &self.node
    }

    /// The full name, remapped.
    ///
    /// # Errors
    /// `name` is not a ROS name.
    pub(crate) fn resolve(&self, name: &str) -> Result<String, NameError> {
        check(name)?;
        let full = resolve(name, &self.node);
        Ok(self.remaps.get(&full).cloned().unwrap_or(full))
    }
}

fn check(name: &str) -> Result<(), NameError> {
    let mut characters = name.chars();
    let first = characters
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || matches!(c, '/' | '~'));
    let rest = characters.all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '/'));
    let parts = !name.contains("//") && !matches!(name, "/" | "~" | "~/");
    if first && rest && parts {
        Ok(())
    } else {
        Err(NameError {
            name: name.to_owned(),
        })
    }
}

/// The full name of `name` as `caller` sees it, without checks and remaps: what rosmaster does
/// with a name it is given.
pub(crate) fn resolve(name: &str, caller: &str) -> String {
    if name.is_empty() {
        return namespace(caller);
    }
    let name = canonical(name);
    if name.starts_with('/') {
        name
    } else if let Some(private) = name.strip_prefix('~') {
        canonical(&format!("{caller}/{private}"))
    } else {
        format!("{}{name}", namespace(caller))
    }
}

/// Everything up to the last part, with its trailing slash: `/a/b` is in `/a/`.
fn namespace(name: &str) -> String {
    let name = name.strip_suffix('/').unwrap_or(name);
    name.rfind('/')
        .map_or_else(|| "/".to_owned(), |slash| name[..=slash].to_owned())
}

/// Without empty parts and without a trailing slash.
pub(crate) fn canonical(name: &str) -> String {
    let parts: Vec<&str> = name.split('/').filter(|part| !part.is_empty()).collect();
    let joined = parts.join("/");
    if name.starts_with('/') {
        format!("/{joined}")
    } else {
        joined
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remap(from: &str, to: &str) -> (String, String) {
        (from.to_owned(), to.to_owned())
    }

    #[test]
    fn relative_private_and_global_names_resolve_as_in_rosgraph() {
        let names = Names::new("/lab", "amp", &[]).unwrap();
        assert_eq!(names.node(), "/lab/amp");
        for (name, full) in [
            ("neurodata", "/lab/neurodata"),
            ("/neurodata", "/neurodata"),
            ("~start", "/lab/amp/start"),
            ("a/b/", "/lab/a/b"),
        ] {
            assert_eq!(names.resolve(name).unwrap(), full);
        }
    }

    #[test]
    fn remaps_apply_to_the_full_name_however_it_is_written() {
        let remaps = [remap("neurodata", "/other"), remap("~start", "go")];
        let names = Names::new("lab", "amp", &remaps).unwrap();
        for name in ["neurodata", "/lab/neurodata"] {
            assert_eq!(names.resolve(name).unwrap(), "/other");
        }
        assert_eq!(names.resolve("~start").unwrap(), "/lab/go");
        assert_eq!(names.resolve("/neurodata").unwrap(), "/neurodata");
    }

    #[test]
    fn what_ros_does_not_allow_is_refused() {
        let names = Names::new("", "amp", &[]).unwrap();
        for name in ["", "/", "~", "1a", "a b", "a:b", "a//b", "ä", "a-b"] {
            assert_eq!(
                names.resolve(name),
                Err(NameError {
                    name: name.to_owned()
                })
            );
        }
        assert!(Names::new("", "~amp", &[]).is_err());
        assert!(Names::new("~x", "amp", &[]).is_err());
    }
}
