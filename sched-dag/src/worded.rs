//! The table of a kind of text: variant, fields, code and words in one place.

/// Declares an enum whose variants each have a code and a text of one line. The code never changes
/// and is for machines. The text names the fields; expressions computed from the fields (references
/// there) follow the text, as in `write!`. A variant may instead hold another text, with a name in
/// parentheses; then `of` names the source of its code.
///
/// If the texts need more than the fields, brackets behind the enum's name declare the additional
/// argument, and `words` takes it. Such a table may declare a type, in parentheses, for the columns
/// of a row next to its code; `columns` returns them. The caller writes the `Display` of such a
/// table. The doc comment of a variant is its meaning in `MEANINGS`, and so an output.
#[doc(hidden)]
#[macro_export]
macro_rules! worded {
    ($(#[$about:meta])* pub enum $Table:ident { $($rows:tt)+ }) => {
        $crate::worded! { $(#[$about])* pub enum $Table[_nothing: ()] -> () { $($rows)+ } }

        impl core::fmt::Display for $Table {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                self.words((), f)
            }
        }
    };
    (
        $(#[$about:meta])*
        pub enum $Table:ident[$needed:ident: $Needed:ty] -> $Columns:ty {
            $(
                $(#[doc = $doc:literal])+
                $Kind:ident $({ $($field:ident: $Type:ty),+ })? $(($inner:ident: $Inner:ty))? =
                    $($code:literal)? $(of $whose:expr)?, $(($($column:expr),+),)?
                    $text:literal $(, $value:expr)*;
            )+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        #[allow(missing_docs, reason = "the fields' names are the words of the model")]
        pub enum $Table {
            $($(#[doc = $doc])+ $Kind $({ $($field: $Type),+ })? $(($Inner))?,)+
        }

        impl $Table {
            /// The codes of all variants with a code of their own.
            pub const CODES: &'static [&'static str] = &[$($($code,)?)+];

            /// The text of every variant, with braces for the variable parts.
            pub const TEXTS: &'static [&'static str] = &[$($text,)+];

            /// The documented meaning of every variant.
            pub const MEANINGS: &'static [&'static str] = &[$(concat!($($doc),+),)+];

            /// Returns the kind as a stable word in snake case.
            #[allow(unused_variables, reason = "few codes depend on a field")]
            pub fn code(&self) -> &'static str {
                match self {
                    $(Self::$Kind $({ $($field),+ })? $(($inner))? => $($code)? $($whose)?,)+
                }
            }

            #[allow(dead_code, unused_variables, reason = "few tables say more, of few fields")]
            const fn columns(&self) -> $Columns {
                match self {
                    $(Self::$Kind $({ $($field),+ })? $(($inner))? => ($($($column),+)?),)+
                }
            }

            #[allow(unused_variables, reason = "a text may leave out a field")]
            fn words(&self, $needed: $Needed, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self {
                    $(Self::$Kind $({ $($field),+ })? $(($inner))? => write!(f, $text $(, $value)*),)+
                }
            }
        }
    };
}

/// Declares an enum whose variants each have only a text, which names the fields like a
/// [`worded`](crate::worded!) text.
macro_rules! texts {
    ($(#[$about:meta])* pub enum $Table:ident {
        $(
            $(#[doc = $doc:literal])+
            $Kind:ident $({ $($field:ident: $Type:ty),+ })? $(($inner:ident: $Inner:ty))? =
                $text:literal $(, $value:expr)*;
        )+
    }) => {
        $(#[$about])*
        #[allow(missing_docs, reason = "the fields' names are the words of the model")]
        pub enum $Table {
            $($(#[doc = $doc])+ $Kind $({ $($field: $Type),+ })? $(($Inner))?,)+
        }

        impl $Table {
            /// The text of every variant, with braces for the variable parts.
            pub const TEXTS: &'static [&'static str] = &[$($text,)+];
        }

        impl core::fmt::Display for $Table {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self {
                    $(Self::$Kind $({ $($field),+ })? $(($inner))? => write!(f, $text $(, $value)*),)+
                }
            }
        }
    };
}

pub(crate) use texts;
