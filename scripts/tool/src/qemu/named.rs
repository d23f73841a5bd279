//! Choices that have names on command lines.

/// Makes an enumeration each of whose choices has a name, by which it is written and read.
macro_rules! named {
    ($(#[$about:meta])* $kind:ident {
        $($(#[$what:meta])* $choice:ident = $name:literal,)*
    }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $kind {
            $($(#[$what])* $choice,)*
        }

        impl $kind {
            /// The names, as they stand on command lines.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Returns the choice of that name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$choice),)*
                    _ => None,
                }
            }

            /// Returns the choice's name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$choice => $name,)*
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}
