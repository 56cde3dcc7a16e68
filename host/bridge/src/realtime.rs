//! Real-time scheduling of the thread that reads the port and writes the sockets.

use std::io;

use clap::Args;
use thiserror::Error;
use thread_priority::{
    Error as PriorityError, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

use crate::app::command_line::Switch as _;

/// Priority under `SCHED_FIFO` (range 1 to 99): above every ordinary program, and below the threads
/// in which Linux handles interrupts, which have priority 50.
const PRIORITY: u8 = 20;
/// Advice for the user: how the members of the group `dialout` get real-time scheduling.
pub(crate) const REMEDY: &str = "sudo install -m 644 packaging/60-corticode.conf /etc/security/limits.d/ \
                                 (the Debian package has done it), join the group dialout, log in again";

/// Option that asks for real-time scheduling.
#[derive(Args, Clone, Copy, Debug)]
pub struct RealtimeOption {
    /// Ask Linux for real-time priority (SCHED_FIFO) and keep the program's memory in RAM, so that
    /// other programs do not delay frames. If that is not permitted, the program warns and goes on
    #[arg(long, env = "CORTICODE_REALTIME", switch())]
    pub realtime: bool,
}

/// Why the operating system did not grant real-time scheduling.
#[derive(Debug, Error)]
pub(crate) enum Refusal {
    #[error(
        "real-time priority {PRIORITY} is not permitted: {0}; the limit is that of `ulimit -r`"
    )]
    Priority(io::Error),
    #[error("memory may not be locked without limit; the limit is that of `ulimit -l`")]
    MemoryLimit,
    #[error("memory cannot be locked: {0}")]
    Memory(io::Error),
}

/// Gives the calling thread real-time priority, and keeps the memory of the program in RAM. Threads
/// that this thread starts later inherit the priority; threads that run already keep their own.
///
/// # Errors
///
/// [`Refusal`] if the limits `rtprio` and `memlock` do not permit it, and the capabilities
/// `CAP_SYS_NICE` and `CAP_IPC_LOCK` are missing. The thread's priority is then unchanged, except
/// after [`Refusal::Memory`].
pub(crate) fn request() -> Result<(), Refusal> {
    check_memory_limit()?;
    let refused = |error| {
        Refusal::Priority(match error {
            PriorityError::OS(code) => io::Error::from_raw_os_error(code),
            other => io::Error::other(other),
        })
    };
    let priority = ThreadPriorityValue::try_from(PRIORITY)
        .map_err(|error| Refusal::Priority(io::Error::other(error)))?;
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let (thread, priority) = (thread_native_id(), ThreadPriority::Crossplatform(priority));
    set_thread_priority_and_policy(thread, priority, fifo).map_err(refused)?;
    lock_memory()
}

#[cfg(target_os = "linux")]
fn check_memory_limit() -> Result<(), Refusal> {
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{CapabilitySet, capabilities};

    let may_exceed_limit =
        capabilities(None).is_ok_and(|of| of.effective.contains(CapabilitySet::IPC_LOCK));
    // With a limit, locking memory would succeed now, and an allocation would fail later.
    if getrlimit(Resource::Memlock).current.is_some() && !may_exceed_limit {
        return Err(Refusal::MemoryLimit);
    }
    Ok(())
}

#[cfg(target_os = "linux")]
fn lock_memory() -> Result<(), Refusal> {
    use rustix::mm::{MlockAllFlags, mlockall};

    let locked = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
    locked.map_err(|error| Refusal::Memory(error.into()))
}

/// On systems other than Linux, the program's memory is not locked.
#[cfg(not(target_os = "linux"))]
fn check_memory_limit() -> Result<(), Refusal> {
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn lock_memory() -> Result<(), Refusal> {
    Ok(())
}
