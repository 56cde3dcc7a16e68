//! Programs that run two at a time: while one waits, the other computes.

use std::fs::{self, File};
use std::mem;
use std::path::Path;
use std::process::{self, Command};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Instant;

use serde_json::Value;

use crate::command::{AFTER_A_BUILD, Failure, OrFail, print, run, target_folder, typed};

/// Number of programs that run at a time.
const WORKERS: usize = 2;

/// Builds tests with `build`, which is `cargo test` with options, and returns the test programs in
/// cargo's order. Each is to run in the folder of its package, as `cargo test` runs it.
///
/// # Errors
/// The tests do not build.
pub(crate) fn test_programs(build: &mut Command) -> Result<Vec<Command>, Failure> {
    build.args(["--no-run", "--message-format=json-render-diagnostics"]);
    let list = target_folder().join("test-programs.jsonl");
    let file = File::create(&list).or_fail(list.display(), AFTER_A_BUILD)?;
    run(build.stdout(file), AFTER_A_BUILD)?;
    let messages = fs::read_to_string(&list).or_fail(list.display(), AFTER_A_BUILD)?;
    Ok(messages.lines().filter_map(test_program).collect())
}

/// Returns the test program that a message of cargo announces.
fn test_program(message: &str) -> Option<Command> {
    let message: Value = serde_json::from_str(message).ok()?;
    let is_test = message["profile"]["test"].as_bool()?;
    let folder = Path::new(message["manifest_path"].as_str()?).parent()?;
    let mut program = Command::new(message["executable"].as_str().filter(|_| is_test)?);
    program.current_dir(folder);
    program.env("CARGO_MANIFEST_DIR", folder);
    Some(program)
}

/// Runs programs, [`WORKERS`] at a time, and prints the output of each when it has ended. Starts no
/// more of them after a failure. `next` is the advice to the user if one fails.
///
/// # Errors
/// The first failure.
pub(crate) fn run_all(programs: Vec<Command>, next: &str) -> Result<(), Failure> {
    let total = programs.len();
    let queue = Mutex::new((1..).zip(programs));
    let result = Mutex::new(Ok(()));
    let work = || {
        while lock(&result).is_ok() {
            let Some((number, mut program)) = lock(&queue).next() else {
                return;
            };
            let log = format!("output-{}-{number}.txt", process::id());
            let log = target_folder().join(log);
            let start = Instant::now();
            let ended = run_into(&mut program, &log, next);
            let seconds = start.elapsed().as_secs_f32();
            // The lock also keeps the outputs of two programs apart.
            let mut result = lock(&result);
            let output = fs::read(&log).unwrap_or_default();
            let _ = fs::remove_file(&log);
            let output = String::from_utf8_lossy(&output);
            let folder = program.get_current_dir().unwrap_or(Path::new(""));
            let (folder, name) = (folder.display(), typed(&program));
            let printed = print(format!(
                "\n[{number}/{total}] {folder} {name}: {seconds:.1} s\n{output}"
            ));
            *result = mem::replace(&mut *result, Ok(())).and(printed).and(ended);
        }
    };
    thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(work);
        }
    });
    result.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a program with its output in the file `log`: a pipe would stay open as long as any process
/// that the program has left behind.
fn run_into(program: &mut Command, log: &Path, next: &str) -> Result<(), Failure> {
    let files = File::create(log).and_then(|file| Ok((file.try_clone()?, file)));
    let (stdout, stderr) = files.or_fail(log.display(), "is its folder writable?")?;
    run(program.stdout(stdout).stderr(stderr), next)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_programs_are_those_of_cargos_messages() {
        let message = r#"{"reason":"compiler-artifact","manifest_path":"/a/b/Cargo.toml",
            "profile":{"test":true},"executable":"/t/b-1"}"#;
        let program = test_program(message).unwrap();
        assert_eq!(program.get_program(), "/t/b-1");
        assert_eq!(program.get_current_dir(), Some(Path::new("/a/b")));
        for other in [
            message.replace("true", "false"),
            message.replace("\"/t/b-1\"", "null"),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
            "warning".to_owned(),
        ] {
            assert!(test_program(&other).is_none(), "{other}");
        }
    }

    #[test]
    fn programs_run_side_by_side_until_one_fails() {
        let folder = target_folder();
        let shell = |words: &str| {
            let mut shell = Command::new("sh");
            shell.args(["-c", words]).current_dir(&folder);
            shell
        };
        // Each of the first two waits until the other has started.
        let [a, b] = ["a", "b"].map(|name| format!("pool-{}-{name}", process::id()));
        let meet = |own: &str, other: &str| {
            format!(
                "touch {own}; for n in $(seq 100); do test -e {other} && exit 0; sleep 0.1; done; exit 1"
            )
        };
        let met = run_all(vec![shell(&meet(&a, &b)), shell(&meet(&b, &a))], "");
        assert!(met.is_ok(), "{met:?}");
        // At most one program can start beside the one that fails.
        let mark = format!("touch {a}-3");
        let programs = vec![shell("exit 3"), shell("sleep 1"), shell(&mark)];
        let failure = run_all(programs, "look there").expect_err("one fails");
        assert!(
            failure.message.contains("exit status: 3"),
            "{}",
            failure.message
        );
        assert!(failure.message.ends_with("next: look there"));
        assert!(!folder.join(format!("{a}-3")).exists());
        for file in [&a, &b] {
            fs::remove_file(folder.join(file)).unwrap();
        }
    }
}
