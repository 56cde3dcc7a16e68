//! Options of a node (name, master, network address, remaps), set in code or read from environment
//! and command line.

use std::path::PathBuf;

use crate::names::{NameError, Names};

/// URI of the master if neither the environment nor the command line sets another.
pub const DEFAULT_MASTER_URI: &str = "http://localhost:11311/";

/// Options of [`Node::start`](crate::Node::start).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeOptions {
    /// Node name: relative to `namespace` (`bridge`) or global (`/lab/bridge`).
    pub name: String,
    /// Namespace in which relative names are resolved, such as `/` or `/lab`.
    pub namespace: String,
    /// XML-RPC URI of the master, `http://HOST:PORT/`.
    pub master_uri: String,
    /// Host name or address at which other nodes reach this node. `None` selects the address of the
    /// network interface on the route to the master. If `host` is a loopback address, only programs
    /// on this machine reach the node.
    pub host: Option<String>,
    /// Whether to listen on IPv6 in addition to IPv4 if `host` is a name. If `host` is an IPv6
    /// address, the node listens on IPv6 in any case.
    pub ipv6: bool,
    /// Name remaps as pairs (from, to): a name that resolves to `from` is replaced by `to`.
    pub remaps: Vec<(String, String)>,
    /// Log file that `roslaunch` passes with `__log:=`. The node itself writes no log file.
    pub log: Option<PathBuf>,
}

impl NodeOptions {
    /// Creates options with the namespace `/`, the default address and no remaps.
    pub fn new(name: &str, master_uri: &str) -> Self {
        Self {
            name: name.to_owned(),
            namespace: "/".to_owned(),
            master_uri: master_uri.to_owned(),
            host: None,
            ipv6: false,
            remaps: Vec::new(),
            log: None,
        }
    }

    /// Reads options from the environment and the arguments of this process, as
    /// [`NodeOptions::parse`] does. Also returns the arguments that are not for ROS, starting with
    /// the program's name.
    pub fn from_env_and_args(default_name: &str) -> (Self, Vec<String>) {
        let arguments = std::env::args_os().map(|text| text.to_string_lossy().into_owned());
        Self::parse(default_name, |name| std::env::var(name).ok(), arguments)
    }

    /// Reads options from environment variables and from command-line arguments. Arguments override
    /// variables.
    ///
    /// The variables are `ROS_MASTER_URI`, `ROS_IP`, `ROS_HOSTNAME` (which overrides `ROS_IP`),
    /// `ROS_NAMESPACE` and `ROS_IPV6`; the arguments `__name:=`, `__ns:=`, `__ip:=`,
    /// `__hostname:=`, `__master:=`, `__log:=` and `from:=to`. Also returns all other arguments,
    /// including `_parameter:=value`, because private parameters are left to the program.
    pub fn parse(
        default_name: &str,
        variable: impl Fn(&str) -> Option<String>,
        arguments: impl IntoIterator<Item = String>,
    ) -> (Self, Vec<String>) {
        let variable = |name: &str| variable(name).filter(|value| !value.is_empty());
        let master_uri = variable("ROS_MASTER_URI");
        let mut options =
            Self::new(default_name, master_uri.as_deref().unwrap_or(DEFAULT_MASTER_URI));
        options.host = variable("ROS_HOSTNAME").or_else(|| variable("ROS_IP"));
        options.ipv6 = variable("ROS_IPV6").is_some_and(|value| value == "on");
        if let Some(namespace) = variable("ROS_NAMESPACE") {
            options.namespace = namespace;
        }
        let mut others = Vec::new();
        for argument in arguments {
            let pair =
                argument.split_once(":=").filter(|(from, to)| !from.is_empty() && !to.is_empty());
            let Some((from, to)) = pair else {
                others.push(argument);
                continue;
            };
            let to = to.trim().to_owned();
            match from {
                "__name" => options.name = to,
                "__ns" => options.namespace = to,
                "__ip" | "__hostname" => options.host = Some(to),
                "__master" => options.master_uri = to,
                "__log" => options.log = Some(PathBuf::from(to)),
                _ if from.starts_with('_') || from.starts_with('-') => others.push(argument),
                _ => options.remaps.push((from.trim().to_owned(), to)),
            }
        }
        (options, others)
    }

    /// Resolves the node's full name and both names of each remap.
    ///
    /// # Errors
    /// [`NameError`] if one of them is not a ROS name.
    pub fn names(&self) -> Result<Names, NameError> {
        Names::new(&self.namespace, &self.name, &self.remaps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(variables: &[(&str, &str)], arguments: &[&str]) -> (NodeOptions, Vec<String>) {
        let variable = |wanted: &str| {
            variables.iter().find(|(name, _)| *name == wanted).map(|(_, v)| (*v).to_owned())
        };
        NodeOptions::parse("bridge", variable, arguments.iter().map(|a| (*a).to_owned()))
    }

    #[test]
    fn defaults_are_a_local_master_and_the_given_name() {
        let (options, others) = parse(&[("ROS_MASTER_URI", "")], &["prog", "--port", "x"]);
        assert_eq!(options, NodeOptions::new("bridge", DEFAULT_MASTER_URI));
        assert_eq!(others, ["prog", "--port", "x"]);
    }

    #[test]
    fn arguments_override_variables_and_hostname_overrides_ip() {
        let variables = [
            ("ROS_MASTER_URI", "http://master:1/"),
            ("ROS_IP", "10.0.0.1"),
            ("ROS_HOSTNAME", "robot"),
            ("ROS_NAMESPACE", "/lab"),
        ];
        let (options, _) = parse(&variables, &[]);
        assert_eq!(options.host.as_deref(), Some("robot"));
        assert_eq!(options.master_uri, "http://master:1/");
        assert_eq!(options.names().unwrap().node(), "/lab/bridge");
        let (options, others) = parse(
            &variables,
            &["__name:=amp", "__ns:=/x", "__ip:=10.0.0.2", "__log:=/l.log", "a:=b", "_p:=1"],
        );
        assert_eq!(options.host.as_deref(), Some("10.0.0.2"));
        assert_eq!(options.log, Some(PathBuf::from("/l.log")));
        assert_eq!(others, ["_p:=1"]);
        let names = options.names().unwrap();
        assert_eq!(names.node(), "/x/amp");
        assert_eq!(names.resolve("a").unwrap(), "/x/b");
    }
}
