//! The subcommand `master`: runs a ROS master.

use std::net::SocketAddr;

use clap::Args;
use neuro_ros::ros1::Master;

use crate::app::shutdown::Shutdown;
use crate::error::BridgeError;

/// Run a ROS master, where ROS is not installed.
///
/// Nodes of all programs, rospy's and roscpp's among them, find each other through it as through
/// roscore. It has the topics, services and parameters of roscore, and no node /rosout. By default
/// only programs of this machine reach it; with --bind 0.0.0.0:11311 those of other machines do,
/// without a password. Ends on Ctrl-C or SIGTERM.
///
/// Exit status: 0 done, 2 the address or port cannot be used.
#[derive(Args, Clone, Debug)]
pub(crate) struct MasterOptions {
    /// IP address and port to listen on; 0.0.0.0 stands for all addresses of this machine
    #[arg(
        long,
        value_name = "ADDRESS:PORT",
        default_value = "127.0.0.1:11311",
        value_parser = parse_address
    )]
    pub(crate) bind: SocketAddr,
}

fn parse_address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        "write an IP address and a port of 0 to 65535, such as 127.0.0.1:11311 or 0.0.0.0:11311"
            .to_owned()
    })
}

/// Runs the master until a Unix signal or a call of its method `shutdown` ends it.
///
/// # Errors
///
/// [`BridgeError::MasterAddress`] if the master cannot listen on the address.
pub(crate) async fn run(options: &MasterOptions) -> Result<(), BridgeError> {
    let address = options.bind;
    let mut shutdown = Shutdown::new()?;
    let master = Master::start(address).await;
    let master = master.map_err(|source| BridgeError::MasterAddress(address, source))?;
    tracing::info!("ROS master at {}", master.uri());
    tracing::info!("for each terminal with ROS programs: export ROS_MASTER_URI={}", master.uri());
    if address.ip().is_unspecified() {
        tracing::info!(
            "on other machines, with the IP addresses of this machine and of the other one: \
             export ROS_MASTER_URI=http://ADDRESS:{}/ ROS_IP=OWN_ADDRESS",
            address.port()
        );
    }
    let reason = tokio::select! {
        reason = shutdown.requested() => reason,
        () = master.shutdown_requested() => "a program has called shutdown",
    };
    tracing::info!("shutting down: {reason}");
    master.shutdown().await;
    Ok(())
}
