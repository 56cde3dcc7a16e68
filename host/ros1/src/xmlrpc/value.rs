//! The data types of XML-RPC, and the replies of ROS API methods.

/// A value together with its XML-RPC type.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// 32-bit integer: `<int>` or `<i4>`.
    Int(i32),
    /// Truth value: `<boolean>` with the text 0 or 1.
    Bool(bool),
    /// Floating-point number: `<double>`.
    Double(f64),
    /// Text: `<string>`, or a `<value>` that contains text without a type tag.
    String(String),
    /// Items of an `<array>`, of any types.
    Array(Vec<Value>),
    /// Members of a `<struct>` in document order. Names are unique: a later member replaces an
    /// earlier one of the same name.
    Struct(Vec<(String, Value)>),
    /// Binary data: the text inside `<base64>`. The text is not decoded, because the master only
    /// passes it on.
    Base64(String),
    /// Date and time: the text inside `<dateTime.iso8601>`, not parsed.
    DateTime(String),
    /// No value: `<nil/>`, an extension that Python peers send for `None`.
    Nil,
}

/// XML-RPC's error response, for a call that the server could not carry out at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("XML-RPC fault {code}: {message}")]
pub struct Fault {
    /// Error code; Python peers always send 1.
    pub code: i32,
    /// Error message from the server.
    pub message: String,
}

impl Fault {
    /// Creates a fault with the code 1, as Python peers do.
    pub(crate) fn new(message: String) -> Self {
        Self { code: 1, message }
    }
}

impl Value {
    /// Returns the text of a string; `None` for other types.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::String(text) => Some(text),
            _ => None,
        }
    }

    /// Returns the value of an integer, or 0 or 1 for a boolean, as Python does; `None` for other
    /// types.
    pub fn as_int(&self) -> Option<i32> {
        match self {
            Self::Int(number) => Some(*number),
            Self::Bool(flag) => Some(i32::from(*flag)),
            _ => None,
        }
    }

    /// Returns the items of an array; `None` for other types.
    pub fn as_array(&self) -> Option<&[Value]> {
        match self {
            Self::Array(items) => Some(items),
            _ => None,
        }
    }

    /// Returns the strings in an array, such as publisher URIs. Skips items of other types; returns
    /// an empty list if the value is not an array.
    pub(crate) fn strings(&self) -> Vec<String> {
        let items = self.as_array().unwrap_or_default();
        items.iter().filter_map(Self::as_str).map(str::to_owned).collect()
    }

    /// Returns the process ID of this program; an ID beyond 2^31 - 1 becomes 2^31 - 1.
    pub(crate) fn process_id() -> Self {
        Self::Int(i32::try_from(std::process::id()).unwrap_or(i32::MAX))
    }

    /// Returns the member `name` of a struct; `None` if the struct has no such member or the value
    /// is not a struct.
    pub fn member(&self, name: &str) -> Option<&Value> {
        match self {
            Self::Struct(members) => members.iter().find(|(key, _)| key == name).map(|(_, v)| v),
            _ => None,
        }
    }
}

impl From<Fault> for Value {
    /// Converts a fault to the struct that represents it in an XML-RPC response.
    fn from(fault: Fault) -> Self {
        Self::Struct(vec![
            ("faultCode".to_owned(), Self::Int(fault.code)),
            ("faultString".to_owned(), Self::String(fault.message)),
        ])
    }
}

macro_rules! impl_from {
    ($($type:ty => $variant:ident),*) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::$variant(value)
            }
        }
    )*};
}
impl_from!(i32 => Int, bool => Bool, f64 => Double, String => String);

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::String(text.to_owned())
    }
}

impl<T: Into<Value>> From<Vec<T>> for Value {
    fn from(items: Vec<T>) -> Self {
        Self::Array(items.into_iter().map(Into::into).collect())
    }
}

impl<T: Into<Value>, const N: usize> From<[T; N]> for Value {
    fn from(items: [T; N]) -> Self {
        Self::Array(items.into_iter().map(Into::into).collect())
    }
}

impl FromIterator<Value> for Value {
    fn from_iter<I: IntoIterator<Item = Value>>(items: I) -> Self {
        Self::Array(items.into_iter().collect())
    }
}

/// Returns the reply of a ROS API method that succeeded: the array (1, message, value).
pub(crate) fn success(message: impl Into<String>, value: impl Into<Value>) -> Value {
    reply(1, message, value)
}

/// Returns the reply to a valid call that could not be carried out, with the code 0.
pub(crate) fn failure(message: impl Into<String>, value: impl Into<Value>) -> Value {
    reply(0, message, value)
}

/// Returns the reply to a call with wrong arguments, with the code -1.
pub(crate) fn caller_error(message: impl Into<String>, value: impl Into<Value>) -> Value {
    reply(-1, message, value)
}

fn reply(code: i32, message: impl Into<String>, value: impl Into<Value>) -> Value {
    Value::Array(vec![code.into(), message.into().into(), value.into()])
}
