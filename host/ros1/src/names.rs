//! Resolves ROS graph names (global `/a/b`, relative `b`, private `~c`) and applies remaps.

use std::collections::HashMap;

/// Error for a name that violates the syntax of ROS graph names.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name} is not a ROS name: it starts with a letter, / or ~ and goes on with letters, \
     digits, _ and /, without an empty part"
)]
pub struct NameError {
    /// The rejected name, as the caller passed it.
    pub name: String,
}

/// Full name of a node and its remaps. All other names of the node are resolved from these, by
/// rules that hold for ROS 1 and ROS 2.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    node: String,
    remaps: HashMap<String, String>,
}

impl Names {
    /// Resolves the node's `name` in `namespace`, then both names of each remap. A remap is a pair
    /// (from, to), which `from:=to` sets on a ROS command line.
    ///
    /// # Errors
    /// [`NameError`] if a name is not a ROS name, or if `name` or `namespace` starts with `~`.
    pub(crate) fn new(
        namespace: &str,
        name: &str,
        remaps: &[(String, String)],
    ) -> Result<Self, NameError> {
        let error = |name: &str| NameError { name: name.to_owned() };
        if name.is_empty() || name.starts_with('~') || namespace.starts_with('~') {
            return Err(error(name));
        }
        check(name)?;
        if !matches!(namespace, "" | "/") {
            check(namespace)?;
        }
        let joined =
            if name.starts_with('/') { name.to_owned() } else { format!("/{namespace}/{name}") };
        let node = canonical(&joined);
        let mut resolved = HashMap::new();
        for (from, to) in remaps {
            check(from)?;
            check(to)?;
            resolved.insert(resolve(from, &node), resolve(to, &node));
        }
        Ok(Self { node, remaps: resolved })
    }

    /// Full name of the node, `/namespace/name`.
    pub fn node(&self) -> &str {
        &self.node
    }

    /// Returns the full name of `name` after remapping.
    ///
    /// # Errors
    /// [`NameError`] if `name` is not a ROS name.
    pub fn resolve(&self, name: &str) -> Result<String, NameError> {
        check(name)?;
        let full = resolve(name, &self.node);
        Ok(self.remaps.get(&full).cloned().unwrap_or(full))
    }
}

fn check(name: &str) -> Result<(), NameError> {
    let mut characters = name.chars();
    let first =
        characters.next().is_some_and(|c| c.is_ascii_alphabetic() || matches!(c, '/' | '~'));
    let rest = characters.all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '/'));
    let parts = !name.contains("//") && !matches!(name, "/" | "~" | "~/");
    if first && rest && parts { Ok(()) } else { Err(NameError { name: name.to_owned() }) }
}

/// Returns the full name of `name` as the node `caller` uses it, without checking the syntax or
/// applying remaps. rosmaster resolves the names in calls from nodes in the same way.
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

/// Returns the namespace of a name with its trailing slash: `/a/` for `/a/b`.
fn namespace(name: &str) -> String {
    let name = name.strip_suffix('/').unwrap_or(name);
    name.rfind('/').map_or_else(|| "/".to_owned(), |slash| name[..=slash].to_owned())
}

/// Removes empty parts and the trailing slash: `/a//b/` becomes `/a/b`.
pub(crate) fn canonical(name: &str) -> String {
    let parts: Vec<&str> = name.split('/').filter(|part| !part.is_empty()).collect();
    let joined = parts.join("/");
    if name.starts_with('/') { format!("/{joined}") } else { joined }
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
    fn remaps_apply_to_every_spelling_of_a_name() {
        let remaps = [remap("neurodata", "/other"), remap("~start", "go")];
        let names = Names::new("lab", "amp", &remaps).unwrap();
        for name in ["neurodata", "/lab/neurodata"] {
            assert_eq!(names.resolve(name).unwrap(), "/other");
        }
        assert_eq!(names.resolve("~start").unwrap(), "/lab/go");
        assert_eq!(names.resolve("/neurodata").unwrap(), "/neurodata");
    }

    #[test]
    fn names_with_wrong_syntax_are_refused() {
        let names = Names::new("", "amp", &[]).unwrap();
        for name in ["", "/", "~", "1a", "a b", "a:b", "a//b", "ä", "a-b"] {
            assert_eq!(names.resolve(name), Err(NameError { name: name.to_owned() }));
        }
        assert!(Names::new("", "~amp", &[]).is_err());
        assert!(Names::new("~x", "amp", &[]).is_err());
    }
}
