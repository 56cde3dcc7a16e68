//! XML-RPC: values, their XML form, a client and a server.

mod call;
mod codec;
mod server;
mod value;

pub use call::{CallError, call, call_ros};
pub use codec::{
    DecodeError, MethodCall, decode_call, decode_response, encode_call, encode_response,
};
pub(crate) use server::Server;
pub(crate) use value::Reply;
pub use value::{Fault, Value};
