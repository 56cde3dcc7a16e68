//! The XML form of XML-RPC calls and responses. The decoder limits the depth of nesting; the HTTP
//! reader limits the length.

use std::{collections::HashMap, fmt::Write as _};

use quick_xml::{
    Reader,
    events::{BytesRef, Event},
};

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
        Value::Int(number) => push_element(xml, "int", &number.to_string()),
        Value::Bool(flag) => push_element(xml, "boolean", if *flag { "1" } else { "0" }),
        Value::Double(number) => push_element(xml, "double", &number.to_string()),
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

fn push_element(xml: &mut String, tag: &str, text: &str) {
    // Writing to a String cannot fail.
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

/// Maximum nesting of arrays and structs, which bounds the stack of the recursive decoder. Real
/// parameter trees have far fewer levels than 64. Python's decoder has no limit.
const MAX_DEPTH: u32 = 64;

/// Why a body is not an XML-RPC call or response.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The XML is not well-formed.
    #[error("the XML is not well-formed: {0}")]
    Xml(#[from] quick_xml::Error),
    /// An entity reference that is neither a character reference nor one of XML's five predefined
    /// entities; holds the entity's name.
    #[error("unknown entity &{0};")]
    Entity(String),
    /// A tag or text that XML-RPC's grammar does not allow at this position.
    #[error("expected {expected}, found {found}")]
    Unexpected {
        /// Tags or texts that XML-RPC's grammar allows at this position.
        expected: &'static str,
        /// Tag or text that the document has at this position.
        found: String,
    },
    /// The text of an `<int>` is not a 32-bit integer, the text of a `<double>` is not a number, or
    /// the text of a `<boolean>` is neither 0 nor 1. Holds the expected form and the text.
    #[error("not {}: '{}'", .0, .1.escape_debug())]
    Scalar(&'static str, String),
    /// Arrays and structs are nested deeper than 64 levels.
    #[error("values nested deeper than {MAX_DEPTH} levels")]
    TooDeep,
}

/// An XML-RPC call as a server receives it.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodCall {
    /// Method name, such as `registerPublisher`.
    pub method: String,
    /// Positional arguments. In ROS APIs, the first is the caller's name.
    pub arguments: Vec<Value>,
}

/// Decodes an XML-RPC call. Bytes that are not UTF-8 become U+FFFD, because other nodes send such
/// strings and the rest of the call is still usable.
///
/// # Errors
/// [`DecodeError`] if the body is not an XML-RPC call.
pub fn decode_call(body: &[u8]) -> Result<MethodCall, DecodeError> {
    let text = String::from_utf8_lossy(body);
    let mut document = Document::new(&text);
    document.open("methodCall")?;
    document.open("methodName")?;
    let method = document.text_until_close()?;
    let mut arguments = Vec::new();
    // A call without arguments may leave <params> out.
    if document.open_or_close("params")? {
        while document.open_or_close("param")? {
            document.open("value")?;
            arguments.push(document.value(0)?);
            document.close()?;
        }
        document.close()?;
    }
    document.end()?;
    Ok(MethodCall { method, arguments })
}

/// Decodes an XML-RPC response. Returns its value, or the fault as the inner error.
///
/// # Errors
/// [`DecodeError`] if the body is not an XML-RPC response.
pub fn decode_response(body: &[u8]) -> Result<Result<Value, Fault>, DecodeError> {
    let text = String::from_utf8_lossy(body);
    let mut document = Document::new(&text);
    document.open("methodResponse")?;
    let response = match document.next_tag()? {
        Token::Open(tag) if tag == "params" => {
            document.open("param")?;
            document.open("value")?;
            let value = document.value(0)?;
            document.close()?;
            Ok(value)
        }
        Token::Open(tag) if tag == "fault" => {
            document.open("value")?;
            let value = document.value(0)?;
            let code = value.member("faultCode").and_then(Value::as_int);
            let message = value.member("faultString").and_then(Value::as_str);
            Err(Fault {
                code: code.unwrap_or(0),
                message: message.unwrap_or("no faultString").to_owned(),
            })
        }
        other => return Err(other.unexpected("<params> or <fault>")),
    };
    document.close()?;
    document.close()?;
    document.end()?;
    Ok(response)
}

/// A part of the document as the decoder reads it: an opening tag with its name, a closing tag,
/// text, or the document's end.
enum Token {
    Open(String),
    Close,
    Text(String),
    End,
}

impl Token {
    /// Returns the error for this token at a position where XML-RPC's grammar requires `expected`.
    fn unexpected(self, expected: &'static str) -> DecodeError {
        let found = match self {
            Self::Open(tag) => format!("<{tag}>"),
            Self::Close => "a closing tag".to_owned(),
            Self::Text(text) => format!("text '{}'", text.escape_debug()),
            Self::End => "the end".to_owned(),
        };
        DecodeError::Unexpected { expected, found }
    }
}

/// The XML of one call or response, read from front to back.
struct Document<'a> {
    reader: Reader<&'a [u8]>,
}

impl<'a> Document<'a> {
    fn new(text: &'a str) -> Self {
        let mut reader = Reader::from_str(text);
        reader.config_mut().expand_empty_elements = true;
        Self { reader }
    }

    /// Reads the next token, skipping comments and declarations.
    fn next_token(&mut self) -> Result<Token, DecodeError> {
        loop {
            return Ok(match self.reader.read_event()? {
                Event::Start(start) => Token::Open(start.name().as_ref().to_owned()),
                Event::End(_) => Token::Close,
                Event::Text(text) => Token::Text(text.xml10_content().into_owned()),
                Event::CData(text) => Token::Text(text.xml10_content().into_owned()),
                Event::GeneralRef(reference) => Token::Text(resolve(&reference)?),
                Event::Eof => Token::End,
                _ => continue,
            });
        }
    }

    /// Reads the next token, skipping white space between tags.
    fn next_tag(&mut self) -> Result<Token, DecodeError> {
        loop {
            match self.next_token()? {
                Token::Text(text) if text.trim().is_empty() => {}
                tag => return Ok(tag),
            }
        }
    }

    /// Reads the opening tag `name`.
    fn open(&mut self, name: &'static str) -> Result<(), DecodeError> {
        match self.next_tag()? {
            Token::Open(tag) if tag == name => Ok(()),
            other => Err(other.unexpected(name)),
        }
    }

    /// Reads one tag: returns true for the opening tag `name` and false for the closing tag of the
    /// element that encloses it.
    fn open_or_close(&mut self, name: &'static str) -> Result<bool, DecodeError> {
        match self.next_tag()? {
            Token::Open(tag) if tag == name => Ok(true),
            Token::Close => Ok(false),
            other => Err(other.unexpected(name)),
        }
    }

    /// Reads a closing tag. The XML reader has checked that it matches the opening tag.
    fn close(&mut self) -> Result<(), DecodeError> {
        match self.next_tag()? {
            Token::Close => Ok(()),
            other => Err(other.unexpected("a closing tag")),
        }
    }

    /// Reads the remaining closing tags and the end of the document.
    fn end(&mut self) -> Result<(), DecodeError> {
        loop {
            match self.next_tag()? {
                Token::Close => {}
                Token::End => return Ok(()),
                other => return Err(other.unexpected("the end")),
            }
        }
    }

    /// Reads text up to the closing tag, including that tag.
    fn text_until_close(&mut self) -> Result<String, DecodeError> {
        let mut text = String::new();
        loop {
            match self.next_token()? {
                Token::Text(part) => text.push_str(&part),
                Token::Close => return Ok(text),
                other => return Err(other.unexpected("text")),
            }
        }
    }

    /// Reads the rest of a value whose `<value>` tag has been read, including the `</value>` tag.
    fn value(&mut self, depth: u32) -> Result<Value, DecodeError> {
        if depth >= MAX_DEPTH {
            return Err(DecodeError::TooDeep);
        }
        let mut text = String::new();
        let tag = loop {
            match self.next_token()? {
                Token::Text(part) => text.push_str(&part),
                Token::Close => return Ok(Value::String(text)),
                Token::Open(tag) if text.trim().is_empty() => break tag,
                other => return Err(other.unexpected("a value")),
            }
        };
        let value = match tag.as_str() {
            "int" | "i4" => {
                self.scalar("a 32-bit integer", |text| text.parse().ok().map(Value::Int))?
            }
            "boolean" => self.scalar("0 or 1", |text| match text {
                "0" => Some(Value::Bool(false)),
                "1" => Some(Value::Bool(true)),
                _ => None,
            })?,
            "double" => self.scalar("a number", |text| text.parse().ok().map(Value::Double))?,
            "string" => Value::String(self.text_until_close()?),
            "base64" => Value::Base64(self.text_until_close()?),
            "dateTime.iso8601" => Value::DateTime(self.text_until_close()?),
            "nil" => {
                self.close()?;
                Value::Nil
            }
            "array" => self.array(depth)?,
            "struct" => self.structure(depth)?,
            _ => return Err(Token::Open(tag).unexpected("a type of XML-RPC")),
        };
        self.close()?;
        Ok(value)
    }

    /// Reads the text up to the closing tag, trims it and converts it with `parse`. `what` is the
    /// expected form, for the error message.
    fn scalar(
        &mut self,
        what: &'static str,
        parse: impl Fn(&str) -> Option<Value>,
    ) -> Result<Value, DecodeError> {
        let text = self.text_until_close()?;
        parse(text.trim()).ok_or(DecodeError::Scalar(what, text))
    }

    fn array(&mut self, depth: u32) -> Result<Value, DecodeError> {
        let mut items = Vec::new();
        if self.open_or_close("data")? {
            while self.open_or_close("value")? {
                items.push(self.value(depth + 1)?);
            }
            self.close()?;
        }
        Ok(Value::Array(items))
    }

    fn structure(&mut self, depth: u32) -> Result<Value, DecodeError> {
        let mut members: Vec<(String, Value)> = Vec::new();
        // Index the members by name: a body can hold a million members, and a linear search for
        // each name would take minutes.
        let mut places: HashMap<String, usize> = HashMap::new();
        while self.open_or_close("member")? {
            self.open("name")?;
            let name = self.text_until_close()?;
            self.open("value")?;
            let value = self.value(depth + 1)?;
            self.close()?;
            if let Some(&place) = places.get(&name) {
                members[place].1 = value;
            } else {
                places.insert(name.clone(), members.len());
                members.push((name, value));
            }
        }
        Ok(Value::Struct(members))
    }
}

/// Returns the text that an entity or character reference stands for.
fn resolve(reference: &BytesRef<'_>) -> Result<String, DecodeError> {
    if let Some(character) = reference.resolve_char_ref()? {
        return Ok(character.to_string());
    }
    let text = match &**reference {
        "lt" => "<",
        "gt" => ">",
        "amp" => "&",
        "quot" => "\"",
        "apos" => "'",
        other => return Err(DecodeError::Entity(other.to_owned())),
    };
    Ok(text.to_owned())
}
