//! Checks of ROS 2: settings in its environment variables that the bridge's node does not support.

use crate::doctor::Check;

/// Largest domain whose UDP ports are outside the range that Linux assigns to other programs.
const MAX_SAFE_DOMAIN: u8 = 101;

/// The facts about ROS 2 on which the checks are based.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ros2Facts {
    pub(crate) domain: u8,
    pub(crate) localhost_only: bool,
    /// Why a node cannot start in this domain; `None` if it can.
    pub(crate) fault: Option<String>,
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    pub(crate) range: Option<String>,
    /// `RMW_IMPLEMENTATION`.
    pub(crate) middleware: Option<String>,
    /// `ROS_DISTRO`.
    pub(crate) distribution: Option<String>,
    /// Names of the variables of [`UNREAD`] that are set.
    pub(crate) unread: Vec<&'static str>,
}

/// Environment variables for peers, profiles or security, which the bridge's node does not read.
pub(crate) const UNREAD: [&str; 6] = [
    "ROS_STATIC_PEERS",
    "ROS_DISCOVERY_SERVER",
    "ROS_SECURITY_ENABLE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "CYCLONEDDS_URI",
];

/// Checks domain, discovery, middleware and distribution.
pub(crate) fn check_ros2(facts: &Ros2Facts) -> Vec<Check> {
    let mut checks = vec![check_domain(facts), check_middleware(facts)];
    if facts.range.as_deref() == Some("OFF") {
        checks.push(Check::warning(
            "ROS 2 range",
            "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF, which the bridge takes for LOCALHOST",
            "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST",
        ));
    }
    if !facts.unread.is_empty() {
        let names = facts.unread.join(" and ");
        checks.push(Check::warning(
            "ROS 2 settings",
            format!("{names} restrict who meets, and the bridge's node does not read them"),
            format!(
                "unset {} for all nodes, if they do not meet the bridge",
                facts.unread.join(" ")
            ),
        ));
    }
    if let Some("humble" | "galactic" | "foxy") = facts.distribution.as_deref() {
        checks.push(Check::warning(
            "ROS 2 release",
            "topics and services work, but `ros2 node list` of Humble and earlier does not show the bridge",
            "ros2 topic list",
        ));
    }
    checks
}

fn check_domain(facts: &Ros2Facts) -> Check {
    const NAME: &str = "ROS 2 domain";
    let Ros2Facts { domain, .. } = facts;
    if let Some(fault) = &facts.fault {
        let remedy = "export ROS_DOMAIN_ID=42 for all nodes, or end programs of this domain";
        return Check::error(NAME, fault, remedy);
    }
    if *domain > MAX_SAFE_DOMAIN {
        return Check::warning(
            NAME,
            format!("Linux gives ports of domain {domain} to other programs too"),
            "export ROS_DOMAIN_ID=42 for all nodes: any number from 0 to 101",
        );
    }
    let place = if facts.localhost_only { "on this machine only" } else { "in this network" };
    Check::ok(NAME, format!("{domain}, with nodes {place}"))
}

fn check_middleware(facts: &Ros2Facts) -> Check {
    const NAME: &str = "ROS 2 RMW";
    match facts.middleware.as_deref() {
        None | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp") => {
            Check::ok(NAME, "services are those of Fast DDS")
        }
        Some("rmw_cyclonedds_cpp") => Check::ok(NAME, "services are those of Cyclone DDS"),
        Some(name @ "rmw_zenoh_cpp") => Check::error(
            NAME,
            format!("{name} speaks no DDS, so no node with it meets the bridge"),
            "export RMW_IMPLEMENTATION=rmw_fastrtps_cpp for all nodes",
        ),
        Some(name) => Check::unknown(
            NAME,
            format!("{name} was not tried with the bridge"),
            "export RMW_IMPLEMENTATION=rmw_fastrtps_cpp for all nodes",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Level::{self, Error, Warning};

    fn levels(facts: &Ros2Facts) -> Vec<Level> {
        check_ros2(facts).iter().map(|check| check.level).collect()
    }

    #[test]
    fn an_ordinary_environment_is_in_order() {
        assert_eq!(levels(&Ros2Facts::default()), [Level::Ok; 2]);
    }

    #[test]
    fn what_keeps_nodes_from_meeting_is_found() {
        let facts = Ros2Facts {
            domain: 102,
            middleware: Some("rmw_zenoh_cpp".to_owned()),
            range: Some("OFF".to_owned()),
            distribution: Some("humble".to_owned()),
            unread: vec!["ROS_STATIC_PEERS"],
            ..Ros2Facts::default()
        };
        assert_eq!(levels(&facts), [Warning, Error, Warning, Warning, Warning]);
        let facts = Ros2Facts { fault: Some("no network".to_owned()), ..Ros2Facts::default() };
        assert_eq!(levels(&facts), [Error, Level::Ok]);
    }
}
