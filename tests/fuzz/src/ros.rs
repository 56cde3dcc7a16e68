//! Fuzz targets for what other ROS nodes send: XML-RPC calls and replies, connection headers and
//! messages.

use neuro_ros::{DiagnosticArray, NeuroEvent, NeuroFrame, Wire};
use ros1::tcpros::Header;
use ros1::xmlrpc::{
    Fault, MethodCall, Value, decode_call, decode_response, encode_call, encode_response,
};

use crate::Outcome;

pub(crate) fn xmlrpc_seeds() -> Vec<Vec<u8>> {
    let values = [
        Value::Int(-7),
        Value::from("a & b <c>"),
        Value::Array(vec![Value::Bool(true), Value::Double(1e-3)]),
    ];
    let fault = Fault { code: 1, message: "no".to_owned() };
    [
        encode_call("publisherUpdate", &values),
        encode_response(&Ok(Value::Array(values.to_vec()))),
        encode_response(&Err(fault)),
    ]
    .map(String::into_bytes)
    .into()
}

/// Decodes bytes as a call and as a reply. Encodes what was decoded, decodes the XML and encodes
/// the result again: both encodings must be equal. They may differ from the input, because XML
/// cannot hold control characters.
pub(crate) fn xmlrpc(bytes: &[u8]) -> Outcome {
    let call = decode_call(bytes);
    if let Ok(call) = &call {
        let encode = |call: &MethodCall| encode_call(&call.method, &call.arguments);
        let xml = encode(call);
        let again = decode_call(xml.as_bytes()).expect("an encoded call");
        assert_eq!(encode(&again), xml);
    }
    let response = decode_response(bytes);
    if let Ok(response) = &response {
        let xml = encode_response(response);
        let again = decode_response(xml.as_bytes()).expect("an encoded response");
        assert_eq!(encode_response(&again), xml);
    }
    Outcome::accepted_if(call.is_ok() || response.is_ok())
}

pub(crate) fn tcpros_seeds() -> Vec<Vec<u8>> {
    let header = Header::new()
        .with("callerid", "/bridge")
        .with("topic", "/encoded")
        .with("type", "rosneuro_msgs/NeuroFrame");
    let header = header.encode().expect("a short header");
    vec![
        // Leave out the length field, which `Header::decode` does not read.
        header[4..].to_vec(),
        NeuroFrame::default().to_bytes(),
        NeuroEvent::default().to_bytes(),
        DiagnosticArray::default().to_bytes(),
    ]
}

/// Decodes bytes as a connection header and as each message that a node reads. A header must be the
/// same after encoding and decoding, and an encoded message must be readable.
pub(crate) fn tcpros(bytes: &[u8]) -> Outcome {
    let header = Header::decode(bytes);
    if let Ok(header) = &header {
        let encoded = header.encode().expect("no longer than before");
        let again = Header::decode(&encoded[4..]).expect("an encoded header");
        assert_eq!(again, *header);
    }
    let is_message = survives::<NeuroFrame>(bytes)
        | survives::<NeuroEvent>(bytes)
        | survives::<DiagnosticArray>(bytes);
    Outcome::accepted_if(header.is_ok() || is_message)
}

/// Returns whether bytes are a message, which must be readable after it is encoded. Its encoded
/// text can differ from the input, because bytes that are not UTF-8 are replaced.
fn survives<M: Wire>(bytes: &[u8]) -> bool {
    let message = M::from_bytes(bytes);
    if let Ok(message) = &message {
        let encoded = message.to_bytes();
        assert!(encoded.len() >= bytes.len() && M::from_bytes(&encoded).is_ok());
    }
    message.is_ok()
}
