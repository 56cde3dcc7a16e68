//! A number as a message.

use crate::wire::impl_wire;

/// `std_msgs/UInt8`: one number of 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UInt8 {
    /// The number.
    pub data: u8,
}

impl_wire!(UInt8 { data: u8 });
