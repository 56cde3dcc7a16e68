//! Declarations of small types of the wire: enums of one byte and sets of bits.

/// Declares an enum that is one byte on the wire. A byte that no variant has is stored in the
/// variant `Newer`, whose description is the text after `_ =>`.
macro_rules! byte_enum {
    (
        $(#[$attribute:meta])*
        pub enum $name:ident {
            $($(#[$variant_attribute:meta])* $variant:ident = $byte:literal,)*
            _ => $newer:literal,
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(from = "u8", into = "u8")]
        pub enum $name {
            $($(#[$variant_attribute])* $variant,)*
            #[doc = $newer]
            Newer(u8),
        }

        impl From<u8> for $name {
            fn from(byte: u8) -> $name {
                match byte {
                    $($byte => $name::$variant,)*
                    newer => $name::Newer(newer),
                }
            }
        }

        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                match value {
                    $($name::$variant => $byte,)*
                    $name::Newer(newer) => newer,
                }
            }
        }
    };
}

/// Declares a set of up to 16 bits. Bits without a name are kept.
macro_rules! bit_set {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident {
            $($(#[$bit_attribute:meta])* const $constant:ident = $bit:literal;)*
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $name(u16);

        impl $name {
            $($(#[$bit_attribute])* pub const $constant: $name = $name(1 << $bit);)*

            /// Returns the empty set.
            pub const fn empty() -> $name {
                $name(0)
            }

            /// Builds a set from its wire representation; bits without a name are kept.
            pub const fn from_bits(bits: u16) -> $name {
                $name(bits)
            }

            /// Returns the wire representation, bits without a name included.
            pub const fn bits(self) -> u16 {
                self.0
            }

            /// Returns true if every bit of `other` is in this set.
            pub const fn contains(self, other: $name) -> bool {
                self.0 & other.0 == other.0
            }

            /// Returns true if no bit is set, named or not.
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }
        }

        impl core::ops::BitOr for $name {
            type Output = $name;

            fn bitor(self, other: $name) -> $name {
                $name(self.0 | other.0)
            }
        }

        impl core::ops::BitOrAssign for $name {
            fn bitor_assign(&mut self, other: $name) {
                self.0 |= other.0;
            }
        }
    };
}
