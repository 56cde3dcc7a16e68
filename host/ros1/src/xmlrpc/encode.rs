//! Encodes XML-RPC values, calls and responses as XML.

use std::fmt::Write as _;

use super::value::{Fault, Value};

const DECLARATION: &str = "<?xml version=\"1.0\"?>\n";

/// Encodes an XML-RPC call as the body of an HTTP request.
pub fn encode_call(method: &str, arguments: &[Value]) -> String {
    let mut xml = String::from(DECLARATION);
    xml.push_str("<methodCall><methodName>");
    push_escaped(&mut xml, method);
    xml.push_str("</methodName><params>");
    for argument in arguments {
        xml.push_str("<param>");
        push_value(&mut xml, argument);
        xml.push_str("</param>");
    }
    xml.push_str("</params></methodCall>");
    xml
}

/// Encodes an XML-RPC response (a value or a fault) as the body of an HTTP response.
pub fn encode_response(response: &Result<Value, Fault>) -> String {
    let mut xml = String::from(DECLARATION);
    xml.push_str("<methodResponse>");
    match response {
        Ok(value) => {
            xml.push_str("<params><param>");
            push_value(&mut xml, value);
            xml.push_str("</param></params>");
        }
        Err(fault) => {
            xml.push_str("<fault>");
            push_value(&mut xml, &Value::from(fault.clone()));
            xml.push_str("</fault>");
        }
    }
    xml.push_str("</methodResponse>");
    xml
}

fn push_value(xml: &mut String, value: &Value) {
    xml.push_str("<value>");
    match value {
        Value::Int(number) => push_scalar(xml, "int", number),
        Value::Bool(flag) => push_scalar(xml, "boolean", &u8::from(*flag)),
        Value::Double(number) => push_scalar(xml, "double", number),
        Value::String(text) => push_element(xml, "string", text),
        Value::Base64(text) => push_element(xml, "base64", text),
        Value::DateTime(text) => push_element(xml, "dateTime.iso8601", text),
        Value::Nil => xml.push_str("<nil/>"),
        Value::Array(items) => {
            xml.push_str("<array><data>");
            for item in items {
                push_value(xml, item);
            }
            xml.push_str("</data></array>");
        }
        Value::Struct(members) => {
            xml.push_str("<struct>");
            for (name, member) in members {
                xml.push_str("<member>");
                push_element(xml, "name", name);
                push_value(xml, member);
                xml.push_str("</member>");
            }
            xml.push_str("</struct>");
        }
    }
    xml.push_str("</value>");
}

fn push_scalar(xml: &mut String, tag: &str, value: &impl std::fmt::Display) {
    // Writing to a String cannot fail.
    let _ = write!(xml, "<{tag}>{value}</{tag}>");
}

fn push_element(xml: &mut String, tag: &str, text: &str) {
    let _ = write!(xml, "<{tag}>");
    push_escaped(xml, text);
    let _ = write!(xml, "</{tag}>");
}

/// Appends text with its special characters escaped. A carriage return becomes a character
/// reference, because XML parsers convert an unescaped carriage return to a line feed. Characters
/// that XML 1.0 forbids become U+FFFD, because Python's parser would refuse the whole document.
fn push_escaped(xml: &mut String, text: &str) {
    for character in text.chars() {
        match character {
            '&' => xml.push_str("&amp;"),
            '<' => xml.push_str("&lt;"),
            '>' => xml.push_str("&gt;"),
            '\r' => xml.push_str("&#13;"),
            '\t' | '\n' => xml.push(character),
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => xml.push('\u{fffd}'),
            _ => xml.push(character),
        }
    }
}
