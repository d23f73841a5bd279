//! The word `clusters` of the command line, by which a person divides the cores.

use alloc::vec::Vec;

use crate::options::{Options, UsageError};

/// Reads it: the cores of each cluster, none if they are not divided; `None` if the commit is to
/// divide them.
///
/// # Errors
///
/// If the word is neither `auto` nor numbers of cores.
pub fn read(options: &Options<'_>) -> Result<Option<Vec<u32>>, UsageError> {
    if options.text("clusters") == Some("auto") {
        return Ok(None);
    }
    let sizes = options.numbers("clusters", 0..=u64::from(u32::MAX), &[])?;
    let sizes = sizes.into_iter().map(u32::try_from);
    Ok(Some(sizes.filter_map(Result::ok).collect()))
}
