//! XML-RPC: values, their XML form, a client and a server.

mod call;
mod decode;
mod encode;
mod multicall;
mod reply;
mod server;
mod value;

pub use call::{CallError, call, call_ros};
pub use decode::{DecodeError, MethodCall, decode_call, decode_response};
pub use encode::{encode_call, encode_response};
pub(crate) use reply::Reply;
pub(crate) use server::Server;
pub use value::{Fault, Value};
