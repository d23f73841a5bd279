//! Which packages the checks judge: the project's own.
//!
//! An app that somebody makes here need not follow the project's rules on lints, format
//! and files, only pass its tests. A package takes the rules on itself by one thing: by
//! taking the workspace's lints.

use std::fs;
use std::path::Path;

use crate::image::package_name;
use crate::system;

/// A file: its name from the workspace's root, and its text.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Source {
    pub(super) name: String,
    pub(super) text: String,
}

/// Returns all files of the workspace but the generated ones, and but those of packages that
/// are not the project's own; sorted.
pub(super) fn sources() -> Vec<Source> {
    below(system::workspace())
}

/// Returns the names of the packages whose files these are, sorted.
pub(super) fn packages(sources: &[Source]) -> Vec<String> {
    let manifests = sources.iter().filter(|it| it.name.ends_with("Cargo.toml"));
    let mut names: Vec<String> = manifests.filter_map(|it| package_name(&it.text)).collect();
    names.sort();
    names
}

fn below(root: &Path) -> Vec<Source> {
    let files = system::files_below(root, |folder| {
        let manifest = fs::read_to_string(folder.join("Cargo.toml"));
        manifest.map_or(true, |text| {
            package_name(&text).is_none() || takes_lints(&text)
        })
    });
    let source = |file: &Path| Source {
        name: file
            .strip_prefix(root)
            .unwrap_or(file)
            .display()
            .to_string(),
        // One that cannot be read has no essay.
        text: String::from_utf8_lossy(&fs::read(file).unwrap_or_default()).into_owned(),
    };
    files.iter().map(|file| source(file)).collect()
}

fn takes_lints(manifest: &str) -> bool {
    let lints = manifest.split("\n[lints]").nth(1);
    let lines = lints.into_iter().flat_map(str::lines);
    let mut of_lints = lines.skip(1).take_while(|line| !line.starts_with('['));
    of_lints.any(|line| line.replace(' ', "") == "workspace=true")
}

#[cfg(test)]
mod tests {
    use super::{below, packages, sources};
    use std::fs;

    #[test]
    fn an_app_of_ones_own_is_not_judged_and_all_packages_of_the_project_are() {
        let root = std::env::temp_dir().join(format!("own-{}", std::process::id()));
        for (name, lints) in [("ours", "[lints]\nworkspace = true\n"), ("theirs", "")] {
            let folder = root.join("apps").join(name);
            fs::create_dir_all(folder.join("src")).unwrap();
            let manifest = format!("[package]\nname = \"{name}\"\n\n{lints}");
            fs::write(folder.join("Cargo.toml"), manifest).unwrap();
            fs::write(folder.join("src/lib.rs"), "").unwrap();
        }
        let found = below(&root);
        assert_eq!(packages(&found), ["ours"]);
        let names: Vec<&str> = found.iter().map(|source| &*source.name).collect();
        assert_eq!(names, ["apps/ours/Cargo.toml", "apps/ours/src/lib.rs"]);
        fs::remove_dir_all(root).unwrap();

        let packages = packages(&sources());
        let some = "sched-dag fass kernel boot-link tool harness fork-join";
        let missing = some
            .split(' ')
            .find(|name| !packages.iter().any(|own| own == name));
        assert_eq!(missing, None, "{packages:?}");
        let template = include_str!("../../template/manifest.toml");
        assert!(!super::takes_lints(template));
    }
}
