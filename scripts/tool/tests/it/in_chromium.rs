//! Pages in a browser: Chromium opens files that the command has made, and prints their elements.
//!
//! In a page whose address has `#sync` the engine runs before the page is loaded, as this browser
//! waits for no worker. `./scripts/test` skips these where there is no Chromium, and counts them.

use std::fs::{self, File};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use tool::child::{Child, WaitEnd, bound_to_us};
use tool::system::find_program;

use crate::support::{call, folder};
use crate::traces::good;

/// Far beyond the time that a busy host takes.
const LIMIT: Duration = Duration::from_secs(300);

/// Nothing in it asks the network, or needs a graphics card or a person's own profile.
const ALONE: &str = "--headless --no-sandbox --disable-gpu --disable-quic --disable-dev-shm-usage \
    --no-first-run --disable-background-networking --disable-component-update --disable-sync \
    --virtual-time-budget=30000 --dump-dom";

/// Makes a page of files in a folder, opens it at an address, and returns its elements afterwards,
/// without its styles and scripts.
fn opened(folder: &Path, files: &[&str], hash: &str) -> String {
    let made = call(folder, ["page"].iter().chain(files));
    assert_eq!(made.code, Some(0), "{}", made.complaint);
    let words = "page.html: open it in a browser\n";
    assert!(made.complaint.ends_with(words), "{}", made.complaint);

    let chromium = find_program("chromium").expect("Chromium, as for `./scripts/test`");
    let [shown, said] = ["shown.html", "said"].map(|name| folder.join(name));
    let streams = [&shown, &said].map(|path| File::create(path).expect("our folder takes a file"));
    let [shown_to, said_to] = streams.map(Stdio::from);
    let mut command = bound_to_us(&chromium);
    let profile = format!("--user-data-dir={}", folder.join("profile").display());
    command.args(ALONE.split_whitespace()).arg(profile);
    command.arg(format!("file://{}/page.html#{hash}", folder.display()));
    command
        .stdin(Stdio::null())
        .stdout(shown_to)
        .stderr(said_to);
    let mut child = Child::start(&mut command).expect("Chromium starts");
    let waited = child.wait(LIMIT, || true);
    let said = fs::read_to_string(said).expect("a file");
    let is_well = matches!(waited, WaitEnd::Ended(status) if status.success());
    assert!(is_well, "{waited:?}: {said}");

    let shown = fs::read_to_string(shown).expect("UTF-8");
    let (before, rest) = shown.split_once("<style>").expect("its styles");
    let (_, rest) = rest.split_once("</style>").expect("their end");
    let (elements, rest) = rest.split_once("<script").expect("its script");
    let (_, after) = rest.split_once("</script>").expect("the script's end");
    [before, elements, after].concat()
}

/// Asserts that a page shows all of these.
fn assert_shown(shown: &str, parts: &[&str]) {
    for part in parts {
        assert!(shown.contains(part), "{part}: {shown}");
    }
}

#[test]
fn an_example_is_played() {
    let shown = opened(
        &folder("played"),
        &[],
        "sync&example=stamps&policy=edf&job=lidar.2",
    );
    let proven = "4 of 4</b> DAGs proven";
    let bounds = ["<b>joined</b>", ">29 ms<", "<b>camera</b>", ">8 ms<"];
    assert_shown(&shown, &bounds);
    assert_shown(&shown, &[proven, "rules R1 to R5 hold", "<svg"]);
    // Its sensor goes on elsewhere after a wait, and was not preempted.
    let sensor = "<td class=\"n\">0</td><td class=\"\">core 0, core 2</td>";
    let value = "{\"job\":2,\"stamp_ns\":90334000}";
    assert_shown(&shown, &["Job 2 of lidar, ", sensor, value]);
}

#[test]
fn a_record_is_seen() {
    let folder = folder("seen");
    fs::write(folder.join("good.rec"), good()).expect("our folder takes a file");
    let shown = opened(&folder, &["good.rec"], "sync");
    assert_shown(
        &shown,
        &["<b>x</b>", "good.rec", "5 events", "rules R1 to R5 hold"],
    );
}

/// A name may have any character but a blank; an attribute of a tag is told by `/` as well.
const HOSTILE: &str = "\
# </script><script>document.body.id='ran'</script><!-- <script>
# <img src=x onerror=document.body.id='ran'>
dag <img/src=x/onerror=document.body.id='ran'> period 10ms
subtask <svg/id=ran> wcet 1ms
subtask \"><img/src=x/onerror=document.body.id='ran'> wcet 1ms
end
";

#[test]
fn names_and_comments_run_no_script() {
    let folder = folder("hostile");
    let name = "<!--<script>'\"&<img src=x>.dag";
    fs::write(folder.join(name), HOSTILE).expect("our folder takes a file");
    let shown = opened(&folder, &[name], "sync");
    assert_shown(
        &shown,
        &[
            "&lt;img src=x onerror=document.body.id='ran'&gt;",
            "<b>&lt;img/src=x/onerror=document.body.id='ran'&gt;</b>",
            "&lt;svg/id=ran&gt;",
            "rules R1 to R5 hold",
        ],
    );
    for part in ["<img", "<svg/", "id=\"ran\"", "</script"] {
        assert!(!shown.contains(part), "{part}: {shown}");
    }
}

/// Returns what a shell's line writes as the address of a page has a DAG file.
fn deflated(text: &str) -> String {
    // What is between the header and the checksum of gzip.
    let pack =
        "gzip -9 --no-name | tail -c +11 | head -c -8 | base64 --wrap=0 | tr +/ -_ | tr -d =";
    let mut shell = bound_to_us(Path::new("bash"));
    let written = shell.args(["-c", &format!("{text} | {pack}")]).output();
    String::from_utf8(written.expect("bash and gzip").stdout).expect("base 64")
}

#[test]
fn no_address_hangs_or_breaks_a_page() {
    let centuries =
        "printf 'dag a period 9223372036854775807ns\nsubtask x wcet 9000000000000000000ns\nend\n'";
    let many = "(echo dag a period 1s; seq -f 'subtask s%g wcet 1us' 6000; echo end)";
    for (number, (text, rest, shows)) in [
        // A step of the axis is less than the distance of two numbers.
        (
            centuries,
            "&periods=1&from=8e18&to=8000000000000004096",
            "1 of 1</b> DAGs",
        ),
        (
            "yes '' | head -c 9000000",
            "",
            "The address holds no DAG file that can be read",
        ),
        ("yes | head -n 150000", "", "line 1: expected `set`"),
        (many, "&periods=1", "The graph is too large"),
    ]
    .into_iter()
    .enumerate()
    {
        let hash = format!("sync&dag={}{rest}", deflated(text));
        assert_shown(
            &opened(&folder(&format!("address-{number}")), &[], &hash),
            &[shows],
        );
    }
}
