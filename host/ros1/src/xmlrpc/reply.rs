//! The reply of a ROS API method: (code, message, value).

use super::value::Value;

/// Reply of a ROS API method. The code is 1 for success, 0 for a failure and -1 for an error of
/// the caller.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Reply {
    code: i32,
    message: String,
    value: Value,
}

impl Reply {
    /// Returns the reply of a call that succeeded.
    pub(crate) fn success(message: impl Into<String>, value: impl Into<Value>) -> Self {
        Self::with_code(1, message, value)
    }

    /// Returns the reply of a valid call that could not be carried out.
    pub(crate) fn failure(message: impl Into<String>, value: impl Into<Value>) -> Self {
        Self::with_code(0, message, value)
    }

    /// Returns the reply of a call with wrong arguments.
    pub(crate) fn caller_error(message: impl Into<String>, value: impl Into<Value>) -> Self {
        Self::with_code(-1, message, value)
    }

    fn with_code(code: i32, message: impl Into<String>, value: impl Into<Value>) -> Self {
        Self {
            code,
            message: message.into(),
            value: value.into(),
        }
    }
}

impl From<Reply> for Value {
    fn from(reply: Reply) -> Self {
        Self::Array(vec![reply.code.into(), reply.message.into(), reply.value])
    }
}
