//! TCPROS: the connection header and the messages after it.

mod header;
mod message;
mod socket;

pub(crate) use header::{HANDSHAKE_LIMIT, disagreement};
pub use header::{Header, HeaderError, MAX_HEADER};
pub use message::MAX_MESSAGE;
pub(crate) use message::{read_block, read_body, write_block};
pub(crate) use socket::set_options;
