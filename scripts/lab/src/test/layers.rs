//! The order of layers within each crate: a layer may name only lower ones; circles are refused.
//!
//! A crate's folders (and single files) right below `src` are its *layers*. The page
//! docs/architecture.md, and no other, lists them from top to bottom; a layer may name only layers
//! listed later. A folder may have a row of its own to order the modules right below. Everywhere,
//! no file may lead back to itself through files naming each other, except for a file and the files
//! in its folder.
//!
//! A file's *module* is its path from the workspace's root, without `.rs` and `/mod`; the crate's
//! root is the folder `src`. A file *names* a module if a path in the file's code, in a `use` or
//! elsewhere, begins with `crate`, `super`, `self` or a child's name and leads into the module.
//! Test code is left out: a test may name anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::{SourceFile, none_of};
use tool::system::workspace;

/// The page with the table, and the heading right above the table.
const PAGE: &str = "docs/architecture.md";
const HEADING: &str = "## Layers inside the crates";

/// A row of the table: a crate's source folder or a folder inside, and its layers from top to
/// bottom.
#[derive(Debug, PartialEq, Eq)]
struct LayerRow {
    src: String,
    layers: Vec<String>,
}

/// For each module, the other modules of its crate named by its code.
type Names = BTreeMap<PathBuf, BTreeSet<PathBuf>>;

/// Checks the files of every crate in the table.
pub(super) fn check(sources: &[SourceFile]) -> Result<(), String> {
    let page = fs::read_to_string(workspace().join(PAGE));
    let rows = rows(&page.map_err(|error| format!("{PAGE}: {error}"))?);
    if rows.is_empty() {
        return Err(format!("{PAGE} has no table below `{HEADING}`"));
    }
    let is_listed = |module: &PathBuf| rows.iter().any(|row| module.starts_with(&row.src));
    let of_source = |source: &SourceFile| {
        let module = module(Path::new(&source.name)).filter(is_listed)?;
        Some((module, code(&source.text)))
    };
    let codes = sources.iter().filter_map(of_source).collect();
    let names = names(&codes);
    let circles = circles(&names).into_iter();
    let circles = circles.map(|circle| format!("{} name each other in a circle", list(&circle)));
    let of_row = |row| {
        strangers(row, &names)
            .into_iter()
            .chain(upward(row, &names))
    };
    none_of(circles.chain(rows.iter().flat_map(of_row)).collect())
}

/// Reads the rows of the table, such as ``| `fass/src` | `api`, `run` |``.
fn rows(page: &str) -> Vec<LayerRow> {
    let section = page.split_once(HEADING).map_or("", |(_, after)| after);
    let section = section.split("\n## ").next().unwrap_or_default();
    let words = |cell: &str| -> Vec<String> {
        cell.split('`')
            .skip(1)
            .step_by(2)
            .map(String::from)
            .collect()
    };
    let row = |line: &str| {
        let mut cells = line.strip_prefix('|')?.split('|');
        let src = words(cells.next()?).into_iter().next()?;
        Some(LayerRow {
            src,
            layers: words(cells.next()?),
        })
    };
    section.lines().filter_map(row).collect()
}

/// Returns a source file's module; `None` for tests and other files.
fn module(place: &Path) -> Option<PathBuf> {
    let mut module = place.with_extension("");
    let is_source = place.extension().is_some_and(|ending| ending == "rs");
    if !is_source || module.iter().any(|part| part == "tests") {
        return None;
    }
    if ["mod", "lib", "main"]
        // A crate's root and a folder's `mod.rs` stand for the folder.
        .iter()
        .any(|name| module.ends_with(name))
    {
        module.pop();
    }
    Some(module)
}

/// Returns a file's text without comments, and without the unit tests at the end.
pub(super) fn code(text: &str) -> String {
    let product = text.split("\n#[cfg(test)]\nmod tests {").next();
    let lines = product.unwrap_or_default().lines();
    let lines = lines.filter(|line| !line.trim_start().starts_with("//"));
    lines.map(|line| format!("{line}\n")).collect()
}

fn names(codes: &BTreeMap<PathBuf, String>) -> Names {
    let named = |(module, code): (&PathBuf, &String)| {
        let paths = paths(code).into_iter();
        let named = paths.filter_map(|path| target(module, &path, codes));
        let mut named: BTreeSet<PathBuf> = named.collect();
        named.remove(module);
        (module.clone(), named)
    };
    codes.iter().map(named).collect()
}

/// Returns the module containing the target of a path, as seen from `module`; `None` for a path
/// into another crate.
fn target(module: &Path, path: &[&str], modules: &BTreeMap<PathBuf, String>) -> Option<PathBuf> {
    let [first, rest @ ..] = path else {
        return None;
    };
    // A word alone is no path.
    rest.first()?;
    let mut from = module.to_path_buf();
    match *first {
        "crate" => {
            from = module
                .ancestors()
                .find(|above| above.ends_with("src"))?
                .into()
        }
        "self" => {}
        "super" => drop(from.pop()),
        // A name that is no child of the module comes from a `use` or is another crate.
        child => {
            from.push(child);
            modules.get(&from)?;
        }
    }
    for word in rest {
        match *word {
            "super" => drop(from.pop()),
            word => from.push(word),
        }
    }
    // The end of a path is mostly an item of a module, not a module.
    while !modules.contains_key(&from) {
        from.pop().then_some(())?;
    }
    Some(from)
}

/// Returns every path of the code, with the paths of a `use` written out separately.
fn paths(code: &str) -> Vec<Vec<&str>> {
    let mut found = Vec::new();
    // The path so far, whether the path is complete, and for each open brace the length of the
    // prefix shared by its branches.
    let (mut path, mut is_whole, mut begins) = (Vec::new(), false, Vec::new());
    let mut is_joined = false;
    for token in tokens(code) {
        // Without `::` before it, the token begins another path.
        if !is_joined && token != "::" {
            if is_whole {
                found.push(path.clone());
            }
            is_whole = false;
            path.truncate(begins.last().copied().unwrap_or(0));
        }
        match token {
            "{" if is_joined => {
                begins.push(path.len());
                is_whole = false;
            }
            "}" => drop(begins.pop()),
            "*" if is_joined => path.push("*"),
            // At the beginning of a path `::` is followed by another crate, or by part of a type.
            word if is_word(word) && (!is_joined || !path.is_empty()) => {
                path.push(word);
                is_whole = true;
            }
            _ => {}
        }
        is_joined = token == "::";
    }
    found
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Cuts the code into words, `::`, and single other characters.
fn tokens(code: &str) -> impl Iterator<Item = &str> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut rest = code.trim_start();
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let length = match rest.find(|c| !is_part(c)).unwrap_or(rest.len()) {
            0 if rest.starts_with("::") => 2,
            0 => first.len_utf8(),
            length => length,
        };
        let (token, after) = rest.split_at(length);
        rest = after.trim_start();
        Some(token)
    })
}

/// Returns a module's layer in a row.
fn layer(row: &LayerRow, module: &Path) -> Option<String> {
    let first = module.strip_prefix(&row.src).ok()?.iter().next()?;
    Some(first.to_string_lossy().into())
}

/// Returns a complaint for each layer found only in the table or only in the folder.
fn strangers(row: &LayerRow, names: &Names) -> Vec<String> {
    let there: BTreeSet<String> = names.keys().filter_map(|it| layer(row, it)).collect();
    let listed: BTreeSet<String> = row.layers.iter().cloned().collect();
    let missing = there.difference(&listed).map(|layer| {
        format!(
            "{}/{layer} is missing in {PAGE}; say which layers it may name",
            row.src
        )
    });
    let gone = listed
        .difference(&there)
        .map(|layer| format!("{PAGE} lists `{layer}`, which {} does not have", row.src));
    missing.chain(gone).collect()
}

/// Returns a complaint for each file naming a layer above its own.
fn upward(row: &LayerRow, names: &Names) -> impl Iterator<Item = String> {
    let place = |module: &Path| {
        let layer = layer(row, module)?;
        row.layers.iter().position(|listed| *listed == layer)
    };
    let all = names.iter();
    let arrows = all.flat_map(|(from, named)| named.iter().map(move |to| (from, to)));
    let is_upward = move |(from, to): &(&PathBuf, &PathBuf)| {
        // A module outside of the row has no place in its order.
        place(to)
            .zip(place(from))
            .is_some_and(|(to, from)| to < from)
    };
    arrows.filter(is_upward).map(|(from, to)| {
        let (from, to) = (from.display(), to.display());
        format!("{from} names {to}, a layer above its own")
    })
}

/// Returns the circles of files naming each other, each circle sorted by name.
fn circles(names: &Names) -> BTreeSet<Vec<&PathBuf>> {
    let reached = names.keys();
    let reached = reached.map(|module| (module, reached_from(module, names)));
    let reached: BTreeMap<_, _> = reached.collect();
    let circle = |module| -> Vec<&PathBuf> {
        let others = reached[module].iter().copied();
        others
            .filter(|other| reached[other].contains(module))
            .collect()
    };
    names
        .keys()
        .map(circle)
        .filter(|circle| !circle.is_empty())
        .collect()
}

/// Returns the modules named by `module`, directly or through others.
fn reached_from<'n>(module: &'n PathBuf, names: &'n Names) -> BTreeSet<&'n PathBuf> {
    let mut reached = BTreeSet::new();
    let mut open = vec![module];
    while let Some(next) = open.pop() {
        for named in names.get(next).into_iter().flatten() {
            // A file and the files in its folder may name each other.
            let contains = next.starts_with(named) || named.starts_with(next);
            if !contains && reached.insert(named) {
                open.push(named);
            }
        }
    }
    reached
}

fn list(modules: &[&PathBuf]) -> String {
    let shown = modules.iter().map(|module| module.display().to_string());
    shown.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads arrows between modules, such as `a/x>b`.
    fn arrows(line: &str) -> Names {
        let mut names = Names::new();
        for arrow in line.split(' ') {
            let (from, to) = arrow.split_once('>').unwrap();
            names.entry(to.into()).or_default();
            names.entry(from.into()).or_default().insert(to.into());
        }
        names
    }

    #[test]
    fn arrows_that_point_up_and_layers_that_are_missing_are_named() {
        let page = format!(
            "text\n\n{HEADING}\n\n| crate | layers |\n|---|---|\n| `x/src` | `top`, `low` |\n\n## N\n| `y` | `z` |\n"
        );
        let rows = rows(&page);
        let [row] = &rows[..] else {
            panic!("{rows:?}");
        };
        let up = ["x/src/low/b names x/src/top/a, a layer above its own"];
        let upward = |line| upward(row, &arrows(line)).collect::<Vec<_>>();
        assert_eq!(upward("x/src/top/a>x/src/low x/src/low>top"), [""; 0]);
        assert_eq!(upward("x/src/low/b>x/src/top/a"), up);
        let strangers = strangers(row, &arrows("x/src/top>x/src/new"));
        let expected = [
            "x/src/new is missing in docs/architecture.md; say which layers it may name",
            "docs/architecture.md lists `low`, which x/src does not have",
        ];
        assert_eq!(strangers, expected);
    }

    #[test]
    fn a_circle_is_named_but_not_one_of_parent_and_child() {
        assert!(circles(&arrows("a>a/x a/x>a")).is_empty());
        let names = arrows("a/x>b b>c c>a/x b>d");
        let circles: Vec<String> = circles(&names).iter().map(|it| list(it)).collect();
        assert_eq!(circles, ["a/x, b, c"]);
    }

    #[test]
    fn a_tree_of_imports_is_written_out() {
        let code = "use crate::a::{self, B, c::{D as E, f::*}};\nlet x = super::g::H::new(y);";
        let paths: BTreeSet<String> = paths(code).iter().map(|path| path.join("::")).collect();
        for path in ["self", "B", "c::D", "c::f::*"] {
            assert!(paths.contains(&format!("crate::a::{path}")), "{paths:?}");
        }
        assert!(paths.contains("super::g::H::new"), "{paths:?}");
    }

    #[test]
    fn a_path_leads_into_the_module_that_is_there() {
        let files = [
            ("x/src", "mod a; mod b;", ""),
            (
                "x/src/a",
                "mod x; use crate::b::Thing; x::f(); b.a",
                "x/src/a/x x/src/b",
            ),
            (
                "x/src/a/x",
                "use super::super::b::y; use std::fs; crate::a::g();",
                "x/src/a x/src/b",
            ),
            ("x/src/b", "", ""),
        ];
        let codes = files.map(|(path, code, _)| (path.into(), code.into()));
        let names = names(&codes.into());
        for (path, _, named) in files {
            let expected = named.split_whitespace().map(PathBuf::from).collect();
            assert_eq!(names[Path::new(path)], expected, "{path}");
        }
    }

    #[test]
    fn unit_tests_and_comments_do_not_count() {
        let text = "//! A.\n#[cfg(test)]\nuse crate::a;\nfn f() {}\n\n#[cfg(test)]\nmod tests {\n}";
        assert_eq!(code(text), "#[cfg(test)]\nuse crate::a;\nfn f() {}\n");
        assert_eq!(module(Path::new("x/src/a/mod.rs")), Some("x/src/a".into()));
        for other in ["x/src/tests.rs", "x/src/tests/a.rs", "x/src/a.s"] {
            assert_eq!(module(Path::new(other)), None);
        }
    }
}
