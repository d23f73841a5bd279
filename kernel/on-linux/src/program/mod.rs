//! An app as a program of this computer, in real time or, with `kernel-on-host`, in virtual time:
//! its options, its file, its output and its end.

mod output;

use std::env;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use front::app::ending::{self, AppError, AppExit};
use front::options::UsageError;

pub use output::write_as;

/// Returns the program's arguments as a single line.
pub(crate) fn command_line() -> &'static str {
    let words: Vec<String> = env::args().skip(1).collect();
    words.join(" ").leak()
}

/// Runs an app, and prints how it has ended; a panic is a failure. The exit code is 0 after a
/// success, 1 after a failure, 2 if the command line is refused.
pub(crate) fn run(app: impl FnOnce() -> Result<(), AppError>) -> ExitCode {
    let result = catch_unwind(AssertUnwindSafe(app)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let text = text.unwrap_or("it says nothing");
        Err(AppError::Failure(format!(
            "the app's function panicked: {text}"
        )))
    });
    match ending::tell(&result) {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Failure => ExitCode::FAILURE,
        AppExit::Usage => ExitCode::from(2),
    }
}

/// Reads the file named by an option. The bytes stay as long as the program, as the loader's do.
pub(crate) fn read(word: &str, path: &str) -> Result<&'static [u8], UsageError> {
    let bytes = fs::read(path);
    let bytes = bytes.map_err(|why| UsageError::new(format!("`{word}={path}`: {why}")))?;
    Ok(bytes.leak())
}
