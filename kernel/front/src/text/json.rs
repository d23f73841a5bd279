//! The only printer of machine lines: a line is a JSON object, with `{` in column 0.
//!
//! `docs/formats.md` lists the kinds. A closure that names the fields describes an object, so
//! printing an object allocates nothing.
//!
//! Some of the kinds (`KERNELS`) decide the verdict on a run. The kernel alone prints those, by
//! `report`; apps use [`emit`].

use core::fmt::{self, Display, Formatter};

use sched_dag::law::Distribution;

use super::console;

/// Writes the fields of a single object.
///
/// ```no_run
/// let line = kernel::json::line("run", |line| {
///     line.number("jobs", 3_u64)
///         .flag("proven", true)
///         .text("dag", "vision")
///         .object("response_ns", |object| {
///             object.number("max", 20_u64);
///         })
///         .list("cores", [0, 1].iter());
/// });
/// assert_eq!(
///     line.to_string(),
///     r#"{"kind":"run","jobs":3,"proven":true,"dag":"vision","response_ns":{"max":20},"cores":[0,1]}"#
/// );
/// ```
#[expect(missing_debug_implementations, reason = "a `Formatter` has none")]
pub struct JsonObject<'a, 'f> {
    out: &'a mut Formatter<'f>,
    first: bool,
    result: fmt::Result,
}

impl JsonObject<'_, '_> {
    /// Writes a field with a whole number.
    pub fn number(&mut self, name: &str, value: impl Into<u64>) -> &mut Self {
        self.whole(name, value.into())
    }

    /// Writes a field with a truth value.
    pub fn flag(&mut self, name: &str, value: bool) -> &mut Self {
        self.shown(name, &value)
    }

    /// Writes a field with text.
    pub fn text(&mut self, name: &str, value: impl Display) -> &mut Self {
        self.quoted(name, &value)
    }

    /// Writes a field with an object.
    pub fn object(&mut self, name: &str, fields: impl Fn(&mut JsonObject<'_, '_>)) -> &mut Self {
        self.shown(name, &JsonFields(&fields))
    }

    /// Writes a field with an object of a distribution's `min`, `median`, `p99` and `max`.
    ///
    /// ```no_run
    /// use kernel::{json, report::Distribution};
    ///
    /// let latencies = Distribution::new([10, 20]);
    /// let line = json::line("latency", |line| {
    ///     line.distribution("ns", &latencies);
    /// });
    /// assert_eq!(
    ///     line.to_string(),
    ///     r#"{"kind":"latency","ns":{"min":10,"median":10,"p99":20,"max":20}}"#
    /// );
    /// ```
    pub fn distribution(&mut self, name: &str, of: &Distribution) -> &mut Self {
        self.object(name, |object| {
            object
                .number("min", of.min())
                .number("median", of.median())
                .number("p99", of.p99())
                .number("max", of.max());
        })
    }

    /// Writes a field with a list of values, each of which is JSON already.
    pub fn list(
        &mut self,
        name: &str,
        mut values: impl Iterator<Item = impl Display>,
    ) -> &mut Self {
        self.each(name, &mut |show| {
            let value = values.next()?;
            show(&value);
            Some(())
        })
    }

    // Each of these serves all callers: an image has little room, and printing is not urgent.

    #[inline(never)]
    fn whole(&mut self, name: &str, value: u64) -> &mut Self {
        self.shown(name, &value)
    }

    #[inline(never)]
    fn quoted(&mut self, name: &str, value: &dyn Display) -> &mut Self {
        self.shown(name, &quoted(value))
    }

    /// Writes a list; `next` shows the next value, until there is none left.
    #[inline(never)]
    fn each(&mut self, name: &str, next: &mut dyn FnMut(Show<'_>) -> Option<()>) -> &mut Self {
        self.shown(name, &"[");
        let mut separator = "";
        let mut show = |value: &dyn Display| {
            self.result = self
                .result
                .and_then(|()| write!(self.out, "{separator}{value}"));
            separator = ",";
        };
        while next(&mut show).is_some() {}
        self.result = self.result.and_then(|()| self.out.write_str("]"));
        self
    }

    /// Writes a field whose value is JSON already.
    #[inline(never)]
    pub(crate) fn shown(&mut self, name: &str, value: &dyn Display) -> &mut Self {
        let separator = if self.first { "" } else { "," };
        self.first = false;
        self.result = self
            .result
            .and_then(|()| write!(self.out, "{separator}{}:{value}", quoted(name)));
        self
    }
}

/// A function that writes a value of a list.
type Show<'s> = &'s mut dyn FnMut(&dyn Display);

/// An object as text.
struct JsonFields<'a>(&'a dyn Fn(&mut JsonObject<'_, '_>));

impl Display for JsonFields<'_> {
    #[inline(never)]
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        out.write_str("{")?;
        let mut object = JsonObject {
            out,
            first: true,
            result: Ok(()),
        };
        (self.0)(&mut object);
        object.result?;
        out.write_str("}")
    }
}

/// Returns text as a JSON string.
///
/// ```no_run
/// assert_eq!(kernel::json::quoted("say \"so\"").to_string(), r#""say \"so\"""#);
/// ```
pub fn quoted(value: impl Display) -> impl Display {
    fmt::from_fn(move |out| {
        out.write_str("\"")?;
        fmt::Write::write_fmt(&mut EscapedText(out), format_args!("{value}"))?;
        out.write_str("\"")
    })
}

/// Text inside the quotes of a JSON string (RFC 8259, section 7).
struct EscapedText<'a, 'f>(&'a mut Formatter<'f>);

impl fmt::Write for EscapedText<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|character| match character {
            '"' => self.0.write_str("\\\""),
            '\\' => self.0.write_str("\\\\"),
            '\n' => self.0.write_str("\\n"),
            control if control < ' ' => write!(self.0, "\\u{:04x}", u32::from(control)),
            other => self.0.write_char(other),
        })
    }
}

/// Returns a machine line of kind `kind`, without the line end.
///
/// See [`JsonObject`].
pub fn line(kind: &str, fields: impl Fn(&mut JsonObject<'_, '_>)) -> impl Display {
    fmt::from_fn(move |out| {
        let whole = |object: &mut JsonObject<'_, '_>| fields(object.quoted("kind", &kind));
        JsonFields(&whole).fmt(out)
    })
}

/// The kinds that decide the verdict on a run.
const KERNELS: [&str; 6] = [
    "boot",
    "commit_fault",
    "fault",
    "panic",
    "stalled",
    "verdict",
];

/// Prints a machine line of kind `kind`.
///
/// # Panics
///
/// If the kind is reserved for the kernel: `boot`, `commit_fault`, `fault`, `panic`, `stalled` or
/// `verdict`.
///
/// ```no_run
/// kernel::json::emit("run", |line| {
///     line.number("jobs", 3_u64);
/// });
/// ```
#[track_caller]
pub fn emit(kind: &str, fields: impl Fn(&mut JsonObject<'_, '_>)) {
    assert!(
        !KERNELS.contains(&kind),
        "a machine line of kind `{kind}` is the kernel's to print; choose another kind"
    );
    console::write_line(console::OutputKind::Line, &line(kind, fields));
}

/// Prints a machine line of the kernel's own, of any kind.
pub fn report(kind: &str, fields: impl Fn(&mut JsonObject<'_, '_>)) {
    console::write_line(console::OutputKind::KernelLine, &line(kind, fields));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_fields_in_order_and_nests() {
        let line = line("fork_join", |object| {
            object.number("jobs", 7u64).object("latency_ns", |latency| {
                latency.number("min", 1u32).number("max", 2u32);
            });
        });
        let expected = r#"{"kind":"fork_join","jobs":7,"latency_ns":{"min":1,"max":2}}"#;
        assert_eq!(line.to_string(), expected);
    }

    #[test]
    fn writes_lists() {
        let line = line("trace", |object| {
            object
                .list("events", ["[1,2]", "[3]"].iter())
                .list("none", [0; 0].iter());
        });
        assert_eq!(
            line.to_string(),
            r#"{"kind":"trace","events":[[1,2],[3]],"none":[]}"#
        );
    }

    #[test]
    #[should_panic = "a machine line of kind `verdict` is the kernel's to print"]
    fn refuses_an_app_what_the_run_is_judged_by() {
        emit("verdict", |_| ());
    }

    #[test]
    fn escapes_what_json_cannot_hold() {
        let line = line("panic", |object| {
            object.text("message", "a \"b\"\\\n\u{1}é");
        });
        assert_eq!(
            line.to_string(),
            r#"{"kind":"panic","message":"a \"b\"\\\n\u0001é"}"#
        );
    }
}
