//! Which modules of its crate a source file names.
//!
//! A file's *module* is its path below `src`, without `.rs` and `/mod`; the crate's root
//! is the empty path. It *names* a module if a path in its code, within `use` or without,
//! begins with `crate`, `super`, `self` or a child's name and leads into that module.
//! Code for tests is left out: a test may name anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::code::code_only;

/// The path of a module within its crate, such as `["machine", "clock"]`.
pub(super) type Module = Vec<String>;

/// Which modules of the crate each of its modules names, itself left out.
pub(super) type Names = BTreeMap<Module, BTreeSet<Module>>;

/// Reads the files below `src`, the folder of a crate's sources.
///
/// # Errors
///
/// In words: a file or folder cannot be read.
pub(super) fn read(src: &Path) -> Result<Names, String> {
    let mut files = BTreeMap::new();
    read_folder(src, &[], &mut files).map_err(|error| format!("{}: {error}", src.display()))?;
    Ok(names(&files))
}

fn read_folder(
    folder: &Path,
    above: &[String],
    files: &mut BTreeMap<Module, String>,
) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        if stem == "tests" {
            continue;
        }
        let mut module = above.to_vec();
        if path.is_dir() {
            module.push(stem.into());
            read_folder(&path, &module, files)?;
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            if !["mod", "lib", "main"].contains(&&*stem) {
                module.push(stem.into());
            }
            files.insert(module, product(&code_only(&fs::read_to_string(&path)?)));
        }
    }
    Ok(())
}

/// Cuts the module of unit tests off, which stands last in each of our files.
fn product(code: &str) -> String {
    let mut from = 0;
    while let Some(found) = code[from..].find("#[cfg(test)]") {
        let at = from + found;
        let item = code[at..].lines().nth(1).unwrap_or_default();
        if item.starts_with("mod ") && item.ends_with('{') {
            return code[..at].into();
        }
        from = at + 1;
    }
    code.into()
}

fn names(files: &BTreeMap<Module, String>) -> Names {
    let named = |(module, code): (&Module, &String)| {
        let mut named: BTreeSet<Module> = paths(code)
            .iter()
            .filter_map(|path| target(module, path, files))
            .collect();
        named.remove(module);
        (module.clone(), named)
    };
    files.iter().map(named).collect()
}

/// Returns the module that a path leads into, seen from `module`; nothing for a path into
/// another crate.
fn target(module: &Module, path: &[String], files: &BTreeMap<Module, String>) -> Option<Module> {
    let mut from = module.clone();
    let mut words = path;
    match words.first()?.as_str() {
        "crate" => from.clear(),
        "self" => {}
        "super" => {
            from.pop();
            while words.get(1).is_some_and(|word| word == "super") {
                words = &words[1..];
                from.pop();
            }
        }
        child => {
            from.push(child.into());
            files.contains_key(&from).then_some(())?;
        }
    }
    from.extend(words[1..].iter().cloned());
    while !files.contains_key(&from) {
        from.pop()?;
    }
    Some(from)
}

/// Returns every path of the code, those of a `use` written out one by one.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let tokens = tokens(code);
    let mut at = 0;
    while at < tokens.len() {
        let begins = is_word(tokens[at]) && tokens.get(at + 1) == Some(&"::");
        let follows = at > 0 && tokens[at - 1] == "::";
        if begins && !follows {
            at = tree(&tokens, at, &[], &mut found);
        } else {
            at += 1;
        }
    }
    found
}

/// Reads one path, or a tree of them as `use` has, and returns where it ends.
fn tree(tokens: &[&str], mut at: usize, above: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = above.to_vec();
    loop {
        match tokens.get(at) {
            Some(word) if is_word(word) => path.push((*word).into()),
            Some(&"{") if at > 0 && tokens[at - 1] == "::" => {
                return branches(tokens, at + 1, &path, found);
            }
            _ => break,
        }
        if tokens.get(at + 1) != Some(&"::") {
            at += 1;
            break;
        }
        at += 2;
    }
    found.push(path);
    at
}

/// Reads the branches between braces, of which the first has been read.
fn branches(
    tokens: &[&str],
    mut at: usize,
    path: &[String],
    found: &mut Vec<Vec<String>>,
) -> usize {
    while let Some(token) = tokens.get(at) {
        match *token {
            "}" => return at + 1,
            word if is_word(word) => {
                at = tree(tokens, at, path, found);
                // `as` and the new name, which is no branch.
                if tokens.get(at) == Some(&"as") {
                    at += 2;
                }
            }
            _ => at += 1,
        }
    }
    at
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Cuts the code into words, `::`, and single other characters.
fn tokens(code: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = code.trim_start();
    while let Some(first) = rest.chars().next() {
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        let length = if is_part(first) {
            rest.find(|c| !is_part(c)).unwrap_or(rest.len())
        } else if rest.starts_with("::") {
            2
        } else {
            first.len_utf8()
        };
        tokens.push(&rest[..length]);
        rest = rest[length..].trim_start();
    }
    tokens
}

#[cfg(test)]
mod tests {
    use super::{Module, names, paths, product};

    #[test]
    fn a_tree_of_imports_is_written_out() {
        let code = "use crate::a::{self, B, c::{D as E, f::*}};\nlet x = super::g::H::new(y);";
        let paths: Vec<String> = paths(code).iter().map(|path| path.join("::")).collect();
        let expected = "crate::a::self crate::a::B crate::a::c::D crate::a::c::f super::g::H::new";
        assert_eq!(paths.join(" "), expected);
    }

    #[test]
    fn a_path_leads_into_the_module_that_is_there() {
        let module =
            |path: &str| -> Module { path.split_terminator('/').map(String::from).collect() };
        let files = [
            ("", "mod a; mod b;", ""),
            ("a", "mod x; use crate::b::Thing; x::f();", "a/x b"),
            (
                "a/x",
                "use super::super::b::y; use std::fs; crate::a::g();",
                "a b",
            ),
            ("b", "", ""),
        ];
        let names = names(
            &files
                .map(|(path, code, _)| (module(path), code.into()))
                .into(),
        );
        for (path, _, named) in files {
            let expected = named.split_whitespace().map(module).collect();
            assert_eq!(names[&module(path)], expected, "{path}");
        }
    }

    #[test]
    fn unit_tests_do_not_count() {
        let code = "#[cfg(test)]\nuse crate::a;\nfn f() {}\n#[cfg(test)]\nmod tests {\n}";
        assert_eq!(product(code), "#[cfg(test)]\nuse crate::a;\nfn f() {}\n");
    }
}
