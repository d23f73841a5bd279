//! A camera asking an accelerator, recorded on the machine and on Linux: every replay has the same
//! values, without the accelerator.

use std::fs;
use std::sync::atomic::Ordering::Relaxed;

use camera::{Conduct, Detection, build};
use fass::finish_create_dags;
use harness::file::File;
use virtual_time::VirtualTime;

const FRAMES: u64 = 20;

/// Runs the camera with words. Returns the numbers of answered and of late frames, and the number
/// of compared values.
fn run(words: &str, app: &str) -> ([u64; 2], Option<u64>) {
    // However long the host lets an instance wait, it is within its budget.
    let own = format!("budget_factor=0 {app}");
    let words = format!("--jobs {FRAMES} {words} --append");
    let words = words.split_whitespace().chain([own.trim_end()]);
    let words: Vec<&str> = words.collect();
    let transcript = harness::run("camera", &words);
    let number = |kind, name| transcript.of_kind(kind).next()?.number_at(name);
    assert_eq!(number("camera", "allocations"), Some(0));
    assert!(matches!(number("replayed", "uncompared"), None | Some(0)));
    let frames = ["answered", "late"].map(|name| number("camera", name).expect("the app's line"));
    (frames, number("replayed", "compared"))
}

#[test]
fn answers_that_the_machine_or_linux_recorded_are_replayed_on_both_and_on_the_host() {
    for place in ["--cores 2", "--on linux --cores 1"] {
        let file = File::new("camera", "rec");
        let name = file.0.display();
        let (frames, _) = run(&format!("{place} --keep {name}"), "");
        assert_eq!(frames.iter().sum::<u64>(), FRAMES);
        // Another seed, or one that is silent: the accelerator would do something else.
        for place in ["--cores 1 --seed 2", "--cores 4", "--on linux --cores 2"] {
            let replayed = run(&format!("{place} --replay {name}"), "accelerator=silent");
            assert_eq!(replayed, (frames, Some(FRAMES)), "{place}");
        }
        let bytes = fs::read(&file.0).expect("the recording");
        let machine = VirtualTime::new().replay(&bytes).expect("it is whole");
        let (dags, counts) = build(FRAMES, 1, Conduct::Silent, Detection::Asks);
        finish_create_dags(&dags).expect("they are the DAGs that were recorded");
        let report = machine.run();
        assert_eq!((report.compared, report.divergence), (FRAMES, None));
        let counts = [&counts.answered, &counts.late].map(|count| count.load(Relaxed));
        assert_eq!(counts, frames);
    }
}
