//! `corticode-bridge --realtime` gets real-time scheduling where permitted, or logs why not.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use acceptance::programs::programs;
use emulator::skip::skip_unless_required;
use rustix::thread::{CapabilitySet, capabilities};

/// Priority that the bridge asks for.
const PRIORITY: u64 = 20;

/// Starts a bridge with `--realtime`, through the command `prefix`. Returns the bridge and the line
/// of its log that reports whether it got real-time scheduling.
fn start(prefix: &[&str]) -> (Child, String) {
    let bridge = programs().bridge.display().to_string();
    let arguments = ["--realtime", "--sink=ndjson", "--port=tcp:127.0.0.1:9"];
    let mut words = prefix.iter().copied().chain([&*bridge]).chain(arguments);
    let mut bridge = Command::new(words.next().expect("the bridge"))
        .args(words)
        .env("CORTICODE_CONFIG", "/dev/null")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the bridge starts");
    let log = BufReader::new(bridge.stderr.take().expect("its log"));
    let answer = (log.lines().map_while(Result::ok)).find(|line| line.contains("real-time"));
    (bridge, answer.expect("an answer in the log"))
}

/// Returns the scheduling policy of each thread of a process (0: the ordinary policy, 1:
/// `SCHED_FIFO`), and the thread's priority under that policy.
fn schedules(process: u32) -> Vec<(u64, u64)> {
    let tasks = fs::read_dir(format!("/proc/{process}/task")).expect("the threads");
    let stat = |path: &Path| fs::read_to_string(path.join("stat")).expect("its state");
    let stats = tasks.map(|task| stat(&task.expect("a thread").path()));
    let schedule = |stat: String| {
        // Read fields 40 and 41. Field 2 is in parentheses, and the split leaves field 3 onwards.
        let (_, fields) = stat.rsplit_once(") ").expect("the name");
        let mut fields = fields.split(' ').skip(37);
        let mut field = || fields.next().and_then(|field| field.parse().ok());
        let priority = field().expect("a priority");
        (field().expect("a policy"), priority)
    };
    stats.map(schedule).collect()
}

#[test]
fn the_thread_with_the_sockets_alone_gets_priority_or_the_log_says_why_not() {
    let own = capabilities(None).expect("the capabilities of this process").effective;
    let may = own.contains(CapabilitySet::SYS_NICE | CapabilitySet::IPC_LOCK);
    if may {
        let (mut bridge, answer) = start(&[]);
        assert!(answer.contains("memory locked"), "{answer}");
        let mut schedules = schedules(bridge.id());
        schedules.sort_unstable();
        let fifo = schedules.pop();
        assert_eq!(fifo, Some((1, PRIORITY)), "{schedules:?}");
        assert!(schedules.iter().all(|other| other.0 == 0), "{schedules:?}");
        let status = fs::read_to_string(format!("/proc/{}/status", bridge.id()));
        let status = status.expect("its status");
        let locked = status.lines().find(|line| line.starts_with("VmLck:"));
        assert!(locked.is_some_and(|line| !line.contains(" 0 kB")), "{status}");
        bridge.kill().and_then(|()| bridge.wait().map(drop)).expect("it ends");
    } else {
        skip_unless_required("real-time priority", "it needs CAP_SYS_NICE and CAP_IPC_LOCK");
    }
    // Without CAP_SYS_NICE and CAP_IPC_LOCK, root is subject to the resource limits, as every user
    // is.
    let user = ["setpriv", "--bounding-set=-sys_nice,-ipc_lock"];
    let limits = ["prlimit", "--rtprio=0", "--memlock=65536"];
    let prefix = [&user[..if may { 2 } else { 0 }], &limits].concat();
    let (mut bridge, answer) = start(&prefix);
    assert!(answer.contains("WARN") && answer.contains("ulimit -l"), "{answer}");
    assert!(answer.contains("60-corticode.conf"), "{answer}");
    assert!(schedules(bridge.id()).iter().all(|(policy, _)| *policy == 0));
    bridge.kill().and_then(|()| bridge.wait().map(drop)).expect("it ends");
}
