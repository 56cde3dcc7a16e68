//! Message and service types that Debian's packages also define.

use ros1::{MessageType, ServiceType};

/// A message with one string. Its MD5 sum is that printed by `rosmsg md5 std_msgs/String`.
pub(crate) static STRING: MessageType = MessageType {
    name: "std_msgs/String",
    md5: "992ce8a1687cec8c8bd883ec73ca41d1",
    definition: "string data\n",
};

/// A service that sets a boolean. Its MD5 sum is that printed by `rossrv md5 std_srvs/SetBool`.
pub(crate) static SET_BOOL: ServiceType = ServiceType {
    name: "std_srvs/SetBool",
    md5: "09fb03525b03e7ea1fd3992bafd87e16",
    definition: "bool data\n---\nbool success\nstring message\n",
};

/// Encodes the body of a std_msgs/String.
pub(crate) fn string(text: &str) -> Vec<u8> {
    let mut body = u32::try_from(text.len()).unwrap().to_le_bytes().to_vec();
    body.extend_from_slice(text.as_bytes());
    body
}
