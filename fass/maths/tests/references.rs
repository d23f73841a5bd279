//! Results against true values, which `references.py` has calculated in 90 digits.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use maths::{acos, asin, atan, atan2, cos, sin, sqrt, tan};

/// The functions, their largest errors in ulp as stated, and what they are of a row's numbers.
type Function = (&'static str, f64, fn(&[f64]) -> f64);

const FUNCTIONS: [Function; 7] = [
    ("acos", 3.0, |of| acos(of[0])),
    ("asin", 3.0, |of| asin(of[0])),
    ("atan", 2.0, |of| atan(of[0])),
    ("atan2", 2.0, |of| atan2(of[0], of[1])),
    ("cos", 1.0, |of| cos(of[0])),
    ("sin", 1.0, |of| sin(of[0])),
    ("tan", 2.0, |of| tan(of[0])),
];

#[test]
fn errors_are_within_what_is_stated() {
    let bits = |word| f64::from_bits(u64::from_str_radix(word, 16).expect("a double"));
    let mut tested = BTreeSet::new();
    for row in include_str!("references.txt").lines() {
        let (name, numbers) = row.split_once(' ').expect("a function");
        let numbers: Vec<f64> = numbers.split(' ').map(bits).collect();
        let (_, stated, function) = (FUNCTIONS.iter())
            .find(|function| function.0 == name)
            .expect("a function");
        let [.., high, low] = numbers[..] else {
            panic!("no value: {row}");
        };
        let result = function(&numbers);
        let ulp = f64::from_bits(high.abs().to_bits() + 1) - high.abs();
        let error = ((result - high) - low).abs() / ulp;
        assert!(error <= *stated, "{row}: {result}, {error} ulp");
        tested.insert(name);
    }
    assert_eq!(tested.len(), FUNCTIONS.len());
}

#[test]
fn what_has_an_exact_value_has_it() {
    let inf = f64::INFINITY;
    for (value, expected) in [
        (sin(-0.0), -0.0),
        (cos(0.0), 1.0),
        (atan2(0.0, 0.0), 0.0),
        (atan2(-0.0, 0.0), -0.0),
        (atan2(0.0, -0.0), PI),
        (atan2(1.0, 0.0), FRAC_PI_2),
        (atan2(inf, inf), FRAC_PI_4),
        (atan2(5.0, inf), 0.0),
        (acos(1.0), 0.0),
        (asin(1.0), FRAC_PI_2),
        (sqrt(2.0), 2.0_f64.sqrt()),
        (sqrt(-0.0), -0.0),
    ] {
        assert_eq!(value.to_bits(), f64::to_bits(expected), "{expected}");
    }
}

#[test]
fn what_has_no_value_is_nan() {
    let inf = f64::INFINITY;
    let none = [
        sin(inf),
        cos(-inf),
        tan(1.1e6),
        asin(1.1),
        acos(-1.1),
        sqrt(-1.0),
        sin(f64::NAN),
    ];
    assert!(none.iter().all(|value| value.is_nan()), "{none:?}");
}
