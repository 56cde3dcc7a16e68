//! The token that a viewer must know.

use std::io;
use std::str::FromStr;

use thiserror::Error;

/// Allowed lengths of a token, in characters. 16 random characters from a set of 64 have 96 bits of
/// entropy.
const LENGTH: std::ops::RangeInclusive<usize> = 16..=128;

/// Secret of the users who may send commands, and who may view from another machine.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// Error for a text that is no valid token.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("a token has 16 to 128 letters, digits, - and _; `openssl rand -hex 16` prints one")]
pub struct TokenError;

impl Token {
    /// Returns a token of 128 random bits.
    pub(crate) fn random() -> io::Result<Token> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).map_err(io::Error::other)?;
        Ok(Token(format!("{:032x}", u128::from_le_bytes(bytes))))
    }

    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns whether `other` is this token. The run time depends only on the length of `other`,
    /// so that it reveals no character.
    pub(crate) fn matches(&self, other: &str) -> bool {
        let pairs = self.0.bytes().cycle().zip(other.bytes());
        let difference = pairs.fold(0, |all, (own, other)| all | (own ^ other));
        difference == 0 && other.len() == self.0.len()
    }
}

/// Hides the token from logs.
impl std::fmt::Debug for Token {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Token(..)")
    }
}

impl FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Token, TokenError> {
        let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
        let is_token = LENGTH.contains(&text.len()) && text.bytes().all(is_allowed);
        is_token.then(|| Token(text.to_owned())).ok_or(TokenError)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_token_matches() {
        let token: Token = "abcdefgh-_012345".parse().expect("a token");
        assert!(token.matches("abcdefgh-_012345"));
        for other in ["", "a", "abcdefgh-_012346", "abcdefgh-_012345abcdefgh-_012345"] {
            assert!(!token.matches(other), "{other}");
        }
        assert_eq!(format!("{token:?}"), "Token(..)");
    }

    #[test]
    fn short_tokens_and_other_characters_are_refused() {
        for text in ["", "abcdefgh-_01234", "abcdefgh 0123456", "äbcdefgh0123456"] {
            assert_eq!(text.parse::<Token>(), Err(TokenError), "{text}");
        }
        let random = Token::random().expect("random bytes");
        assert_eq!(random.as_str().parse(), Ok(random.clone()));
        assert_ne!(random, Token::random().expect("random bytes"));
    }
}
