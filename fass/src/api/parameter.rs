//! Parameters: numbers set by a person, a file or a test while DAGs run.
//!
//! A parameter is like a [latest value](crate::shared::Latest) written from outside, with a name, a
//! type and a range. A *source* reads the parameter when it starts, and sends the value along edges
//! to the subtasks that need it. So a job has one value of the parameter, whatever happens
//! meanwhile.
//!
//! # Guarantees
//!
//! - A job's value is the last one set before the source reading it started. The value does not
//!   change during the job: in each DAG one source reads the parameter, and other subtasks get the
//!   value along edges.
//! - A value outside the range is never set, nor one that is no number (a NaN, or a text).
//! - Nobody waits: reading is one load.
//! - Where the source's results are recorded, the value is replayed with them: then setting the
//!   parameter during a replay has no effect on the DAG.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use core::fmt;
use core::marker::PhantomData;
use core::ops::RangeInclusive;
use core::str::FromStr;
use core::sync::atomic::{AtomicU64, Ordering};

use super::dag::Dag;
use super::uses::{OutsideInput, Uses, sealed};
use crate::draft::part::PartKind;

/// A number, or a truth value, that can be set while DAGs run. Clones are handles of the same
/// parameter.
///
/// # Examples
///
/// ```
/// use core::time::Duration;
/// use fass::shared::Parameter;
/// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
/// use virtual_time::VirtualTime;
///
/// let machine = VirtualTime::new();
/// let period = Duration::from_millis(10);
/// let gain = Parameter::new("gain", 0.5, 0.0..=2.0);
/// let dag = create_dag();
/// dag.name("loop").jobs(4);
/// dag.period(period)
///     .using(gain.reading())
///     .source(|gain: f64| (gain,))
///     .writes(&["gain"])
///     .register(SubtaskAttributes::named("measure"));
/// dag.register_sink_subtask(
///     |(gain,): (f64,)| assert!((0.0..=2.0).contains(&gain)),
///     ["gain"],
///     period,
///     SubtaskAttributes::named("control"),
/// );
/// finish_create_dags(&[dag]).unwrap();
///
/// machine.run_for(2 * period);
/// gain.set(1.5).unwrap(); // for the jobs to come
/// assert_eq!(
///     gain.set(3.0).unwrap_err().to_string(),
///     "`gain=3`: parameter `gain` takes f64 from 0 to 2"
/// );
/// machine.run();
/// assert_eq!(gain.value(), 1.5);
/// ```
pub struct Parameter<T>(Arc<ParameterCell<T>>);

struct ParameterCell<T> {
    name: String,
    /// The value, as bits.
    bits: AtomicU64,
    initial: T,
    range: RangeInclusive<T>,
}

/// The declaration that a source reads a [`Parameter`]: the function gets the parameter's value.
/// Made by [`Parameter::reading`].
///
/// See [`Parameter`].
#[derive(Debug)]
pub struct ParameterUse<T>(Parameter<T>);

/// The rejection of a value outside a parameter's range, or of a text that is no number of its
/// type. Displays the reason in one line, with the type and the range.
///
/// See [`Parameter`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterError(String);

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for ParameterError {}

/// A type of parameter values: `bool`, `i64`, `u64`, `f64`, and the shorter types `i32`, `u32`,
/// `f32`.
///
/// ```
/// fn name<T: fass::shared::ParameterValue>(_: T) -> &'static str {
///     T::NAME
/// }
/// assert_eq!(name(0.5), "f64");
/// ```
pub trait ParameterValue:
    sealed::Sealed + Copy + PartialOrd + fmt::Display + FromStr + Send + Sync + 'static
{
    /// The type's name.
    const NAME: &'static str;

    #[doc(hidden)]
    fn to_bits(self) -> u64;

    #[doc(hidden)]
    fn from_bits(bits: u64) -> Self;
}

macro_rules! implement_value {
    ($($Value:ident: $to:expr, $from:expr;)*) => {$(
        impl sealed::Sealed for $Value {}

        impl ParameterValue for $Value {
            const NAME: &'static str = stringify!($Value);

            fn to_bits(self) -> u64 {
                $to(self)
            }

            fn from_bits(bits: u64) -> Self {
                $from(bits)
            }
        }
    )*};
}

implement_value! {
    bool: u64::from, |bits| bits != 0;
    u32: u64::from, |bits: u64| u32::try_from(bits).unwrap_or(u32::MAX);
    u64: |value| value, |bits| bits;
    i32: |value: i32| i64::from(value).cast_unsigned(),
        |bits: u64| i32::try_from(bits.cast_signed()).unwrap_or(i32::MAX);
    i64: i64::cast_unsigned, u64::cast_signed;
    f32: |value: f32| f64::from(value).to_bits(), narrowed;
    f64: f64::to_bits, f64::from_bits;
}

#[allow(clippy::cast_possible_truncation, reason = "it was an `f32` before")]
fn narrowed(bits: u64) -> f32 {
    f64::from_bits(bits) as f32
}

/// A parameter of any type, for a platform on which people set parameters. Only [`Parameter`]
/// implements the trait, because where the cores are busy people are served with interrupts
/// disabled.
///
/// ```
/// use fass::shared::{Parameter, Tunable};
///
/// let all: [&dyn Tunable; 2] = [
///     &Parameter::new("gain", 0.5, 0.0..=2.0),
///     &Parameter::new("lights", true, false..=true),
/// ];
/// assert!(all[1].set_text("false"));
/// let shown: Vec<String> = all.iter().map(|of| format!("{} = {}", of.name(), of.shown())).collect();
/// assert_eq!(
///     shown,
///     ["gain = 0.5 (f64 from 0 to 2, at first 0.5)", "lights = false (bool, at first true)"]
/// );
/// ```
pub trait Tunable: sealed::Sealed + Send + Sync {
    /// Returns the parameter's name.
    fn name(&self) -> &str;

    /// Sets the parameter from a text; returns `false` if the text is no value within the range.
    #[must_use = "`false`: it is not set"]
    fn set_text(&self, text: &str) -> bool;

    /// Writes the parameter's type and range.
    ///
    /// # Errors
    ///
    /// The errors of `f`.
    fn write_allowed(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result;

    /// Writes the parameter's value, and the allowed values.
    ///
    /// # Errors
    ///
    /// The errors of `f`.
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result;

    /// Returns another handle of the parameter.
    fn share(&self) -> Arc<dyn Tunable>;
}

impl dyn Tunable + '_ {
    /// Returns the parameter's value and the allowed values, as text. Nothing is allocated.
    ///
    /// See [`Tunable`].
    pub fn shown(&self) -> impl fmt::Display {
        fmt::from_fn(|f| self.write(f))
    }

    /// Returns the error message for a text that is no allowed value. Nothing is allocated.
    ///
    /// See [`Tunable`].
    #[must_use]
    pub fn refusal(&self, text: &str) -> impl fmt::Display {
        let name = self.name();
        fmt::from_fn(move |f| {
            write!(f, "`{name}={text}`: parameter `{name}` takes ")?;
            self.write_allowed(f)
        })
    }
}

impl<T: ParameterValue> Parameter<T> {
    /// Makes a parameter with a name, an initial value and a range.
    ///
    /// # Panics
    ///
    /// If the initial value is not within the range; or if the name is empty or contains a blank, a
    /// control character, `=` or `,`, so that nobody could type the name.
    #[track_caller]
    pub fn new(name: &str, initial: T, range: RangeInclusive<T>) -> Self {
        let is_typed = |c: char| !(c.is_whitespace() || c.is_control() || "=,".contains(c));
        assert!(
            !name.is_empty() && name.chars().all(is_typed),
            "`{name}` cannot be a parameter's name; give one without blanks, `=` and `,`"
        );
        let (least, most) = (range.start(), range.end());
        assert!(
            range.contains(&initial),
            "parameter `{name}` begins with {initial}, which is not from {least} to {most}; \
             change one of them"
        );
        Self(Arc::new(ParameterCell {
            name: name.into(),
            bits: AtomicU64::new(initial.to_bits()),
            initial,
            range,
        }))
    }

    /// Returns the value for the jobs to come.
    pub fn value(&self) -> T {
        T::from_bits(self.0.bits.load(Ordering::Relaxed))
    }

    /// Sets the value for the jobs to come.
    ///
    /// # Errors
    ///
    /// If the value is not within the range; then nothing has changed.
    pub fn set(&self, value: T) -> Result<(), ParameterError> {
        if self.store(value) {
            return Ok(());
        }
        let this: &dyn Tunable = self;
        Err(ParameterError(format!(
            "{}",
            this.refusal(&format!("{value}"))
        )))
    }

    /// Returns the declaration that a source reads the parameter, for [`Dag::using`].
    #[must_use = "a use has no effect until a subtask is registered with it"]
    pub fn reading(&self) -> ParameterUse<T> {
        ParameterUse(self.clone())
    }

    fn store(&self, value: T) -> bool {
        let is_within = self.0.range.contains(&value);
        if is_within {
            self.0.bits.store(value.to_bits(), Ordering::Relaxed);
        }
        is_within
    }
}

impl<T> sealed::Sealed for Parameter<T> {}

impl<T: ParameterValue> Tunable for Parameter<T> {
    fn name(&self) -> &str {
        &self.0.name
    }

    fn set_text(&self, text: &str) -> bool {
        text.parse().is_ok_and(|value| self.store(value))
    }

    fn write_allowed(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = (self.0.range.start(), self.0.range.end());
        f.write_str(T::NAME)?;
        match T::NAME {
            // The two values of a truth value are clear without a range.
            "bool" if least != most => Ok(()),
            _ => write!(f, " from {least} to {most}"),
        }
    }

    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (", self.value())?;
        self.write_allowed(f)?;
        write!(f, ", at first {})", self.0.initial)
    }

    fn share(&self) -> Arc<dyn Tunable> {
        Arc::new(self.clone())
    }
}

impl<T> Clone for Parameter<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

shown_as!(Parameter<T>, |of| of.0.name);

impl<T> sealed::Sealed for ParameterUse<T> {}

impl<T: ParameterValue> Uses for ParameterUse<T> {
    type Borrowed<'a> = T;
    type Held = Parameter<T>;
    type Guard<'a> = (T, PhantomData<&'a ()>);

    fn hold(self, dag: &Dag, subtask: usize) -> Self::Held {
        let takes = format!("reads parameter `{}`", self.0.0.name);
        let input = OutsideInput { subtask, takes };
        dag.draft.borrow_mut().add(PartKind::Input, input);
        self.0
    }

    fn enter(held: &mut Self::Held) -> Self::Guard<'_> {
        (held.value(), PhantomData)
    }

    fn borrow<'a, 'g>(guard: &'a mut Self::Guard<'g>) -> Self::Borrowed<'a> {
        guard.0
    }
}
