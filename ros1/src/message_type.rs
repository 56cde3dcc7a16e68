//! What a topic or a service carries, as far as the transport must know it.

/// The type of a topic's messages. The bodies themselves are opaque bytes to this crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageType {
    /// Package and name, `std_msgs/String`; `*` takes any type when subscribing.
    pub name: &'static str,
    /// MD5 of the definition as `rosmsg md5` prints it, 32 hex digits; `*` takes any.
    pub md5: &'static str,
    /// The definition's full text, with the definitions of its parts, as `gendeps --cat` prints
    /// it. Recorders store it, so that a recording can be read without the package.
    pub definition: &'static str,
}

/// The type of a service's request and response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServiceType {
    /// Package and name, `std_srvs/Empty`.
    pub name: &'static str,
    /// MD5 of request and response together as `rossrv md5` prints it; `*` takes any.
    pub md5: &'static str,
    /// The `.srv` text: request, `---`, response.
    pub definition: &'static str,
}
