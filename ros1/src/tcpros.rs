//! TCPROS: the connection header and the messages after it.

mod header;
mod message;

pub(crate) use header::{HANDSHAKE_LIMIT, disagreement};
pub use header::{Header, HeaderError, MAX_HEADER};
pub use message::MAX_MESSAGE;
pub(crate) use message::{read_block, write_block};
