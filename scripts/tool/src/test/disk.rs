//! Room for what the tests are built into, looked for before anything is built: a disk
//! that is full in the middle shows as an error of the linker, or as a guest without log.

use std::env;
use std::path::Path;
use std::process::Command;

/// What all tests and images, built from nothing, take at most, in MiB.
const NEEDED_MIB: u64 = 3 << 10;

/// Makes sure that there is room. If that cannot be known, it says so and no more.
///
/// # Errors
///
/// One sentence: how much is missing where, and the remedy.
pub(super) fn check() -> Result<(), String> {
    // The tool itself lies in the target folder, whatever cargo was told of it.
    let tool = env::current_exe().unwrap_or_default();
    let folder = tool.parent().unwrap_or(Path::new("."));
    let answer = Command::new("df").arg("-Pk").arg(folder).output();
    let free = answer.map(|answer| free_mib(&String::from_utf8_lossy(&answer.stdout)));
    let Ok(Some(free_mib)) = free else {
        let place = folder.display();
        eprintln!("test: `df -Pk {place}` does not say how much is free; 3 GiB are needed");
        return Ok(());
    };
    judge(free_mib, folder)
}

fn judge(free_mib: u64, folder: &Path) -> Result<(), String> {
    if free_mib >= NEEDED_MIB {
        return Ok(());
    }
    Err(format!(
        "{free_mib} MiB are free where `{}` is, and building all tests takes up to {NEEDED_MIB}; \
         remove something, or set CARGO_TARGET_DIR to a folder on another disk",
        folder.display()
    ))
}

/// Reads how much is available, in MiB, from what `df -Pk` says of one folder (POSIX,
/// `df`, under STDOUT): the number before the percentage. Names may contain blanks.
fn free_mib(said: &str) -> Option<u64> {
    let mut words = said.lines().nth(1)?.split_whitespace().rev();
    words.find(|word| word.ends_with('%'))?;
    let kib: u64 = words.next()?.parse().ok()?;
    Some(kib >> 10)
}

#[cfg(test)]
mod tests {
    use super::{free_mib, judge};
    use std::path::Path;

    #[test]
    fn what_df_says_is_read_and_a_full_disk_is_told_with_its_place_and_the_remedy() {
        let free = |line: &str| free_mib(&format!("Filesystem 1024-blocks Used\n{line}\n"));
        let usual = "/dev/vda1 264212084 20036928 75248960      22% /";
        assert_eq!(free(usual), Some(73_485));
        let odd = "a b:/c 264212084 20036928 1023 100% /with a blank";
        assert_eq!(free(odd), Some(0));
        assert_eq!(
            free("none 0 0 0 - /proc").or(free("")).or(free_mib("")),
            None
        );
        assert_eq!(judge(3072, Path::new("/x")), Ok(()));
        let line = judge(12, Path::new("/x")).unwrap_err();
        assert!(line.starts_with("12 MiB are free where `/x` is"), "{line}");
        assert!(line.contains("set CARGO_TARGET_DIR"), "{line}");
    }
}
