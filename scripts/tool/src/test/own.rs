//! Which packages the checks judge: the project's own.
//!
//! An app that somebody makes here need not follow the project's rules on lints, format
//! and files, only pass its tests. A package takes the rules on itself by one thing: by
//! taking the workspace's lints.

use std::fs;
use std::path::{Path, PathBuf};

use crate::image::package_name;
use crate::system;

/// Returns all files of the workspace but the generated ones, and but those of packages that
/// are not the project's own; sorted.
pub(super) fn files() -> Vec<PathBuf> {
    of(system::workspace())
}

/// Returns the names of the packages whose files these are, sorted.
pub(super) fn packages(files: &[PathBuf]) -> Vec<String> {
    let manifests = files.iter().filter(|file| file.ends_with("Cargo.toml"));
    let texts = manifests.flat_map(fs::read_to_string);
    let mut names: Vec<String> = texts.filter_map(|text| package_name(&text)).collect();
    names.sort();
    names
}

/// Names a file from the workspace's root.
pub(super) fn shown(path: &Path) -> String {
    let path = path.strip_prefix(system::workspace()).unwrap_or(path);
    path.display().to_string()
}

fn of(root: &Path) -> Vec<PathBuf> {
    system::files_below(root, |folder| {
        let manifest = fs::read_to_string(folder.join("Cargo.toml"));
        manifest.map_or(true, |text| {
            package_name(&text).is_none() || takes_lints(&text)
        })
    })
}

fn takes_lints(manifest: &str) -> bool {
    let lints = manifest.split("\n[lints]").nth(1);
    let lines = lints.into_iter().flat_map(str::lines);
    let mut of_lints = lines.skip(1).take_while(|line| !line.starts_with('['));
    of_lints.any(|line| line.replace(' ', "") == "workspace=true")
}

#[cfg(test)]
mod tests {
    use super::{files, of, packages};
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
        let found = of(&root);
        assert_eq!(packages(&found), ["ours"]);
        let ours = root.join("apps/ours");
        assert_eq!(found, [ours.join("Cargo.toml"), ours.join("src/lib.rs")]);
        fs::remove_dir_all(root).unwrap();

        let packages = packages(&files());
        let some = "sched-dag fass kernel boot-link tool harness fork-join";
        let missing = some
            .split(' ')
            .find(|name| !packages.iter().any(|own| own == name));
        assert_eq!(missing, None, "{packages:?}");
        let template = include_str!("../../template/manifest.toml");
        assert!(!super::takes_lints(template));
    }
}
