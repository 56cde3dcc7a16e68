//! Codec properties: no input causes a panic, and encoded values decode to themselves.

use std::fmt::Write as _;

use proptest::{collection::vec, prelude::*};
use ros1::{
    tcpros::{Header, HeaderError, MAX_HEADER},
    xmlrpc::{
        DecodeError, Fault, Value, decode_call, decode_response, encode_call, encode_response,
    },
};

/// Text that XML 1.0 can represent: no control characters but tab, line feed and carriage return.
fn text() -> impl Strategy<Value = String> {
    "[\\t\\n\\r -~\u{80}-\u{d7ff}\u{e000}-\u{fffd}\u{10000}-\u{10ffff}]{0,24}"
}

fn value() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<i32>().prop_map(Value::Int),
        any::<bool>().prop_map(Value::Bool),
        any::<f64>()
            .prop_filter("NaN is not equal to itself", |x| !x.is_nan())
            .prop_map(Value::Double),
        text().prop_map(Value::String),
        "[A-Za-z0-9+/]{0,16}".prop_map(Value::Base64),
        Just(Value::DateTime("20261121T16:00:00".to_owned())),
        Just(Value::Nil),
    ];
    leaf.prop_recursive(6, 64, 6, |inner| {
        let members = prop::collection::btree_map(text(), inner.clone(), 0..6);
        prop_oneof![
            vec(inner, 0..6).prop_map(Value::Array),
            members.prop_map(|members| Value::Struct(members.into_iter().collect())),
        ]
    })
}

/// Tags and texts of XML-RPC in random order, so that the decoder gets beyond the first tag.
fn fragments() -> impl Strategy<Value = String> {
    const FRAGMENTS: &str = "<methodCall> </methodCall> <methodName> </methodName> <params> \
        </params> <param> </param> <value> </value> <int> </int> <array> <data> </data> </array> \
        <struct> <member> <name> </name> <nil/> 1 &lt; &#0; <![CDATA[ ]]>";
    let fragments: Vec<&str> = FRAGMENTS.split(' ').filter(|part| !part.is_empty()).collect();
    vec(prop::sample::select(fragments), 0..40).prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn calls_survive_a_round_trip(method in "[a-zA-Z.]{1,20}", arguments in vec(value(), 0..4)) {
        let xml = encode_call(&method, &arguments);
        let call = decode_call(xml.as_bytes()).unwrap();
        prop_assert_eq!(call.method, method);
        prop_assert_eq!(call.arguments, arguments);
    }

    #[test]
    fn values_and_faults_survive_a_round_trip(value in value(), code: i32, message in text()) {
        let xml = encode_response(&Ok(value.clone()));
        prop_assert_eq!(decode_response(xml.as_bytes()).unwrap(), Ok(value));
        let fault = Err(Fault { code, message });
        prop_assert_eq!(decode_response(encode_response(&fault).as_bytes()).unwrap(), fault);
    }

    #[test]
    fn xmlrpc_fragments_in_any_order_are_decoded_or_refused(xml in fragments()) {
        let _ = (decode_call(xml.as_bytes()), decode_response(xml.as_bytes()));
        let inside = format!("<methodCall><methodName>m</methodName><params><param>{xml}");
        prop_assert!(decode_call(inside.as_bytes()).is_err() || inside.contains("</methodCall>"));
    }

    #[test]
    fn headers_survive_a_round_trip(fields in vec(("[a-z_]{1,12}", any::<String>()), 0..8)) {
        let header = fields.iter().fold(Header::new(), |header, (name, value)| header.with(name, value));
        let bytes = header.encode().unwrap();
        let (length, rest) = bytes.split_first_chunk::<4>().unwrap();
        prop_assert_eq!(u32::from_le_bytes(*length) as usize, rest.len());
        prop_assert_eq!(Header::decode(rest).unwrap(), header);
    }

    #[test]
    fn a_truncated_header_is_refused_or_loses_whole_fields(
        fields in vec(("[a-z_]{1,12}", "[ -~]{0,20}"), 1..6), at: prop::sample::Index
    ) {
        let header = fields.iter().fold(Header::new(), |header, (name, value)| header.with(name, value));
        let bytes = header.encode().unwrap();
        let cut = &bytes[4..4 + at.index(bytes.len() - 4)];
        if let Ok(shorter) = Header::decode(cut) {
            let kept: Vec<_> = shorter.fields().collect();
            let all: Vec<_> = header.fields().collect();
            prop_assert_eq!(&kept[..], &all[..kept.len()]);
            prop_assert!(kept.len() < all.len());
        }
    }
}

#[test]
fn strings_that_are_not_utf8_keep_their_readable_part() {
    let xml = b"<methodCall><methodName>m</methodName><params><param><value>caf\xe9</value></param></params></methodCall>";
    assert_eq!(decode_call(xml).unwrap().arguments, [Value::from("caf\u{fffd}")]);
}

#[test]
fn deeply_nested_values_are_refused() {
    let deep = "<value><array><data>".repeat(100_000);
    let xml = format!("<methodCall><methodName>m</methodName><params><param>{deep}");
    assert!(matches!(decode_call(xml.as_bytes()), Err(DecodeError::TooDeep)));
}

#[test]
fn a_struct_with_200000_members_is_decoded_in_time_and_the_last_duplicate_wins() {
    let mut members = String::new();
    for n in 0..200_000 {
        let name = n % 150_000;
        let _ = write!(members, "<member><name>n{name}</name><value>{n}</value></member>");
    }
    let xml = format!(
        "<methodResponse><params><param><value><struct>{members}</struct></value></param></params></methodResponse>"
    );
    let started = std::time::Instant::now();
    let value = decode_response(xml.as_bytes()).unwrap().unwrap();
    // Decoding takes about 1 s. A linear search for each name would need about 1e10 comparisons.
    assert!(started.elapsed() < std::time::Duration::from_secs(20), "{:?}", started.elapsed());
    assert_eq!(value.member("n1"), Some(&Value::from("150001")));
    assert_eq!(value.member("n149999"), Some(&Value::from("149999")));
}

#[test]
fn entities_are_not_expanded() {
    let xml =
        "<!DOCTYPE x [<!ENTITY a \"bbbb\">]><methodCall><methodName>&a;</methodName></methodCall>";
    assert!(matches!(decode_call(xml.as_bytes()), Err(DecodeError::Entity(name)) if name == "a"));
}

#[test]
fn the_formatting_of_python_peers_is_decoded() {
    let xml =
        b"<?xml version='1.0'?>\n<methodCall>\n<methodName>m</methodName>\n<params>\n<param>\n\
        <value><struct>\n<member>\n<name>a</name>\n<value><boolean>1</boolean></value>\n</member>\n\
        </struct></value>\n</param>\n<param>\n<value><array><data>\n<value><i4>-3</i4></value>\n\
        <value/>\n<value><string/></value><value> plain </value></data></array></value>\n</param>\n\
        </params>\n</methodCall>\n";
    let list = vec![Value::Int(-3), "".into(), "".into(), " plain ".into()];
    let call = decode_call(xml).unwrap();
    assert_eq!(call.arguments[0], Value::Struct(vec![("a".to_owned(), true.into())]));
    assert_eq!(call.arguments[1], Value::Array(list));
}

#[test]
fn a_header_beyond_the_limit_is_not_encoded() {
    let header = Header::new().with("text", &"x".repeat(MAX_HEADER));
    assert!(matches!(header.encode(), Err(HeaderError::TooLong(_))));
}
