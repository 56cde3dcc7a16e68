//! Settings of the core as options of a command line.

use bridge_core::Choice;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Returns the parser of an option that takes one of the values of `T`.
pub fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let values = T::CHOICES.iter().map(|(name, help, _)| {
        let help = help.strip_suffix('.').unwrap_or(help);
        PossibleValue::new(*name).help(help)
    });
    PossibleValuesParser::new(values).try_map(|name| {
        let mut choices = T::CHOICES.iter();
        let found = choices.find(|(known, _, _)| *known == name);
        found.map(|(_, _, value)| *value).ok_or("unknown value")
    })
}
