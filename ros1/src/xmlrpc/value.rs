//! The values of XML-RPC.

/// One XML-RPC value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `<int>`, `<i4>`.
    Int(i32),
    /// `<boolean>`.
    Bool(bool),
    /// `<double>`.
    Double(f64),
    /// `<string>`, or text without a type.
    String(String),
    /// `<array>`.
    Array(Vec<Value>),
    /// `<struct>`: members in the order in which they were written; a later one of the same
    /// name has replaced the earlier.
    Struct(Vec<(String, Value)>),
    /// `<base64>`: the text as it stood, not decoded, because such parameters only pass through.
    Base64(String),
    /// `<dateTime.iso8601>`: the text as it stood.
    DateTime(String),
    /// `<nil/>`, an extension that Python peers send for `None`.
    Nil,
}

/// A call that the other side could not carry out at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("XML-RPC fault {code}: {message}")]
pub struct Fault {
    /// The other side's code; Python peers always send 1.
    pub code: i32,
    /// The other side's words.
    pub message: String,
}

impl Value {
    /// The text of a string.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::String(text) => Some(text),
            _ => None,
        }
    }

    /// The number of an integer; a boolean counts as 0 or 1, as it does for Python peers.
    pub fn as_int(&self) -> Option<i32> {
        match self {
            Self::Int(number) => Some(*number),
            Self::Bool(flag) => Some(i32::from(*flag)),
            _ => None,
        }
    }

    /// The items of an array.
    pub fn as_array(&self) -> Option<&[Value]> {
        match self {
            Self::Array(items) => Some(items),
            _ => None,
        }
    }

    /// The member of a struct called `name`.
    pub fn member(&self, name: &str) -> Option<&Value> {
        match self {
            Self::Struct(members) => members.iter().find(|(key, _)| key == name).map(|(_, v)| v),
            _ => None,
        }
    }
}

impl From<Fault> for Value {
    /// The struct in which a fault travels.
    fn from(fault: Fault) -> Self {
        Self::Struct(vec![
            ("faultCode".to_owned(), Self::Int(fault.code)),
            ("faultString".to_owned(), Self::String(fault.message)),
        ])
    }
}

impl From<i32> for Value {
    fn from(number: i32) -> Self {
        Self::Int(number)
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Self::Bool(flag)
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Double(number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::String(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::String(text)
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
