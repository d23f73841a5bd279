//! Where the serial log goes, and whether it stays.
//!
//! A log that the person names stays. What was in the file before is lost only to a run:
//! where the guest refuses its command line, the file is as it was.

use std::fs;
use std::path::PathBuf;

use crate::files;
use crate::options::Parsed;
use crate::system;

/// The options that name the log, of which one may be given.
const NAMES: [&str; 1] = ["serial"];

/// The serial log of a run.
pub(super) struct Log {
    pub(super) path: PathBuf,
    /// Whether the person has named it.
    stays: bool,
    /// Where the content from before is kept, if there was any.
    before: Option<PathBuf>,
}

/// Makes sure that the named log can be read back while it is written.
pub(super) fn check(options: &Parsed) -> Result<(), String> {
    for named in options.named(&NAMES) {
        if fs::metadata(named.path).is_ok_and(|data| !data.is_file()) {
            let (option, place) = (named.option, files::place(named.path));
            return Err(format!(
                "`--{option} {place}`: it is a device or a pipe, and the log is read while it \
                 is written; name a file"
            ));
        }
    }
    Ok(())
}

impl Log {
    /// Settles where it goes. The file is made when the guest starts.
    pub(super) fn choose(options: &Parsed, app: &str) -> Result<Log, String> {
        let own = system::new_log(app)?;
        let Some(named) = options.named(&NAMES).first().copied() else {
            return Ok(Log {
                path: own,
                stays: false,
                before: None,
            });
        };
        let own = own.with_extension("before");
        let has_content = fs::metadata(named.path).is_ok_and(|data| data.len() > 0);
        if has_content {
            fs::copy(named.path, &own)
                .map_err(|error| format!("cannot write `{}`: {error}", own.display()))?;
        }
        Ok(Log {
            path: named.path.into(),
            stays: true,
            before: has_content.then_some(own),
        })
    }

    /// Removes it, unless the person has named it.
    pub(super) fn discard(&self) {
        if !self.stays {
            // It is ours, and in the way of no one if it cannot be removed.
            let _ = fs::remove_file(&self.path);
        }
    }

    /// Leaves the file as it was before, for nothing has run.
    pub(super) fn restore(&self) {
        // The person is told of the refusal, which is what matters.
        let _ = match &self.before {
            Some(before) => fs::copy(before, &self.path).map(drop),
            None => fs::remove_file(&self.path),
        };
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        if let Some(before) = &self.before {
            let _ = fs::remove_file(before);
        }
    }
}
