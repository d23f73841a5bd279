//! Product and laboratory are apart: dependencies forbidden between packages.
//!
//! A package *stands on* every package named in a table of its manifest, and on everything those
//! packages need in turn, except for their tests.
//! `docs/decisions/0052-product-and-laboratory-apart.md` has the reasons.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tool::image::package_name;

use super::{SourceFile, none_of};

/// Groups of folders, each with the folders none of its packages may stand on.
const NEVER: [(&[&str], &[&str]); 4] = [
    (
        &["sched-dag", "fass", "kernel", "boot", "apps"],
        &["apps", "scripts"],
    ),
    (
        &["scripts/tool"],
        &["scripts/lab", "scripts/web", "apps", "kernel"],
    ),
    (&["scripts/views"], &["scripts", "apps", "kernel"]),
    (&["scripts/web"], &["scripts/lab", "scripts/tool"]),
];

/// The laboratory's apps, which may stand on everything.
const LABORATORY: &str = "apps/lab";

/// The packages by name: each with its folder and the names of needed packages. A flag marks a
/// package needed by tests alone.
type Packages<'s> = BTreeMap<String, (&'s Path, Vec<(bool, &'s str)>)>;

/// Checks the manifests for forbidden dependencies.
///
/// # Errors
///
/// In words: each offending package, and the package beneath.
pub(super) fn check(sources: &[SourceFile]) -> Result<(), String> {
    let manifests = sources.iter().filter_map(|SourceFile { name, text }| {
        let folder = Path::new(name.strip_suffix("/Cargo.toml")?);
        Some((package_name(text)?, (folder, needs(text))))
    });
    let packages: Packages<'_> = manifests.collect();
    let is_in = |folder: &Path, all: &[&str]| all.iter().any(|it| folder.starts_with(it));
    let mut faults = Vec::new();
    for (name, &(folder, _)) in &packages {
        for (above, never) in NEVER {
            if !is_in(folder, above) || folder.starts_with(LABORATORY) {
                continue;
            }
            let below = stands_on(name, &packages).into_iter();
            let below = below.filter(|below| *below != folder && is_in(below, never));
            faults.extend(below.map(|it| format!("{} on {}", folder.display(), it.display())));
        }
    }
    none_of(faults).map_err(|found| {
        format!("these stand on what they never may: {found}; move what they need below both")
    })
}

/// Returns the folders of the packages that a given package stands on.
fn stands_on<'s>(name: &str, packages: &Packages<'s>) -> BTreeSet<&'s Path> {
    let mut found = BTreeSet::new();
    let mut open: Vec<(&str, bool)> = vec![(name, true)];
    while let Some((name, with_tests)) = open.pop() {
        for &(is_for_tests, needed) in packages.get(name).map_or(&[][..], |(_, needs)| needs) {
            let counts = with_tests || !is_for_tests;
            if let Some((folder, _)) = packages.get(needed).filter(|_| counts)
                && found.insert(*folder)
            {
                open.push((needed, false));
            }
        }
    }
    found
}

/// Reads the names in a manifest's dependency tables, each with a flag: needed by tests alone.
fn needs(manifest: &str) -> Vec<(bool, &str)> {
    let mut table = "";
    let mut needs = Vec::new();
    for line in manifest.lines() {
        let heading = line.strip_prefix('[').map(|it| it.trim_end_matches(']'));
        table = heading.unwrap_or(table);
        let (kind, name) = match (table.split_once("dependencies"), heading) {
            (Some((kind, "")), None) => (kind, line.split([' ', '.', '=']).next()),
            // A dependency may have a table of its own.
            (Some((kind, own)), Some(_)) => (kind, own.strip_prefix('.')),
            _ => continue,
        };
        let name = name.filter(|name| !name.is_empty() && !name.starts_with('#'));
        needs.extend(name.map(|name| (kind.contains("dev-"), name)));
    }
    needs
}

#[cfg(test)]
mod tests {
    use super::{SourceFile, check};

    /// Makes manifests from rows such as `kernel: fass, dev random`: a folder and its needs. The
    /// last part of the folder is the package's name.
    fn manifests(rows: &[&str]) -> Vec<SourceFile> {
        let manifest = |row: &&str| {
            let (folder, needs) = row.split_once(": ").unwrap();
            let name = folder.rsplit('/').next().unwrap();
            let mut text = format!("[package]\nname = \"{name}\"\n");
            for need in needs.split(", ") {
                text += &match need.strip_prefix("dev ") {
                    Some(need) => format!("\n[dev-dependencies]\n{need}.workspace = true\n"),
                    None => format!("\n[dependencies]\n# It.\n{need} = {{ path = \"x\" }}\n"),
                };
            }
            let name = format!("{folder}/Cargo.toml");
            SourceFile { name, text }
        };
        rows.iter().map(manifest).collect()
    }

    #[test]
    fn what_stands_on_an_app_a_laboratory_or_the_kernel_is_named() {
        let right = [
            "fass/text: none",
            "kernel: text, dev text",
            "apps/drone: kernel",
            "apps/lab/hand-off: drone, kernel",
            "scripts/views: text",
            "scripts/tool: text, views",
            "scripts/web: views, drone",
            "scripts/lab: tool, hand-off",
        ];
        assert_eq!(check(&manifests(&right)), Ok(()));
        for (at, row, found) in [
            (1, "kernel: dev drone", "kernel on apps/drone"),
            (2, "apps/drone: hand-off", "apps/drone on apps/lab/hand-off"),
            (4, "scripts/views: drone", "scripts/views on apps/drone"),
            (5, "scripts/tool: dev lab", "scripts/tool on scripts/lab"),
            (5, "scripts/tool: drone", "scripts/tool on kernel"),
            (6, "scripts/web: tool", "scripts/web on scripts/tool"),
        ] {
            let mut rows = right;
            rows[at] = row;
            let why = check(&manifests(&rows)).unwrap_err();
            assert!(why.contains(found), "{why}");
        }
    }
}
