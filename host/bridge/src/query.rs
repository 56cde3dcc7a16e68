//! Sends the device at a port a single request, such as a self-test.

use std::time::Duration;

use bridge_core::{Answer, HostTime, Query, Request};
use indicatif::ProgressBar;
use tokio::time::{sleep, timeout};

use crate::error::BridgeError;
use crate::wire::opener::PortOpener;
use crate::wire::port::{Port, PortAddress, Transfer};

/// Time between two checks of the timeouts, and between two attempts to reopen a lost port.
const TICK: Duration = Duration::from_millis(100);

/// Sends a request to the device at a port and returns the answer. Shows a spinner meanwhile if
/// stderr is a terminal.
///
/// # Errors
///
/// [`BridgeError`] if the port cannot be used, the device does not answer, or it refuses the
/// request.
pub(crate) async fn query_port(
    address: &PortAddress,
    baud: u32,
    request: Request,
) -> Result<Answer, BridgeError> {
    let spinner = ProgressBar::new_spinner();
    spinner.enable_steady_tick(TICK);
    let outcome = run_query(address, baud, request, &spinner).await;
    spinner.finish_and_clear();
    outcome
}

async fn run_query(
    address: &PortAddress,
    baud: u32,
    request: Request,
    spinner: &ProgressBar,
) -> Result<Answer, BridgeError> {
    let mut query = Query::new(request);
    let mut opener = PortOpener::new(address.clone(), baud);
    let mut port = Some(open(&mut opener).await?);
    query.connected(HostTime::now().monotonic_us);
    let (mut buffer, mut outgoing) = (vec![0; 4096], Vec::new());
    loop {
        spinner.set_message(query.progress_text());
        let now_us = HostTime::now().monotonic_us;
        if let Some(outcome) = query.tick(now_us) {
            return Ok(outcome?);
        }
        let Some(open_port) = &mut port else {
            sleep(TICK).await;
            // The port is absent while the device restarts; `query` times out if that takes too
            // long.
            port = opener.open().await.ok();
            if port.is_some() {
                outgoing.clear();
                query.connected(HostTime::now().monotonic_us);
            }
            continue;
        };
        outgoing.extend(query.outgoing());
        match timeout(TICK, open_port.exchange(&mut buffer, &outgoing)).await {
            Err(_) => {}
            Ok(Ok(Transfer::Read(count))) => {
                let now_us = HostTime::now().monotonic_us;
                if let Some(outcome) = query.receive(&buffer[..count], now_us) {
                    return Ok(outcome?);
                }
            }
            Ok(Ok(Transfer::Written(count))) => drop(outgoing.drain(..count)),
            Ok(Err(_) | Ok(Transfer::NotWritten(_))) if query.expects_reconnect() => port = None,
            Ok(Err(source) | Ok(Transfer::NotWritten(source))) => {
                return Err(BridgeError::Unreachable {
                    port: opener.to_string(),
                    what: "was lost before the device answered",
                    remedy: "check cable and power, and whether another program uses it".to_owned(),
                    source,
                });
            }
        }
    }
}

async fn open(opener: &mut PortOpener) -> Result<Port, BridgeError> {
    let error = match opener.open().await {
        Ok(port) => return Ok(port),
        Err(error) => error,
    };
    let port = opener.to_string();
    let source = error.passing(port.clone())?;
    Err(BridgeError::Unreachable {
        port,
        what: "does not open",
        remedy: opener.address().remedy(source.kind()),
        source,
    })
}
