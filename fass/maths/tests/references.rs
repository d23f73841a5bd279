//! Results against true values, which `references.py` has calculated in 90 digits.

use std::collections::BTreeMap;

use maths::{acos, asin, atan, atan2, cos, sin, sqrt, tan};

/// Returns each function's largest error, in ulp.
fn largest_errors() -> BTreeMap<&'static str, f64> {
    let mut largest = BTreeMap::new();
    for row in include_str!("references.txt").lines() {
        let (name, numbers) = row.split_once(' ').expect("a function");
        let numbers: Vec<f64> = numbers
            .split(' ')
            .map(|bits| f64::from_bits(u64::from_str_radix(bits, 16).expect("a double")))
            .collect();
        let (result, [.., high, low]) = (call(name, &numbers), &numbers[..]) else {
            panic!("no value: {row}");
        };
        let ulp = f64::from_bits(high.abs().to_bits() + 1) - high.abs();
        let error = ((result - high) - low).abs() / ulp;
        assert!(error < 3.0, "{row}: {result}, {error} ulp");
        let of_function: &mut f64 = largest.entry(name).or_default();
        *of_function = of_function.max(error);
    }
    largest
}

fn call(name: &str, numbers: &[f64]) -> f64 {
    match (name, numbers) {
        ("atan2", &[y, x, ..]) => atan2(y, x),
        ("sin", &[x, ..]) => sin(x),
        ("cos", &[x, ..]) => cos(x),
        ("tan", &[x, ..]) => tan(x),
        ("atan", &[x, ..]) => atan(x),
        ("asin", &[x, ..]) => asin(x),
        ("acos", &[x, ..]) => acos(x),
        _ => panic!("no function {name}"),
    }
}

#[test]
fn errors_are_within_what_is_stated() {
    let largest = largest_errors();
    println!("{largest:.3?}");
    let stated = [
        ("acos", 3.0),
        ("asin", 3.0),
        ("atan", 2.0),
        ("atan2", 2.0),
        ("cos", 1.0),
        ("sin", 1.0),
        ("tan", 2.0),
    ];
    assert!(largest.keys().eq(stated.map(|(name, _)| name).iter()));
    for (name, ulp) in stated {
        assert!(largest[name] <= ulp, "{name}: {} ulp", largest[name]);
    }
}

#[test]
fn what_has_an_exact_value_has_it() {
    for (value, expected) in [
        (sin(-0.0), -0.0),
        (cos(0.0), 1.0),
        (atan2(0.0, 0.0), 0.0),
        (atan2(-0.0, 0.0), -0.0),
        (atan2(0.0, -0.0), std::f64::consts::PI),
        (atan2(1.0, 0.0), std::f64::consts::FRAC_PI_2),
        (
            atan2(f64::INFINITY, f64::INFINITY),
            std::f64::consts::FRAC_PI_4,
        ),
        (atan2(5.0, f64::INFINITY), 0.0),
        (acos(1.0), 0.0),
        (asin(1.0), std::f64::consts::FRAC_PI_2),
        (sqrt(2.0), 2.0_f64.sqrt()),
        (sqrt(-0.0), -0.0),
    ] {
        assert_eq!(
            value.to_bits(),
            f64::to_bits(expected),
            "{value} {expected}"
        );
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
