//! The order within each crate: which folder may name which, and no circles.
//!
//! A crate's folders (and single files) right below `src` are its *layers*. The page
//! docs/architecture.md lists them from top to bottom, and nowhere else are they listed; a
//! layer may name those that stand after it. A folder may have a row of its own, which
//! orders what is right below it. Everywhere, no file may lead back to itself through files
//! that name each other, but for a file and those it contains.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::imports::{self, Module, Names};
use crate::system;

/// Where the table stands: the page, and the heading right above it.
const PAGE: &str = "docs/architecture.md";
const HEADING: &str = "## Layers inside the crates";

/// A row of the table: the folder of a crate's sources, or one in it, and the layers there
/// from top to bottom.
#[derive(Debug, PartialEq, Eq)]
struct Row {
    src: String,
    layers: Vec<String>,
}

/// Holds every crate of the table against it.
pub(super) fn check() -> Result<(), String> {
    let page = fs::read_to_string(system::workspace().join(PAGE))
        .map_err(|error| format!("{PAGE}: {error}"))?;
    let rows = rows(&page);
    if rows.is_empty() {
        return Err(format!("{PAGE} has no table below `{HEADING}`"));
    }
    let mut faults = Vec::new();
    for row in &rows {
        let (src, folder) = match row.src.split_once("/src/") {
            Some((above, folder)) => (format!("{above}/src"), folder),
            None => (row.src.clone(), ""),
        };
        let names = imports::read(&system::workspace().join(&src))?;
        if folder.is_empty() {
            for circle in circles(&names) {
                let files = circle.join(", ");
                faults.push(format!("{src}: {files} name each other in a circle"));
            }
        }
        let names = within(folder, &names);
        faults.extend(strangers(row, &names));
        faults.extend(upward(row, &names));
    }
    if faults.is_empty() {
        return Ok(());
    }
    Err(faults.join("; "))
}

/// Reads the rows of the table, such as ``| `fass/src` | `api`, `run` |``.
fn rows(page: &str) -> Vec<Row> {
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
        Some(Row {
            src,
            layers: words(cells.next()?),
        })
    };
    section.lines().filter_map(row).collect()
}

/// What the files of a folder name of each other, by their paths from there.
fn within(folder: &str, names: &Names) -> Names {
    let above: Vec<&str> = folder.split_terminator('/').collect();
    let inside = |module: &Module| {
        let is_inside =
            module.len() >= above.len() && module.iter().zip(&above).all(|(a, b)| a == b);
        is_inside.then(|| module[above.len()..].to_vec())
    };
    let files = names.iter().filter_map(|(module, named)| {
        Some((inside(module)?, named.iter().filter_map(inside).collect()))
    });
    files.collect()
}

/// Layers that only the table or only the folder has.
fn strangers(row: &Row, names: &Names) -> Vec<String> {
    let there: BTreeSet<&String> = names.keys().filter_map(|module| module.first()).collect();
    let listed: BTreeSet<&String> = row.layers.iter().collect();
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

/// Files that name a layer above their own.
fn upward(row: &Row, names: &Names) -> Vec<String> {
    let place = |module: &Module| {
        let layer = module.first()?;
        row.layers.iter().position(|listed| listed == layer)
    };
    let mut faults = Vec::new();
    for (module, named) in names {
        for other in named {
            if let (Some(from), Some(to)) = (place(module), place(other))
                && to < from
            {
                faults.push(format!(
                    "{}/{} names `{}`, a layer above its own",
                    row.src,
                    module.join("/"),
                    other.join("::")
                ));
            }
        }
    }
    faults
}

/// Returns the circles of files that name each other, each in order of their names.
fn circles(names: &Names) -> impl Iterator<Item = Vec<String>> {
    let reached: BTreeMap<&Module, BTreeSet<&Module>> = names
        .keys()
        .map(|module| (module, reached_from(module, names)))
        .collect();
    let circle = |module: &&Module| -> Vec<String> {
        let back = |other: &&&Module| reached[**other].contains(*module);
        reached[*module]
            .iter()
            .filter(back)
            .map(|other| other.join("/"))
            .collect()
    };
    let found: BTreeSet<Vec<String>> = names
        .keys()
        .by_ref()
        .map(|module| circle(&module))
        .collect();
    found.into_iter().filter(|circle| circle.len() > 1)
}

/// Returns the modules that `module` names, directly or through others.
fn reached_from<'n>(module: &'n Module, names: &'n Names) -> BTreeSet<&'n Module> {
    let mut reached = BTreeSet::new();
    let mut open = vec![module];
    while let Some(next) = open.pop() {
        for named in names.get(next).into_iter().flatten() {
            let contains = next.starts_with(named) || named.starts_with(next);
            if !contains && reached.insert(named) {
                open.push(named);
            }
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::{HEADING, Names, circles, rows, strangers, upward, within};

    /// Reads arrows between modules, such as `a/x>b`.
    fn names(arrows: &str) -> Names {
        let module = |path: &str| path.split('/').map(String::from).collect::<Vec<_>>();
        let mut names = Names::new();
        for arrow in arrows.split(' ') {
            let (from, to) = arrow.split_once('>').unwrap();
            names.entry(module(to)).or_default();
            names.entry(module(from)).or_default().insert(module(to));
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
        let up = ["x/src/low/b names `top::a`, a layer above its own"];
        assert_eq!(upward(row, &names("top/a>low")), [""; 0]);
        assert_eq!(upward(row, &names("low/b>top/a")), up);
        // A folder has an order of its own.
        let all = names("x/top/a>low x/low/b>x/top/a x/low/b>top");
        assert_eq!(upward(row, &within("x", &all)), up);
        let strangers = strangers(row, &names("top>new"));
        let expected = [
            "x/src/new is missing in docs/architecture.md; say which layers it may name",
            "docs/architecture.md lists `low`, which x/src does not have",
        ];
        assert_eq!(strangers, expected);
    }

    #[test]
    fn a_circle_is_named_but_not_one_of_parent_and_child() {
        assert_eq!(circles(&names("a>a/x a/x>a")).count(), 0);
        let circle = names("a/x>b b>c c>a/x b>d");
        assert_eq!(circles(&circle).collect::<Vec<_>>(), [["a/x", "b", "c"]]);
    }
}
