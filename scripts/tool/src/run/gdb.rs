//! gdb: which places of an image a person means, and the script that it begins with.
//!
//! A *place* is where to stop: a function, by the last parts of its path, or `FILE:LINE`. gdb
//! itself takes whole paths only, such as `drone::camera::detect`; so it is asked for the
//! functions that there are. What is not there is refused before anything starts.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use replay::shown::quoted;

use crate::options::nearest;
use crate::system;

/// The most functions that one place may mean.
const MOST: usize = 8;

/// Stands before what gdb says of each place.
const MARK: &str = "@@ place";

/// Returns what to tell gdb for places with commas between, in the image of an app.
///
/// # Errors
///
/// In words: gdb cannot be started, or what no place is, with what it may be.
pub(super) fn resolve(image: &Path, app: &str, places: &str) -> Result<Vec<String>, String> {
    let places: Vec<&str> = places.split(',').map(str::trim).collect();
    let mut gdb = Command::new("gdb");
    gdb.args(["-nx", "-batch"]).arg(image);
    for place in &places {
        gdb.args(["-ex", &format!("echo {MARK}\\n")]);
        match is_line(place) {
            true => gdb.args(["-ex", &format!("info line {place}")]),
            false => gdb.args(["-ex", &format!("info functions -q -n {}", last(place))]),
        };
    }
    // For a hint.
    let own = app.replace('-', "_");
    gdb.args(["-ex", &format!("echo {MARK}\\n")]);
    gdb.args(["-ex", &format!("info functions -q -n ^{own}::")]);
    let output = gdb.output();
    let output = output.map_err(|error| format!("cannot start gdb: {error}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    let mut said = said.split(MARK).skip(1);
    let answers: Vec<&str> = said.by_ref().take(places.len()).collect();
    let known = functions(said.next().unwrap_or_default());
    let mut found = Vec::new();
    for (place, answer) in places.into_iter().zip(answers) {
        match is_line(place) {
            true if answer.contains(" address ") => found.push(place.into()),
            true => {
                return Err(format!(
                    "`--break {place}`: the image has no code of that line; name a file and a \
                     line of a function, such as `src/lib.rs:40`"
                ));
            }
            false => found.extend(choose(place, &own, functions(answer), &known)?),
        }
    }
    Ok(found)
}

/// Reports whether a place is a file and a line.
fn is_line(place: &str) -> bool {
    let parts = place.rsplit_once(':');
    parts.is_some_and(|(file, line)| {
        !file.ends_with(':') && line.bytes().all(|byte| byte.is_ascii_digit()) && !line.is_empty()
    })
}

/// Returns the last part of a function's path.
fn last(path: &str) -> &str {
    path.rsplit("::").next().unwrap_or(path)
}

/// Reads the paths of functions from what gdb lists. Of functions with parameters in angle
/// brackets it finds none by name.
fn functions(listed: &str) -> Vec<&str> {
    let lines = listed.lines().filter_map(|line| line.split_once("fn "));
    let paths = lines.filter_map(|(_, rest)| {
        let end = rest.find(['(', '<'])?;
        rest[end..].starts_with('(').then_some(&rest[..end])
    });
    let mut paths: Vec<&str> = paths.collect();
    paths.sort_unstable();
    paths.dedup();
    paths
}

/// Chooses the functions that a place means: of the app's own, if there are such.
fn choose(
    place: &str,
    own: &str,
    listed: Vec<&str>,
    known: &[&str],
) -> Result<Vec<String>, String> {
    let is_meant = |path: &&str| {
        let before = path.strip_suffix(place);
        before.is_some_and(|before| before.is_empty() || before.ends_with("::"))
    };
    let mut meant: Vec<&str> = listed.into_iter().filter(is_meant).collect();
    let is_own = |path: &&str| path.split("::").next() == Some(own);
    if meant.iter().any(is_own) {
        meant.retain(is_own);
    }
    let shown = quoted(place);
    if meant.is_empty() {
        let names: Vec<&str> = known.iter().map(|path| last(path)).collect();
        let hint = nearest(last(place), &names)
            .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        return Err(format!(
            "`--break`: the image has no function {shown}; a closure is found by `FILE:LINE`{hint}"
        ));
    }
    if meant.len() > MOST {
        return Err(format!(
            "`--break`: {} functions are called {shown}; give more of the path, such as `{}`",
            meant.len(),
            meant[0]
        ));
    }
    Ok(meant.into_iter().map(String::from).collect())
}

/// Returns the script by which gdb reaches the guest and runs it to the first of the places.
///
/// A breakpoint of hardware needs no code to be there yet.
pub(super) fn script(socket: &Path, places: &[String]) -> String {
    let mut text = String::from("set pagination off\nset confirm off\nset width 0\n");
    if let Some(printers) = printers() {
        let _ = writeln!(text, "source {printers}");
    }
    let _ = writeln!(text, "target remote {}", socket.display());
    for place in places {
        let _ = writeln!(text, "hbreak {place}");
    }
    text + "continue\n"
}

/// Returns where Rust's toolchain has what makes gdb show vectors and strings as such.
fn printers() -> Option<String> {
    let mut rustc = Command::new("rustc");
    rustc.current_dir(system::workspace());
    let said = rustc.args(["--print", "sysroot"]).output().ok()?;
    let root = String::from_utf8(said.stdout).ok()?;
    let folder = Path::new(root.trim()).join("lib/rustlib/etc");
    let file = folder.join("gdb_load_rust_pretty_printers.py");
    file.is_file().then(|| file.display().to_string())
}

/// Returns the command that starts gdb with its script, and then with a person's commands
/// instead of the person.
pub(super) fn command(image: &Path, script: &Path, commands: Option<&Path>) -> Command {
    let mut gdb = Command::new("gdb");
    gdb.arg("-q");
    if commands.is_some() {
        gdb.args(["-nx", "-batch"]);
    }
    gdb.arg("-x").arg(script);
    if let Some(commands) = commands {
        gdb.arg("-x").arg(commands);
    }
    gdb.arg(image);
    gdb
}

#[cfg(test)]
mod tests {
    use super::{choose, functions, is_line};

    const LISTED: &str = "\nFile apps/drone/src/attitude.rs:\n\
        78:\tfn drone::attitude::control(*mut drone::attitude::Estimate) -> [f64; 3];\n\
        149:\tstatic fn drone::dags::register<(a, b)>(u8);\n\
        File kernel/src/a.rs:\n1:\tfn kernel::watch::control();\n";

    #[test]
    fn a_function_is_found_by_the_end_of_its_path() {
        let chosen = |place| choose(place, "drone", functions(LISTED), &functions(LISTED));
        for (place, path) in [
            ("control", "drone::attitude::control"),
            ("attitude::control", "drone::attitude::control"),
            ("watch::control", "kernel::watch::control"),
        ] {
            assert_eq!(chosen(place), Ok(vec![path.to_string()]));
        }
        let refused = chosen("contrl").unwrap_err();
        assert!(refused.ends_with("did you mean `control`?"), "{refused}");
        assert!(chosen("trol").is_err());
        let all: Vec<String> = (0..9).map(|n| format!("a{n}::new")).collect();
        let all = all.iter().map(String::as_str).collect();
        let refused = choose("new", "drone", all, &[]).unwrap_err();
        assert!(refused.contains("9 functions") && refused.contains("`a0::new`"));
        let places = ["src/lib.rs:40", "control", "a::b", "a::9", "lib.rs:"];
        assert_eq!(places.map(is_line), [true, false, false, false, false]);
    }
}
