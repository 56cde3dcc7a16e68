//! XML-RPC: values, their XML form, a client and a server.

mod call;
mod codec;
mod server;
mod value;

pub use call::{CallError, CallFailure, call, call_ros};
pub use codec::{
    DecodeError, MethodCall, decode_call, decode_response, encode_call, encode_response,
};
pub(crate) use server::Server;
pub use value::{Fault, Value};
pub(crate) use value::{caller_error, failure, success};
