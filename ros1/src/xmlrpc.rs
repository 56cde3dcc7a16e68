//! XML-RPC: values, their XML, one call out, and a server for calls in.

mod call;
mod decode;
mod encode;
mod multicall;
mod server;
mod value;

pub use call::{CallError, call, call_ros};
pub use decode::{DecodeError, MethodCall, decode_call, decode_response};
pub use encode::{encode_call, encode_response};
pub(crate) use server::Server;
pub use value::{Fault, Value};
