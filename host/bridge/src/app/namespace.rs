//! The namespace of the bridge's node, topics and services.

/// Namespace from `ROS_NAMESPACE` or `__ns:=`, extended or replaced by `--topic-prefix`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Namespace {
    /// Full name without a slash at its end; empty for the namespace `/`.
    name: String,
}

impl Namespace {
    /// Joins ROS's namespace and a prefix. A prefix that starts with a slash replaces the namespace.
    pub fn new(ros: &str, prefix: &str) -> Namespace {
        let joined = if prefix.starts_with('/') {
            prefix.to_owned()
        } else {
            format!("{ros}/{prefix}")
        };
        let parts = joined.split('/').filter(|part| !part.is_empty());
        let name = parts.fold(String::new(), |name, part| format!("{name}/{part}"));
        Namespace { name }
    }

    /// Returns the namespace as a ROS name, such as `/left` or `/`.
    pub fn as_ros_name(&self) -> &str {
        if self.name.is_empty() {
            "/"
        } else {
            &self.name
        }
    }

    /// Returns the full name of `name` in this namespace: `/left/encoded` for `encoded` and
    /// `/encoded`.
    pub fn resolve(&self, name: &str) -> String {
        format!("{}/{}", self.name, name.trim_start_matches('/'))
    }

    /// Returns the name of a status in `/diagnostics`, which all bridges share: `corticode: link`
    /// becomes `corticode /left: link`.
    pub fn status_name(&self, name: &str) -> String {
        match name.split_once(": ") {
            Some((program, part)) if !self.name.is_empty() => {
                format!("{program} {}: {part}", self.name)
            }
            _ => name.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Namespace;

    #[test]
    fn without_a_namespace_all_names_are_those_that_rosneuro_asks_for() {
        for (ros, prefix) in [("/", ""), ("", ""), ("/", "/")] {
            let none = Namespace::new(ros, prefix);
            assert_eq!(none.as_ros_name(), "/");
            assert_eq!(
                none.resolve("/acquisition/get_info"),
                "/acquisition/get_info"
            );
            assert_eq!(none.status_name("corticode: link"), "corticode: link");
        }
    }

    #[test]
    fn a_prefix_extends_the_namespace_and_an_absolute_one_replaces_it() {
        for (ros, prefix, expected) in [
            ("/lab", "", "/lab"),
            ("lab", "left", "/lab/left"),
            ("/lab", "/left/", "/left"),
        ] {
            let namespace = Namespace::new(ros, prefix);
            assert_eq!(namespace.as_ros_name(), expected);
            assert_eq!(namespace.resolve("encoded"), format!("{expected}/encoded"));
            let status = format!("corticode {expected}: link");
            assert_eq!(namespace.status_name("corticode: link"), status);
        }
    }
}
