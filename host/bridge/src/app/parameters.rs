//! The node's private ROS parameters, which set the options of the command line.

use neuro_ros::ros1::NodeOptions;
use neuro_ros::ros1::xmlrpc::{CallError, Value, call_ros};

use crate::app::ros_node::Namespace;
use crate::error::BridgeError;

/// Replaces each argument `_name:=value` by `--name=value`, and leaves all others unchanged.
/// `known` are the names of the options, with underscores.
///
/// # Errors
///
/// [`BridgeError::UnknownParameter`] if no option has the parameter's name.
pub fn to_flags(arguments: Vec<String>, known: &[String]) -> Result<Vec<String>, BridgeError> {
    let flag = |argument: String| {
        let parameter = argument.strip_prefix('_').and_then(|a| a.split_once(":="));
        match parameter {
            Some((name, value)) if !name.starts_with('_') => {
                let remedy = format!("leave out _{name}:=");
                check(name, known, remedy).map(|()| to_flag(name, value))
            }
            _ => Ok(argument),
        }
    };
    arguments.into_iter().map(flag).collect()
}

/// Reads the node's private parameters from the parameter server at `master_uri`. Returns pairs of
/// a name and an argument `--name=value`, or an empty list without a master. `known` are the names
/// of the options, with underscores.
///
/// # Errors
///
/// [`BridgeError::UnknownParameter`] if no option has the name of a parameter, and
/// [`BridgeError::ParameterType`] if a parameter's value has a type that no option accepts.
pub async fn read(
    ros: &NodeOptions,
    master_uri: &str,
    known: &[String],
) -> Result<Vec<(String, String)>, BridgeError> {
    let node = if ros.name.starts_with('/') {
        ros.name.clone()
    } else {
        Namespace::new(&ros.namespace, "").resolve(&ros.name)
    };
    let arguments = [Value::from(node.as_str()), Value::from(node.as_str())];
    let members = match call_ros(master_uri, "getParam", &arguments).await {
        Ok(Value::Struct(members)) => members,
        // The master answers with an error if the node has no parameters.
        Ok(_) | Err(CallError::Refused { .. }) => return Ok(Vec::new()),
        Err(error) => {
            tracing::debug!(%error, "no private parameters are read");
            return Ok(Vec::new());
        }
    };
    to_arguments(&node, members, known)
}

fn to_arguments(
    node: &str,
    members: Vec<(String, Value)>,
    known: &[String],
) -> Result<Vec<(String, String)>, BridgeError> {
    let argument = |(name, value): (String, Value)| {
        let remedy = format!("remove it with: rosparam delete {node}/{name}");
        check(&name, known, remedy)?;
        let Some(text) = to_text(&value) else {
            return Err(BridgeError::ParameterType(format!("{node}/{name}")));
        };
        let flag = to_flag(&name, &text);
        Ok((name, flag))
    };
    members.into_iter().map(argument).collect()
}

fn check(name: &str, known: &[String], remedy: String) -> Result<(), BridgeError> {
    if known.iter().any(|known| known == name) {
        return Ok(());
    }
    Err(BridgeError::UnknownParameter { name: name.to_owned(), remedy, known: known.join(", ") })
}

/// Returns the argument `--name=value` for an option whose name is given with underscores.
pub(crate) fn to_flag(name: &str, value: &str) -> String {
    format!("--{}={value}", name.replace('_', "-"))
}

/// Returns the value as text for the command line, a list as values separated by commas; `None` if
/// no option takes values of this type.
fn to_text(value: &Value) -> Option<String> {
    Some(match value {
        Value::String(text) => text.clone(),
        Value::Int(number) => number.to_string(),
        Value::Double(number) => number.to_string(),
        Value::Bool(flag) => flag.to_string(),
        Value::Array(items) => {
            let items: Option<Vec<String>> = items.iter().map(to_text).collect();
            items?.join(",")
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use neuro_ros::ros1::xmlrpc::Value;

    use super::{to_arguments, to_flags};
    use crate::app::command_line::Options;

    fn known() -> Vec<String> {
        Options::parameter_names()
    }

    #[test]
    fn private_parameters_become_flags_and_an_unknown_one_lists_the_known_ones() {
        let given = ["bridge", "_port:=/dev/ttyACM0", "_low_latency:=true", "-x"];
        let flags = to_flags(given.map(str::to_owned).to_vec(), &known()).unwrap();
        let expected = ["bridge", "--port=/dev/ttyACM0", "--low-latency=true", "-x"];
        assert_eq!(flags, expected);
        let error = to_flags(vec!["_prot:=x".to_owned()], &known()).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("prot") && message.contains("port, baud"), "{message}");
    }

    #[test]
    fn values_of_every_type_become_text() {
        let members = [
            ("baud", Value::Int(9600)),
            ("mains", Value::Double(50.0)),
            ("low_latency", Value::Bool(true)),
            ("streams", Value::from(["codes", "raw"])),
        ];
        let members = members.map(|(name, value)| (name.to_owned(), value));
        let arguments = to_arguments("/acquisition", members.to_vec(), &known()).unwrap();
        let flags: Vec<&str> = arguments.iter().map(|(_, flag)| &**flag).collect();
        let expected = ["--baud=9600", "--mains=50", "--low-latency=true", "--streams=codes,raw"];
        assert_eq!(flags, expected);
        let nested = vec![("port".to_owned(), Value::Nil)];
        assert!(to_arguments("/acquisition", nested, &known()).is_err());
    }
}
