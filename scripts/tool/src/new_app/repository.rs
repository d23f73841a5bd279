//! An app in a repository of its own, outside the workspace.
//!
//! It has all that an app under `apps/` gets from the workspace: profiles, the toolchain's
//! version, where the crates are. Cargo's *runner* there boots what is an image, so that
//! `cargo run` and `cargo test` do what they do for any program.

use std::path::Path;

use replay::shown::quoted;

use super::{AppFile, Changes, FILES, is_there, name, write_folder};
use crate::options::Refusal;

/// Where a repository's app has the crates from, and cargo its runner.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// The root of a workspace in this file system.
    Folder(&'a Path),
    /// A git repository, by its URL; the runner is installed.
    Git(&'a str),
}

/// The workspace's root, as the template's files name it.
const WORKSPACE: &str = "/workspace";

/// The packages that the template depends on, by their folders.
const PACKAGES: [&str; 5] = [
    "fass",
    "kernel",
    "kernel/on-linux",
    "fass/virtual-time",
    "boot/link",
];

/// The files that an app under `apps/` does without, or has others for.
const OWN_FILES: [AppFile; 6] = [
    (
        "Cargo.toml",
        include_str!("../../template/repository/manifest.toml"),
    ),
    (
        ".cargo/config.toml",
        include_str!("../../template/repository/config.toml"),
    ),
    (
        ".github/workflows/ci.yml",
        include_str!("../../template/repository/ci.yml"),
    ),
    (".gitignore", "/target\n"),
    (
        "README.md",
        include_str!("../../template/repository/README.md"),
    ),
    (
        "rust-toolchain.toml",
        include_str!("../../../../rust-toolchain.toml"),
    ),
];

/// Makes a new folder, the root of an app's repository.
///
/// # Errors
///
/// The name or the folder is refused, or a file cannot be written; nothing is left then.
pub fn create_repository(out: &Path, name: &str, source: Source<'_>) -> Result<(), Refusal> {
    name::check_word(name).map_err(Refusal::Usage)?;
    if PACKAGES
        .iter()
        .any(|package| package.replace("fass/", "").replace('/', "-") == name)
    {
        return Err(Refusal::Usage(format!(
            "{} cannot be an app's name: it is that of a package that the app needs; choose another",
            quoted(name)
        )));
    }
    let shown = quoted(&out.to_string_lossy()).to_string();
    let changes = match source {
        Source::Git(url) if url.contains(['"', '\\', '\n']) => {
            let line = format!("`--git {}`: no URL has such a character", quoted(url));
            return Err(Refusal::Usage(line));
        }
        Source::Folder(root) => match root.to_str().filter(|root| !root.contains(['"', '\\'])) {
            Some(root) => from_folder(root),
            None => {
                let line = format!("{shown}: cargo cannot name the folder of these commands");
                return Err(Refusal::Failure(line));
            }
        },
        Source::Git(url) => from_git(url),
    };
    let files = OWN_FILES.into_iter().chain(FILES.iter().copied());
    let taken = format!("`--out` {shown}: it is there already; name a folder to be made");
    write_folder(out, name, files, changes, &taken)
}

/// Returns how texts change for crates of this workspace. Nothing is installed for them.
fn from_folder(root: &str) -> Changes {
    let install = "      - run: cargo install --locked --git /workspace tool\n";
    let changes = [
        (install, ""),
        ("ubuntu-latest", "self-hosted # where the crates are"),
        (WORKSPACE, root),
    ];
    changes.map(|(old, new)| (old.into(), new.into())).into()
}

/// Returns how texts change for crates of this git repository.
fn from_git(url: &str) -> Changes {
    let by_path = |package| format!("path = \"{WORKSPACE}/{package}\"");
    let crates = PACKAGES.map(|package| (by_path(package), format!("git = \"{url}\"")));
    let others = [
        ("\"/workspace/scripts/boot\"", "\"fass-tool\", \"boot\""),
        ("/workspace/scripts/debug", "fass-tool debug"),
        (WORKSPACE, url),
    ];
    let others = others.map(|(old, new)| (old.into(), new.into()));
    crates.into_iter().chain(others).collect()
}

/// Says what to do in the repository.
pub(super) fn next_steps(out: &Path, source: Source<'_>) -> String {
    let install = match source {
        Source::Folder(_) => String::new(),
        Source::Git(url) => {
            format!("cargo install --locked --git {url} tool   # once: the runner, fass-tool\n")
        }
    };
    format!(
        "\
{}{install}cd {}
cargo run               # boots it in QEMU
cargo test              # tests it on the host
cargo run -- --on linux # runs it on Linux, docs/linux.md
git init                # docs/guide.md goes on from here
",
        is_there(&out.display().to_string()),
        out.display()
    )
}

#[cfg(test)]
mod tests {
    use super::{PACKAGES, Source, create_repository};
    use crate::options::Refusal;
    use crate::system::workspace;
    use std::fs;

    /// That the app is built and boots is shown by `tests/tests/boot_new_app.rs`.
    #[test]
    fn from_git_the_url_is_all_that_is_named_and_from_a_folder_nothing_is_installed() {
        let url = "https://example.org/kernel.git";
        for source in [Source::Git(url), Source::Folder(workspace())] {
            let is_git = matches!(source, Source::Git(_));
            let out = std::env::temp_dir().join(format!("from-{is_git}-{}", std::process::id()));
            create_repository(&out, "brake-assist", source).unwrap();
            let places = [
                "Cargo.toml",
                ".cargo/config.toml",
                ".github/workflows/ci.yml",
            ];
            let texts = places.map(|place| fs::read_to_string(out.join(place)).unwrap());
            let [manifest, runner, steps] = &texts;
            assert_eq!(steps.contains("install"), is_git, "{steps}");
            if is_git {
                let by_url = format!("{{ git = \"{url}\" }}");
                assert_eq!(
                    manifest.matches(&by_url).count(),
                    PACKAGES.len(),
                    "{manifest}"
                );
                let words = "runner = [\"fass-tool\", \"boot\"]\n";
                assert!(runner.ends_with(words), "{runner}");
                let install = format!("- run: cargo install --locked --git {url} tool\n");
                assert!(steps.contains(&install), "{steps}");
                assert!(!texts.concat().contains("/workspace"), "{texts:?}");
            }
            for (out, name, part) in [
                (
                    out.clone(),
                    "brake",
                    ": it is there already; name a folder to be made",
                ),
                (
                    out.join("new"),
                    "boot-link",
                    "of a package that the app needs; choose",
                ),
                (out.join("new"), "Brake", "'B' is in it; "),
            ] {
                match create_repository(&out, name, source) {
                    Err(Refusal::Usage(line)) => assert!(line.contains(part), "{line}"),
                    other => panic!("{name}: {other:?}"),
                }
            }
            assert!(!out.join("new").exists());
            fs::remove_dir_all(out).unwrap();
        }
    }

    #[test]
    fn it_is_built_for_figures_as_in_the_workspace() {
        let profile = |manifest: &'static str| {
            let from = manifest.find("[profile.release]").unwrap();
            let lines = manifest[from..].lines().filter(|line| !line.is_empty());
            lines.collect::<Vec<_>>()
        };
        let own = profile(include_str!("../../template/repository/manifest.toml"));
        let workspace = profile(include_str!("../../../../Cargo.toml"));
        assert!(own.len() > 8, "{own:?}");
        assert!(own.iter().all(|line| workspace.contains(line)), "{own:?}");
    }
}
