//! Parts that several apps need and none of them owns.
//!
//! - [`random`]: numbers that are the same for a seed, everywhere;
//! - [`each_arity`]: one row for each number of values that a join can have.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod random;

/// Calls a macro with the rows `1: a;`, `2: a b;` and so on to 16: a number and as many names.
///
/// The inputs of a subtask are a tuple, and the number of its elements is part of its type. To
/// choose the number at run time, each arity must be written out; this table does it for all.
#[macro_export]
macro_rules! each_arity {
    ($rows:ident) => {
        $rows! {
            1: a;
            2: a b;
            3: a b c;
            4: a b c d;
            5: a b c d e;
            6: a b c d e f;
            7: a b c d e f g;
            8: a b c d e f g h;
            9: a b c d e f g h i;
            10: a b c d e f g h i j;
            11: a b c d e f g h i j k;
            12: a b c d e f g h i j k l;
            13: a b c d e f g h i j k l m;
            14: a b c d e f g h i j k l m n;
            15: a b c d e f g h i j k l m n o;
            16: a b c d e f g h i j k l m n o p;
        }
    };
}
