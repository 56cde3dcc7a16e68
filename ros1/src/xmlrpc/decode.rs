//! XML to values. Bounded: nesting is limited here, length by the HTTP reader.

use std::{
    borrow::Cow,
    collections::HashMap,
    num::{ParseFloatError, ParseIntError},
};

use quick_xml::{
    Reader,
    events::{BytesRef, Event},
};

use super::value::{Fault, Value};

/// Levels of arrays and structs. Python's reader has no limit; 64 is far beyond any parameter
/// tree and keeps the stack of this recursive reader small.
const MAX_DEPTH: u32 = 64;

/// Why a body is not a call or an answer.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Not well-formed.
    #[error("the XML is not well-formed: {0}")]
    Xml(#[from] quick_xml::Error),
    /// A reference that is neither a character nor one of XML's five.
    #[error("unknown entity &{0};")]
    Entity(String),
    /// A tag or a text where XML-RPC has none.
    #[error("expected {expected}, found {found}")]
    Unexpected {
        /// What the grammar wants here.
        expected: &'static str,
        /// What stood there.
        found: String,
    },
    /// Text that is not an integer of 32 bits.
    #[error("not a 32-bit integer: {text:?}: {source}")]
    Int {
        /// The text.
        text: String,
        /// What the parser said.
        source: ParseIntError,
    },
    /// Text that is not a number.
    #[error("not a number: {text:?}: {source}")]
    Double {
        /// The text.
        text: String,
        /// What the parser said.
        source: ParseFloatError,
    },
    /// Text that is neither 0 nor 1.
    #[error("not a boolean (0 or 1): {0:?}")]
    Bool(String),
    /// Arrays and structs nested too deep.
    #[error("values nested deeper than {MAX_DEPTH} levels")]
    TooDeep,
}

/// A call as it came in.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodCall {
    /// The method's name.
    pub method: String,
    /// Its arguments.
    pub arguments: Vec<Value>,
}

/// Reads a call. Bytes that are not UTF-8 are replaced by U+FFFD, because other nodes send such
/// strings and the rest of the call still has a meaning.
///
/// # Errors
/// The body is not an XML-RPC call.
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

/// Reads an answer.
///
/// # Errors
/// The body is not an XML-RPC answer; a fault is no error here.
pub fn decode_response(body: &[u8]) -> Result<Result<Value, Fault>, DecodeError> {
    let text = String::from_utf8_lossy(body);
    let mut document = Document::new(&text);
    document.open("methodResponse")?;
    let response = match document.tag()? {
        Tag::Open(tag) if tag == "params" => {
            document.open("param")?;
            document.open("value")?;
            let value = document.value(0)?;
            document.close()?;
            Ok(value)
        }
        Tag::Open(tag) if tag == "fault" => {
            document.open("value")?;
            let value = document.value(0)?;
            Err(Fault {
                code: value
                    .member("faultCode")
                    .and_then(Value::as_int)
                    .unwrap_or(0),
                message: value
                    .member("faultString")
                    .and_then(Value::as_str)
                    .unwrap_or("no faultString")
                    .to_owned(),
            })
        }
        other => return Err(other.unexpected("<params> or <fault>")),
    };
    document.close()?;
    document.close()?;
    document.end()?;
    Ok(response)
}

enum Tag {
    Open(String),
    Close,
    Text(String),
    End,
}

impl Tag {
    fn unexpected(self, expected: &'static str) -> DecodeError {
        let found = match self {
            Self::Open(tag) => format!("<{tag}>"),
            Self::Close => "a closing tag".to_owned(),
            Self::Text(text) => format!("text {text:?}"),
            Self::End => "the end".to_owned(),
        };
        DecodeError::Unexpected { expected, found }
    }
}

struct Document<'a> {
    reader: Reader<&'a [u8]>,
}

impl<'a> Document<'a> {
    fn new(text: &'a str) -> Self {
        let mut reader = Reader::from_str(text);
        reader.config_mut().expand_empty_elements = true;
        Self { reader }
    }

    /// The next event that carries meaning: comments and declarations are skipped.
    fn piece(&mut self) -> Result<Tag, DecodeError> {
        loop {
            return Ok(match self.reader.read_event()? {
                Event::Start(start) => Tag::Open(start.name().as_ref().to_owned()),
                Event::End(_) => Tag::Close,
                Event::Text(text) => Tag::Text(text.xml10_content().into_owned()),
                Event::CData(text) => Tag::Text(text.xml10_content().into_owned()),
                Event::GeneralRef(reference) => Tag::Text(resolve(&reference)?.into_owned()),
                Event::Eof => Tag::End,
                _ => continue,
            });
        }
    }

    /// The next tag: white space between tags is skipped.
    fn tag(&mut self) -> Result<Tag, DecodeError> {
        loop {
            match self.piece()? {
                Tag::Text(text) if text.trim().is_empty() => {}
                tag => return Ok(tag),
            }
        }
    }

    fn open(&mut self, name: &'static str) -> Result<(), DecodeError> {
        match self.tag()? {
            Tag::Open(tag) if tag == name => Ok(()),
            other => Err(other.unexpected(name)),
        }
    }

    /// True: the tag was opened; false: the surrounding one was closed.
    fn open_or_close(&mut self, name: &'static str) -> Result<bool, DecodeError> {
        match self.tag()? {
            Tag::Open(tag) if tag == name => Ok(true),
            Tag::Close => Ok(false),
            other => Err(other.unexpected(name)),
        }
    }

    fn close(&mut self) -> Result<(), DecodeError> {
        match self.tag()? {
            Tag::Close => Ok(()),
            other => Err(other.unexpected("a closing tag")),
        }
    }

    fn end(&mut self) -> Result<(), DecodeError> {
        loop {
            match self.tag()? {
                Tag::Close => {}
                Tag::End => return Ok(()),
                other => return Err(other.unexpected("the end")),
            }
        }
    }

    fn text_until_close(&mut self) -> Result<String, DecodeError> {
        let mut text = String::new();
        loop {
            match self.piece()? {
                Tag::Text(part) => text.push_str(&part),
                Tag::Close => return Ok(text),
                other => return Err(other.unexpected("text")),
            }
        }
    }

    /// A value whose `<value>` has been read; reads its `</value>` too.
    fn value(&mut self, depth: u32) -> Result<Value, DecodeError> {
        if depth >= MAX_DEPTH {
            return Err(DecodeError::TooDeep);
        }
        let mut text = String::new();
        let tag = loop {
            match self.piece()? {
                Tag::Text(part) => text.push_str(&part),
                Tag::Close => return Ok(Value::String(text)),
                Tag::Open(tag) if text.trim().is_empty() => break tag,
                other => return Err(other.unexpected("a value")),
            }
        };
        let value = match tag.as_str() {
            "int" | "i4" => self.int()?,
            "boolean" => self.boolean()?,
            "double" => self.double()?,
            "string" => Value::String(self.text_until_close()?),
            "base64" => Value::Base64(self.text_until_close()?),
            "dateTime.iso8601" => Value::DateTime(self.text_until_close()?),
            "nil" => {
                self.close()?;
                Value::Nil
            }
            "array" => self.array(depth)?,
            "struct" => self.structure(depth)?,
            _ => return Err(Tag::Open(tag).unexpected("a type of XML-RPC")),
        };
        self.close()?;
        Ok(value)
    }

    fn int(&mut self) -> Result<Value, DecodeError> {
        let text = self.text_until_close()?;
        match text.trim().parse() {
            Ok(number) => Ok(Value::Int(number)),
            Err(source) => Err(DecodeError::Int { text, source }),
        }
    }

    fn boolean(&mut self) -> Result<Value, DecodeError> {
        let text = self.text_until_close()?;
        match text.trim() {
            "0" => Ok(Value::Bool(false)),
            "1" => Ok(Value::Bool(true)),
            _ => Err(DecodeError::Bool(text)),
        }
    }

    fn double(&mut self) -> Result<Value, DecodeError> {
        let text = self.text_until_close()?;
        match text.trim().parse() {
            Ok(number) => Ok(Value::Double(number)),
            Err(source) => Err(DecodeError::Double { text, source }),
        }
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
        // A body has room for a million members: to look each up in turn would take minutes.
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

fn resolve(reference: &BytesRef<'_>) -> Result<Cow<'static, str>, DecodeError> {
    if let Some(character) = reference.resolve_char_ref()? {
        return Ok(Cow::Owned(character.to_string()));
    }
    Ok(Cow::Borrowed(match &**reference {
        "lt" => "<",
        "gt" => ">",
        "amp" => "&",
        "quot" => "\"",
        "apos" => "'",
        other => return Err(DecodeError::Entity(other.to_owned())),
    }))
}
