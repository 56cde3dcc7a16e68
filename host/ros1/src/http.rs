//! The subset of HTTP/1.1 that XML-RPC peers use: `Content-Length`, chunked bodies and keep-alive
//! connections. This module limits the length of everything that it reads; the callers limit the
//! time.

mod body;
mod head;

pub(crate) use body::read_body;
pub use head::HttpError;
pub(crate) use head::read_head;
