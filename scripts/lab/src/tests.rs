//! Tables and records of tests: those that the tool's own tests use.

#[path = "../../tool/src/tests.rs"]
mod tables;

pub(crate) use tables::{altered, made, right, rows};
use text::Malformed;

/// Makes sure that `parse` refuses a text once it is altered: in each row are a part, another in its
/// place, the line of the fault, and words of its reason.
pub(crate) fn assert_malformed<T: std::fmt::Debug>(
    parse: impl Fn(&str) -> Result<T, Malformed>,
    text: &str,
    table: &str,
) {
    for [from, to, line, reason] in rows(table) {
        let fault = parse(&altered(text, [&from, &to])).expect_err(&to);
        assert_eq!(fault.line.to_string(), line, "{to}: {fault}");
        assert!(fault.reason.contains(&reason), "{fault}\n  not: {reason}");
    }
}
