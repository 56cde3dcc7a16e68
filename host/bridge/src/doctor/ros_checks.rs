//! Checks of ROS: the master, this machine's own address, other publishers, and simulated time.

use std::net::IpAddr;

use neuro_ros::ros1::host_addresses;

use crate::doctor::Check;

/// The facts about ROS on which the checks are based.
#[derive(Clone, Debug)]
pub(crate) struct RosFacts {
    pub(crate) master_uri: String,
    /// Whether the master runs on this machine; `None` if the name of its host does not resolve.
    pub(crate) master_is_here: Option<bool>,
    /// What the master reports, or the reason why it does not answer.
    pub(crate) master: Result<MasterState, String>,
    /// The host in `ROS_HOSTNAME` or `ROS_IP`; `None` if neither is set.
    pub(crate) own_host: Option<OwnHost>,
}

/// What the ROS master reports about the bridge's names.
#[derive(Clone, Debug, Default)]
pub(crate) struct MasterState {
    /// Full name of the bridge's node.
    pub(crate) node: String,
    /// Whether a node with the name in `node` is registered at the master.
    pub(crate) node_is_registered: bool,
    /// The bridge's topics of frames, each with the nodes that publish it at present.
    pub(crate) publishers: Vec<(String, Vec<String>)>,
    /// Value of the ROS parameter `/use_sim_time`.
    pub(crate) use_sim_time: bool,
}

/// Host name or address at which other nodes shall reach the bridge.
#[derive(Clone, Debug)]
pub(crate) struct OwnHost {
    pub(crate) name: String,
    /// Addresses of the host, each with whether it is this machine's; or why the host has none.
    pub(crate) addresses: Result<Vec<(IpAddr, bool)>, String>,
}

impl OwnHost {
    /// Looks up the addresses of the host `name`.
    pub(crate) async fn find(name: &str) -> OwnHost {
        let addresses = host_addresses(name).await;
        OwnHost { name: name.to_owned(), addresses: addresses.map_err(|error| error.reason.into()) }
    }
}

/// Returns whether the ROS master runs on this machine; `None` if the name of its host does not
/// resolve.
pub(crate) async fn master_is_here(uri: &str) -> Option<bool> {
    let addresses = host_addresses(host_of(uri)?).await.ok()?;
    Some(addresses.iter().any(|(_, is_own)| *is_own))
}

/// Returns HOST of `http://HOST:PORT/`; an IPv6 address without its brackets.
fn host_of(uri: &str) -> Option<&str> {
    let (_, rest) = uri.split_once("://")?;
    let (host, _) = rest.rsplit_once(':')?;
    Some(host.trim_start_matches('[').trim_end_matches(']'))
}

/// What to do about a host name in `ROS_MASTER_URI` that does not resolve.
pub(crate) const SET_MASTER_URI: &str =
    "export ROS_MASTER_URI=http://ADDRESS:11311/, or add the name to /etc/hosts";

/// Checks the ROS master, the bridge's own address, other publishers and simulated time.
pub(crate) fn check_ros(facts: &RosFacts) -> Vec<Check> {
    let mut checks = vec![match &facts.master {
        Ok(_) => Check::ok("ROS master", facts.master_uri.as_str()),
        Err(why) if facts.master_is_here.is_none() => {
            Check::error("ROS master", why, SET_MASTER_URI)
        }
        Err(why) => Check::error(
            "ROS master",
            why,
            "roscore (or start the machine that runs it, and: export ROS_MASTER_URI=http://HOST:11311/)",
        ),
    }];
    checks.push(check_own_host(facts.own_host.as_ref(), facts.master_is_here));
    if let Ok(master) = &facts.master {
        checks.push(check_publishers(master));
        checks.push(if master.use_sim_time {
            Check::warning(
                "use_sim_time",
                "is true: the bridge stamps with the PC's clock, and other nodes do not",
                "rosparam set /use_sim_time false, then restart the other nodes",
            )
        } else {
            Check::ok("use_sim_time", "is not set")
        });
    }
    checks
}

/// Checks whether other nodes can connect to the bridge at `own_host`, if the user has set it.
/// `master_is_here` is as in [`RosFacts`].
pub(crate) fn check_own_host(own_host: Option<&OwnHost>, master_is_here: Option<bool>) -> Check {
    const NAME: &str = "own address";
    const SET_IP: &str = "unset ROS_HOSTNAME; export ROS_IP=$(hostname -I | cut -d' ' -f1)";
    let Some(OwnHost { name, addresses }) = own_host else {
        return Check::ok(NAME, "chosen by the route to the master");
    };
    let addresses = match addresses {
        Ok(addresses) => addresses,
        Err(why) => {
            let finding =
                format!("ROS_HOSTNAME or ROS_IP is {name}, which does not resolve: {why}");
            return Check::error(NAME, finding, SET_IP);
        }
    };
    let Some((address, _)) = addresses.iter().find(|(_, is_own)| *is_own) else {
        let foreign = addresses.iter().map(|(address, _)| address.to_string());
        let foreign = foreign.collect::<Vec<String>>().join(", ");
        let finding = format!(
            "ROS_HOSTNAME or ROS_IP is {name} ({foreign}), which is no address of this machine"
        );
        return Check::error(NAME, finding, SET_IP);
    };
    let loopback = addresses.iter().all(|(address, _)| address.is_loopback());
    if loopback && master_is_here == Some(false) {
        let finding = format!(
            "ROS_HOSTNAME or ROS_IP is {name} ({address}), and the master is on another machine, \
             which cannot reach the bridge there"
        );
        return Check::error(NAME, finding, SET_IP);
    }
    Check::ok(NAME, format!("{name} ({address})"))
}

fn check_publishers(master: &MasterState) -> Check {
    const NAME: &str = "topics";
    let others = master.publishers.iter().find_map(|(topic, nodes)| {
        let other = nodes.iter().find(|node| **node != master.node)?;
        Some((topic, other))
    });
    if let Some((topic, other)) = others {
        return Check::error(
            NAME,
            format!("{other} publishes {topic}, so the bridge does not publish this topic"),
            format!("rosnode kill {other}, or start the bridge with --topic-prefix /NAME"),
        );
    }
    if master.node_is_registered {
        let node = &master.node;
        return Check::warning(
            NAME,
            format!("a node {node} runs already, such as a bridge; it ends when the bridge starts"),
            format!("rosnode kill {node}, or start the bridge with --topic-prefix /NAME"),
        );
    }
    Check::ok(NAME, "no other node publishes the bridge's topics")
}

#[cfg(test)]
mod tests {
    use super::{MasterState, OwnHost, RosFacts, check_ros, host_of};
    use crate::doctor::{Check, Level};

    fn facts() -> RosFacts {
        RosFacts {
            master_uri: "http://localhost:11311/".to_owned(),
            master_is_here: Some(true),
            master: Ok(MasterState {
                node: "/acquisition".to_owned(),
                node_is_registered: false,
                publishers: vec![("/encoded".to_owned(), Vec::new())],
                use_sim_time: false,
            }),
            own_host: None,
        }
    }

    fn host(name: &str, addresses: &[(&str, bool)]) -> OwnHost {
        let addresses = addresses.iter();
        let addresses = addresses.map(|(address, own)| (address.parse().unwrap(), *own));
        OwnHost { name: name.to_owned(), addresses: Ok(addresses.collect()) }
    }

    /// Returns name and level of the only check that is not ok, and its finding with the remedy.
    fn only_fault(facts: &RosFacts) -> (&'static str, Level, String) {
        let mut wrong = check_ros(facts);
        wrong.retain(|check| check.level != Level::Ok);
        assert_eq!(wrong.len(), 1, "{wrong:?}");
        let Check { name, level, finding, remedy } = wrong.remove(0);
        (name, level, format!("{finding}; {}", remedy.unwrap()))
    }

    #[test]
    fn a_running_master_without_other_publishers_passes() {
        let own = host("10.0.0.5", &[("10.0.0.5", true)]);
        let several = host("lab", &[("10.0.0.9", false), ("127.0.1.1", true)]);
        for own_host in [None, Some(own), Some(several)] {
            let facts = RosFacts { own_host, ..facts() };
            let checks = check_ros(&facts);
            let all_ok = checks.iter().all(|check| check.level == Level::Ok);
            assert!(all_ok, "{checks:?}");
        }
    }

    #[test]
    fn a_master_whose_host_does_not_resolve_is_not_started_with_roscore() {
        let facts = RosFacts {
            master: Err("the host name lab does not resolve".to_owned()),
            master_is_here: None,
            ..facts()
        };
        let (name, _, text) = only_fault(&facts);
        assert_eq!(name, "ROS master");
        assert!(text.contains("export ROS_MASTER_URI=") && !text.contains("roscore"));
        assert_eq!(host_of("http://[::1]:11311/"), Some("::1"));
        assert_eq!(host_of("http://lab:11311"), Some("lab"));
    }

    #[test]
    fn a_loopback_address_is_an_error_if_the_master_is_on_another_machine() {
        let facts = RosFacts {
            own_host: Some(host("labpc", &[("127.0.1.1", true)])),
            master_is_here: Some(false),
            ..facts()
        };
        let (name, level, text) = only_fault(&facts);
        assert_eq!((name, level), ("own address", Level::Error));
        assert!(text.contains("the master is on another machine"), "{text}");
        assert!(text.contains("export ROS_IP="), "{text}");
    }

    #[test]
    fn another_publisher_is_an_error_and_a_running_bridge_a_warning() {
        for (node, level, expected) in [
            ("/filter", Level::Error, "rosnode kill /filter"),
            ("/acquisition", Level::Warning, "rosnode kill /acquisition"),
        ] {
            let mut facts = facts();
            let publishers = vec![("/encoded".to_owned(), vec![node.to_owned()])];
            let master = facts.master.as_mut().unwrap();
            master.publishers = publishers;
            master.node_is_registered = true;
            let fault = only_fault(&facts);
            assert_eq!((fault.0, fault.1), ("topics", level));
            assert!(fault.2.contains(expected), "{}", fault.2);
        }
    }
}
