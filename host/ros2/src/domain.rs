//! A DDS domain, and the reasons why a node cannot join it.

use std::net::Ipv4Addr;

use ros2_client::Name;
use ros2_client::names::NameError;
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use thiserror::Error;

/// Largest id of a domain whose ports exist; see the port mapping of DDSI-RTPS.
pub(crate) const MAX_DOMAIN: u16 = 232;

/// The DDS domain of a node: which other nodes it can communicate with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// Number of the domain, 0..=232, as in `ROS_DOMAIN_ID`.
    pub id: u16,
    /// Whether the node communicates only with nodes on this machine.
    pub localhost_only: bool,
}

impl Domain {
    pub(crate) fn join(self) -> Result<DomainParticipant, Ros2Error> {
        if self.id > MAX_DOMAIN {
            return Err(Ros2Error::Domain(self.id));
        }
        let mut participant = DomainParticipantBuilder::new(self.id);
        if self.localhost_only {
            participant = participant.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        participant.build().map_err(Ros2Error::network)
    }

    /// Checks that the domain can be joined: joins it and leaves it again.
    ///
    /// # Errors
    ///
    /// [`Ros2Error`] if the domain does not exist, or the network cannot be used.
    pub fn check(self) -> Result<(), Ros2Error> {
        self.join().map(drop)
    }
}

/// Reason why a node cannot start, or why a topic or service cannot be created.
#[derive(Debug, Error)]
pub enum Ros2Error {
    /// The name is not allowed in ROS 2.
    #[error(
        "{0} is no ROS 2 name ({1}): use letters, digits and single underscores between slashes"
    )]
    Name(String, String),
    /// The domain does not exist.
    #[error("there is no domain {0}; ROS_DOMAIN_ID is 0 to 232")]
    Domain(u16),
    /// The network cannot be used.
    #[error(
        "ROS 2 cannot use the network: {0}; choose another ROS_DOMAIN_ID, or bring an interface up"
    )]
    Network(String),
    /// No thread can be started.
    #[error("the thread of the ROS 2 node does not start: {0}")]
    Thread(#[from] std::io::Error),
}

impl Ros2Error {
    pub(crate) fn network(error: impl std::fmt::Display) -> Ros2Error {
        Ros2Error::Network(error.to_string())
    }
}

impl From<ros2_client::CreateError> for Ros2Error {
    fn from(error: ros2_client::CreateError) -> Ros2Error {
        Ros2Error::network(error)
    }
}

/// Parses the full name of a topic or service.
pub(crate) fn name(full: &str) -> Result<Name, Ros2Error> {
    let wrong = |error: NameError| Ros2Error::Name(full.to_owned(), error.to_string());
    Name::parse(full).map_err(wrong)
}
