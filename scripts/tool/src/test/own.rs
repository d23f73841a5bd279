//! Which packages the checks judge: the project's own.
//!
//! An app that somebody makes here need not follow the project's rules on lints, format
//! and files, only pass its tests. A package takes the rules on itself by one thing: by
//! taking the workspace's lints.

use std::fs;
use std::path::{Path, PathBuf};

use crate::image::package_name;
use crate::system;

/// Returns the names of the project's own packages, sorted.
pub(super) fn packages() -> Vec<String> {
    let (mut names, _) = read(system::workspace());
    names.sort();
    names
}

/// Returns all files of the workspace but the generated ones, and but those of packages that
/// are not the project's own; sorted.
pub(super) fn files() -> Vec<PathBuf> {
    let (_, mut files) = read(system::workspace());
    files.sort();
    files
}

/// Names a file from the workspace's root.
pub(super) fn shown(path: &Path) -> String {
    let path = path.strip_prefix(system::workspace()).unwrap_or(path);
    path.display().to_string()
}

fn read(root: &Path) -> (Vec<String>, Vec<PathBuf>) {
    let (mut names, mut files) = (Vec::new(), Vec::new());
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        if let Ok(manifest) = fs::read_to_string(folder.join("Cargo.toml"))
            && let Some(name) = package_name(&manifest)
        {
            if !takes_lints(&manifest) {
                continue;
            }
            names.push(name);
        }
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if !path.is_dir() {
                files.push(path);
            } else if !name.starts_with('.') && name != "target" {
                folders.push(path);
            }
        }
    }
    (names, files)
}

fn takes_lints(manifest: &str) -> bool {
    let lints = manifest.split("\n[lints]").nth(1);
    let lines = lints.into_iter().flat_map(str::lines);
    let mut of_lints = lines.skip(1).take_while(|line| !line.starts_with('['));
    of_lints.any(|line| line.replace(' ', "") == "workspace=true")
}

#[cfg(test)]
mod tests {
    use super::{packages, read};
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
        let (names, mut files) = read(&root);
        files.sort();
        assert_eq!(names, ["ours"]);
        let ours = root.join("apps/ours");
        assert_eq!(files, [ours.join("Cargo.toml"), ours.join("src/lib.rs")]);
        fs::remove_dir_all(root).unwrap();

        let packages = packages();
        let some = "sched-dag fass kernel boot-link tool harness fork-join";
        let missing = some
            .split(' ')
            .find(|name| !packages.iter().any(|own| own == name));
        assert_eq!(missing, None, "{packages:?}");
        let template = include_str!("../../template/manifest.toml");
        assert!(!super::takes_lints(template));
    }
}
