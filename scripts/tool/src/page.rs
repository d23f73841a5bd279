//! Makes the page that plays DAG files and shows runs in a browser, as a single file: the
//! subcommand `page`.
//!
//! The page's HTML, CSS and JavaScript lie in `scripts/web`. Its *engine*, a WebAssembly program,
//! is embedded in the page, packed by gzip and coded in base 64, as are the records to show. The
//! examples are embedded as JSON. None of these data can end the script around them, whatever a
//! file, its name or its comments say. The page loads nothing from elsewhere.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command as Program, ExitCode};

use fass_dag_file::parse;
use views::json::Object;

use crate::files::{self, NamedFile};
use crate::image::{self, PAGE_PROFILE};
use crate::install;
use crate::options::{Command, CommandLine, Refusal, ValueKind, options};
use crate::system;
use crate::trace;

/// The options and the help text of `page`.
pub static PAGE: Command = Command {
    invocation: "./scripts/page",
    about: "Makes a page of one file that plays DAG files, and shows runs, in any browser.",
    positional: Some((
        ValueKind::File("FILE..."),
        "DAG files to begin with; or records of runs, by ./scripts/run --keep or --trace, to show.",
    )),
    options: OPTIONS,
    notes: "exit codes: 0 all is well; 1 no page can be made; 2 a refused command line or file\n",
};

options! {
    /// Write to this file.
    OUT 'o': ValueKind::File("FILE"), or "page.html";
}

/// Runs the subcommand with the words after its name.
pub fn page(words: &[OsString]) -> ExitCode {
    PAGE.carry_out(words, |options| {
        let html = html(&read(options).map_err(Refusal::Usage)?, false)?;
        for out in options.named(&[name::OUT]) {
            files::write_named(out.option, out.path, &html)?;
            eprintln!("{}: open it in a browser", files::shown_path(out.path));
        }
        Ok(ExitCode::SUCCESS)
    })
}

/// Files in a page, as elements of two JavaScript lists, each followed by a comma.
#[derive(Default)]
pub(crate) struct PageContent {
    examples: String,
    records: String,
}

/// Reads the files named by the options.
fn read(options: &CommandLine) -> Result<PageContent, String> {
    let inputs = options.files().map(|path| NamedFile { option: "", path });
    files::check_once(options.files())?;
    files::check(&inputs.collect::<Vec<_>>(), &options.named(&[name::OUT]))?;
    let mut content = PageContent::default();
    for path in options.files() {
        let place = files::shown_path(path);
        if path.extension().is_some_and(|ending| ending == "dag") {
            let text = files::read_text(path)?;
            // Faults of a commit are no obstacle: the page shows them, line by line.
            parse(&text).map_err(|of| format!("{place}:{}: {}", of.line, of.reason))?;
            content.examples += &example(path, &text, "");
        } else {
            let is_no_run = |why| format!("{why} (the name of a DAG file ends in .dag)");
            trace::read_file(path).map_err(is_no_run)?;
            let data = system::run(Program::new("base64").args(["--wrap=0", "--"]).arg(path))?;
            let record = Object::new().text("name", &place).text("data", &data);
            content.records += &(record.into_text() + ",\n");
        }
    }
    Ok(content)
}

/// Builds the engine, and returns the page. A live page follows the run of the server it came from.
///
/// # Errors
///
/// In words: the sources are missing, or the engine cannot be built.
pub(crate) fn html(content: &PageContent, is_live: bool) -> Result<String, String> {
    let web = system::workspace().join("scripts/web");
    if !web.is_dir() {
        let why = "are not there; clone the project, and call its ./scripts/page";
        return Err(format!(
            "the page's sources, `{}`, {why}",
            files::shown_path(&web)
        ));
    }
    install::ensure_wasm()?;
    let engine = image::build_target("page", PAGE_PROFILE, ["--bin", "fass-page"], None)?;
    let pack = "gzip -9 --no-name --stdout \"$0\" | base64 --wrap=0";
    let mut packed = Program::new("bash");
    packed.args(["-o", "pipefail", "-c", pack]).arg(engine);
    assembled(&system::run(&mut packed)?, content, is_live)
}

/// Puts all parts into the page's single file.
fn assembled(engine: &str, content: &PageContent, is_live: bool) -> Result<String, String> {
    let read = |name: &str| files::read_text(&system::workspace().join(name));
    let source = |name: &str| read(&format!("scripts/web/{name}"));
    let page = source("page.html")?;
    let listed = page.split_once("<!-- scripts: ");
    let listed = listed.and_then(|(before, rest)| Some((before, rest.split_once(" -->")?)));
    let (before, (scripts, after)) = listed.ok_or("page.html lists no scripts")?;
    let scripts: Vec<String> = scripts.split(' ').map(source).collect::<Result<_, _>>()?;
    let PageContent { examples, records } = content;
    let mut all = examples.clone();
    for line in source("examples.txt")?.lines() {
        let (path, words) = line.split_once(' ').unwrap_or((line, ""));
        all += &example(Path::new(path), &read(path)?, words);
    }
    let script = format!(
        "const ENGINE = \"{engine}\";\nconst EXAMPLES = [{all}];\nconst GIVEN = [{records}];\n\
         const LIVE = {is_live};\n{}",
        scripts.concat()
    );
    // To JavaScript, `\/` in a string is `/`, and `\!` is `!`. To HTML, `</` could end the script,
    // and `<!--` could begin a comment hiding that end.
    let script = script.replace("</", "<\\/").replace("<!--", "<\\!--");
    let html = format!("{before}{after}").replacen("/*STYLE*/", &source("page.css")?, 1);
    Ok(html.replacen("/*SCRIPT*/", &script, 1))
}

/// Returns a DAG file with the words for playing it.
fn example(path: &Path, text: &str, words: &str) -> String {
    let words = words.split(' ').filter_map(|word| word.split_once('='));
    let words = words.fold(Object::new(), |words, (name, value)| {
        words.text(name, value)
    });
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let example = Object::new().text("name", &name);
    let example = example.text("file", &path.to_string_lossy());
    let example = example.text("text", text);
    example.json("words", &words.into_text()).into_text() + ",\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_a_file_says_ends_the_script() {
        let words = "</script><script>alert(1)</script><!-- <script> /*STYLE*/ /*SCRIPT*/";
        let (name, text) = (format!("{words}.dag"), format!("# {words}\n"));
        let examples = example(Path::new(&name), &text, "cores=4 policy=edf");
        let records = Object::new().text("name", words).into_text();
        let html = assembled("Zm9v", &PageContent { examples, records }, false).unwrap();
        let (page, script) = html.split_once("<script ").unwrap();
        assert!(!page.contains("/*STYLE*/") && page.contains("</style>"));
        let (script, after) = script.split_once("</script").unwrap();
        assert!(!after.contains("<"), "{after}");
        assert!(!script.contains("<!--") && !html.contains("<!-- scripts"));
        let begins = "const ENGINE = \"Zm9v\";\nconst EXAMPLES = [{\"name\":\"";
        let example = r#"/*SCRIPT*/\u000a","words":{"cores":"4","policy":"edf"}},"#;
        for part in [
            begins,
            example,
            r"<\/script><script>alert(1)<\/script><\!-- <script>",
        ] {
            assert!(script.contains(part), "{part}");
        }
    }
}
