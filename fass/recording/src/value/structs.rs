//! An app's structs.

/// Defines structs whose values can be written down: a struct is written field by field.
///
/// Takes structs with named fields and without parameters, as they would be written without it;
/// the fields' types have to be [`Recordable`](crate::Recordable).
///
/// ```
/// use recording::Recordable;
///
/// recording::recordable! {
///     /// What a sensor has seen.
///     #[derive(Clone, Debug, PartialEq)]
///     pub struct Seen {
///         /// In metres.
///         pub distance: f64,
///         pub colours: [u8; 3],
///     }
/// }
/// let schema = Seen::schema();
/// assert_eq!(schema.to_string(), "Seen { distance: f64, colours: [u8; 3] }");
/// let seen = Seen { distance: 1.0, colours: [1, 2, 3] };
/// assert_eq!(Seen::from_bytes(&recording::to_bytes(&seen)), Ok(seen));
/// ```
#[macro_export]
macro_rules! recordable {
    ($(
        $(#[$attribute:meta])*
        $visible:vis struct $Struct:ident {
            $($(#[$of_field:meta])* $field_visible:vis $field:ident: $Type:ty),* $(,)?
        }
    )*) => {
        $(
            $(#[$attribute])*
            $visible struct $Struct {
                $($(#[$of_field])* $field_visible $field: $Type),*
            }

            impl $crate::Recordable for $Struct {
                const LEAST_BYTES: usize = 0 $(+ <$Type as $crate::Recordable>::LEAST_BYTES)*;
                const DEPTH: usize =
                    $crate::deepest(&[$(<$Type as $crate::Recordable>::DEPTH),*]);

                fn schema() -> $crate::Schema {
                    $crate::Schema::of_struct(
                        stringify!($Struct),
                        [$((stringify!($field), <$Type as $crate::Recordable>::schema())),*],
                    )
                }

                fn encode(&self, out: &mut $crate::Encoder<'_>) {
                    $($crate::Recordable::encode(&self.$field, out);)*
                }

                fn decode(input: &mut $crate::Decoder<'_>) -> Result<Self, $crate::Malformed> {
                    Ok(Self { $($field: $crate::Recordable::decode(input)?),* })
                }
            }
        )*
    };
}
