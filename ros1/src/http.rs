//! The part of HTTP/1.1 that XML-RPC peers speak: `Content-Length`, chunks, keep-alive; with a
//! limit on every length. The time limits stand where the reading is started.

mod body;
mod head;

pub(crate) use body::read_body;
pub use head::HttpError;
pub(crate) use head::read_head;
