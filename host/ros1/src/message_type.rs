//! Name, MD5 sum and definition of message and service types.

/// Type of a topic's messages. This crate treats their bodies as opaque bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageType {
    /// Package and name, such as `std_msgs/String`. `*` subscribes to any type.
    pub name: &'static str,
    /// MD5 sum of the definition as `rosmsg md5` prints it, 32 hex digits. `*` matches any sum.
    pub md5: &'static str,
    /// Full definition including all embedded types, as `gendeps --cat` prints it. Recorders store
    /// it, so that a recording can be read without the package.
    pub definition: &'static str,
}

/// Type of a service's request and response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServiceType {
    /// Package and name, such as `std_srvs/Empty`.
    pub name: &'static str,
    /// MD5 sum over request and response as `rossrv md5` prints it, 32 hex digits. `*` matches any
    /// sum.
    pub md5: &'static str,
    /// Text of the `.srv` file: request, `---`, response.
    pub definition: &'static str,
}
