//! The table of a kind of text: variant, fields, code and words in one place.

/// Declares an enum whose variants each have a code, which never changes and is for
/// machines, and a text of one line. The text names the fields; what has to be
/// computed of them (they are references there) follows it, as in `write!`.
macro_rules! worded {
    (
        $(#[$about:meta])*
        pub enum $Table:ident {
            $(
                $(#[$doc:meta])*
                $Kind:ident $({ $($field:ident: $Type:ty),+ })? =
                    $code:literal, $text:literal $(, $value:expr)*;
            )+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        #[allow(missing_docs, reason = "the fields' names are the words of the model")]
        pub enum $Table {
            $($(#[$doc])* $Kind $({ $($field: $Type),+ })?,)+
        }

        impl $Table {
            /// Returns the kind as a stable word in snake case.
            #[must_use]
            pub const fn code(&self) -> &'static str {
                match self {
                    $(Self::$Kind { .. } => $code,)+
                }
            }
        }

        impl core::fmt::Display for $Table {
            #[allow(unused_variables, reason = "a text may leave out a field")]
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self {
                    $(Self::$Kind $({ $($field),+ })? => write!(f, $text $(, $value)*),)+
                }
            }
        }
    };
}

pub(super) use worded;
