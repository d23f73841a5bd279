//! The system that the tool runs on: its programs, the workspace's root, and the folder for logs.

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::io::{self, IsTerminal};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use views::json::{self, Value};

/// Returns the root of the workspace: the folder that `scripts/tool/start` states, or else the
/// folder in which this tool was built, which is wrong once the workspace has moved.
pub fn workspace() -> &'static Path {
    static ROOT: OnceLock<PathBuf> = OnceLock::new();
    ROOT.get_or_init(|| match env::var_os("TOOL_WORKSPACE") {
        Some(root) => root.into(),
        None => {
            let package = Path::new(env!("CARGO_MANIFEST_DIR"));
            package.ancestors().nth(2).unwrap_or(package).into()
        }
    })
}

/// Returns the command that a person types here for a subcommand: a script of the workspace, or, if
/// no script has started this tool, the installed `fass-tool`.
pub(crate) fn script(name: &str) -> String {
    let is_here = || env::current_dir().is_ok_and(|here| here == workspace());
    match env::var_os("TOOL_WORKSPACE") {
        _ if is_here() => format!("./scripts/{name}"),
        Some(root) => Path::new(&root)
            .join("scripts")
            .join(name)
            .display()
            .to_string(),
        None => format!("fass-tool {name}"),
    }
}

/// Reports whether standard error is a terminal able to renew a line in place.
pub fn stderr_moves() -> bool {
    io::stderr().is_terminal() && can_move(env::var_os("TERM").as_deref())
}

/// Reports whether a terminal of this type can erase a line.
fn can_move(term: Option<&OsStr>) -> bool {
    term.is_some_and(|term| !term.is_empty() && term != "dumb")
}

/// Returns a command for the cargo that built us, or else the cargo on `PATH`, in the workspace's
/// root.
pub fn cargo() -> Command {
    let program = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.current_dir(workspace());
    command
}

/// Runs cargo, passing its errors to standard error as they come. Returns cargo's JSON messages,
/// and an error if cargo failed.
pub fn messages_of(cargo: &mut Command) -> (Vec<Value>, Result<(), String>) {
    let output = match cargo.stdin(Stdio::null()).stderr(Stdio::inherit()).output() {
        Ok(output) => output,
        Err(error) => return (Vec::new(), Err(format!("cannot start cargo: {error}"))),
    };
    let said = String::from_utf8_lossy(&output.stdout);
    // Lines without JSON are not messages of cargo's.
    let messages = said.lines().filter_map(|line| json::parse(line).ok());
    let ended = match output.status.success() {
        true => Ok(()),
        false => Err("see cargo's errors above".into()),
    };
    (messages.collect(), ended)
}

/// Runs a command to its end, and returns its standard output.
///
/// # Errors
///
/// In words, with the program and the last lines of its error output.
pub fn run(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().display().to_string();
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|why| format!("`{name}` did not start: {why}"))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = last_lines(&output.stderr);
    Err(format!("`{name}` failed ({}): {said}", output.status))
}

/// Returns the last lines printed by a program, enough to see why the program failed.
pub(crate) fn last_lines(said: &[u8]) -> String {
    const LINES: usize = 12;
    let said = String::from_utf8_lossy(said);
    let lines: Vec<&str> = said.trim_end().lines().map(str::trim_end).collect();
    lines[lines.len().saturating_sub(LINES)..].join("\n")
}

/// Returns the path of a program: the path itself, or a name found on the `PATH`.
pub fn find_program(name: impl AsRef<OsStr>) -> Option<PathBuf> {
    let name = name.as_ref();
    if name.as_bytes().contains(&b'/') {
        return is_program(Path::new(name)).then(|| name.into());
    }
    let path = env::var_os("PATH")?;
    let candidates = env::split_paths(&path).map(|folder| folder.join(name));
    candidates.into_iter().find(|file| is_program(file))
}

/// Returns all files below a folder, sorted, except the files in hidden folders and in folders
/// named `target`; `enters` decides for each other folder whether to descend.
pub fn files_below(root: &Path, enters: impl Fn(&Path) -> bool) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        if !enters(&folder) {
            continue;
        }
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let path = entry.path();
            if !path.is_dir() {
                files.push(path);
            } else if !name.as_bytes().starts_with(b".") && name != "target" {
                folders.push(path);
            }
        }
    }
    files.sort();
    files
}

fn is_program(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    fs::metadata(file).is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
}

/// Describes how busy the host is, and the remedy, for a run that exceeded its time.
pub fn host_load() -> String {
    let averages = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = averages.split(' ').next().unwrap_or_default();
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    format!(
        "the host's load was {load} on {processors} processors: if that is more than it has, \
         try again when it is less"
    )
}

/// Returns a path for a new log, unique to this process and call.
///
/// # Errors
///
/// In words: the folder for logs, `target/serial`, could not be made.
pub fn new_log(name: &str) -> Result<PathBuf, String> {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let folder = workspace().join("target/serial");
    fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make the folder `{}`: {error}", folder.display()))?;
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    // Once in each process, at its first log.
    if number == 0 {
        clear(&folder);
    }
    Ok(folder.join(format!("{name}-{}-{number}.log", std::process::id())))
}

/// How long files stay in the folder for logs: longer than any run lasts.
const KEPT: Duration = Duration::from_secs(7 * 86_400);

/// Removes old files: logs of guests that failed, which a person has read by now, and files of
/// killed processes.
fn clear(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let changed = entry.metadata().and_then(|data| data.modified());
        let age = changed.ok().and_then(|changed| changed.elapsed().ok());
        if age > Some(KEPT) {
            // The file is ours; a leftover file harms nothing.
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;

    #[test]
    fn a_dumb_terminal_renews_no_line() {
        let terminals = [Some("xterm"), Some("dumb"), Some(""), None];
        let moves = terminals.map(|term| can_move(term.map(OsStr::new)));
        assert_eq!(moves, [true, false, false, false]);
    }

    #[test]
    fn what_is_old_is_removed() {
        let folder = std::env::temp_dir().join(format!("old-logs-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let [old, new] = ["old.log", "new.log"].map(|name| folder.join(name));
        fs::write(&new, "").unwrap();
        let file = fs::File::create(&old).unwrap();
        file.set_modified(SystemTime::now() - KEPT * 2).unwrap();
        clear(&folder);
        assert!(new.exists() && !old.exists());
        fs::remove_dir_all(folder).unwrap();
    }
}
