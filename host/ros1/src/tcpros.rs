//! TCPROS: the connection header and the messages that follow it.

mod header;
mod message;
mod socket;

pub(crate) use header::{HANDSHAKE_TIMEOUT, type_mismatch};
pub use header::{Header, HeaderError, MAX_HEADER};
pub use message::MAX_MESSAGE;
pub(crate) use message::{read_message, read_message_body, write_message};
pub(crate) use socket::set_options;
