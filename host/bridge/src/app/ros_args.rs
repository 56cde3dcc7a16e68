//! Translates arguments in the syntax of ROS 2, which follow `--ros-args`, to the syntax of ROS 1.

use crate::error::BridgeError;

/// Translates the arguments between `--ros-args` and `--`, or the end, to arguments of ROS 1, and
/// leaves all others unchanged: `-r __node:=NAME` becomes `__name:=NAME`, `-r FROM:=TO` becomes
/// `FROM:=TO`, and `-p NAME:=VALUE` becomes `_NAME:=VALUE`.
///
/// # Errors
///
/// [`BridgeError::RosArgument`] for an argument of ROS 2 that has no counterpart.
pub(crate) fn to_ros1(
    arguments: impl IntoIterator<Item = String>,
) -> Result<Vec<String>, BridgeError> {
    let mut translated = Vec::new();
    let mut arguments = arguments.into_iter();
    let mut is_ros = false;
    while let Some(argument) = arguments.next() {
        match (is_ros, argument.as_str()) {
            (_, "--ros-args") => is_ros = true,
            (false, _) => translated.push(argument),
            (true, "--") => is_ros = false,
            (true, flag) => {
                let refused = || BridgeError::RosArgument(argument.clone());
                let value = arguments.next().ok_or_else(refused)?;
                translated.push(
                    one(flag, &value)
                        .ok_or_else(|| BridgeError::RosArgument(format!("{argument} {value}")))?,
                );
            }
        }
    }
    Ok(translated)
}

/// Returns a ROS 2 flag and its value as one ROS 1 argument; `None` if ROS 1 has no counterpart.
fn one(flag: &str, value: &str) -> Option<String> {
    match flag {
        "-r" | "--remap" => {
            let (from, to) = value.split_once(":=")?;
            let from = match from {
                "__node" | "__name" => "__name",
                // ROS 1 has no rules of the form NODE:FROM, which apply to one node of a process.
                from if from.contains(':') => return None,
                from => from,
            };
            Some(format!("{from}:={to}"))
        }
        "-p" | "--param" => {
            let (name, value) = value.split_once(":=")?;
            (!name.contains(':')).then(|| format!("_{name}:={value}"))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::to_ros1;

    fn translated(arguments: &[&str]) -> Result<Vec<String>, String> {
        let arguments = arguments.iter().map(|argument| (*argument).to_owned());
        to_ros1(arguments).map_err(|error| error.to_string())
    }

    #[test]
    fn what_stands_between_ros_args_and_two_dashes_is_translated() {
        let arguments = [
            "bridge",
            "-r",
            "--ros-args",
            "-r",
            "__node:=amp",
            "--remap",
            "__ns:=/left",
            "-r",
            "~/start:=/go",
            "-p",
            "port:=/dev/ttyACM0",
            "--",
            "--sink",
            "ros2",
            "--ros-args",
        ];
        let expected = [
            "bridge",
            "-r",
            "__name:=amp",
            "__ns:=/left",
            "~/start:=/go",
            "_port:=/dev/ttyACM0",
            "--sink",
            "ros2",
        ];
        assert_eq!(translated(&arguments).unwrap(), expected);
        assert_eq!(translated(&["bridge", "--port", "x"]).unwrap().len(), 3);
    }

    #[test]
    fn what_has_no_counterpart_is_named() {
        for (arguments, named) in [
            (vec!["--params-file", "x.yaml"], "--params-file x.yaml"),
            (vec!["-r", "other:__node:=x"], "-r other:__node:=x"),
            (vec!["-p", "port"], "-p port"),
            (vec!["-r"], "-r after --ros-args"),
        ] {
            let error = translated(&[&["--ros-args"], arguments.as_slice()].concat()).unwrap_err();
            assert!(error.starts_with(named), "{error}");
        }
    }
}
