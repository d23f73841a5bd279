//! Boots a guest inside a test.
//!
//! A boot test states the image, the number of cores, and words on the guest's command line, and
//! then judges the [`Outcome`]:
//!
//! ```no_run
//! use harness::Guest;
//!
//! let outcome = Guest::new("fork-join").cores(4).word("jobs=20").succeed();
//! assert_eq!(outcome.transcript.of_kind("fork_join").count(), 3);
//! ```
//!
//! Any failure ends in a panic showing the end of the serial log and the path of the whole log. A
//! good run's log is removed.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use tool::image;
use tool::install;
use tool::outcome::{Outcome, boot_with_input};
use tool::qemu::{Loader, Machine, Mode, Network, Qemu, SecondPort};
use tool::{system, wire_script};
use views::protocol::Status;

use crate::Said;
use crate::altered::altered;
use crate::file::File;

/// The most wall time of a guest unless the test states another. It is many times the usual time:
/// it ends a hanging guest, but no guest slowed by a busy host.
const LIMIT: Duration = Duration::from_secs(600);

/// A guest, described and booted by a test.
#[derive(Clone, Debug, Default)]
#[must_use = "a guest does nothing until it boots"]
pub struct Guest {
    package: String,
    /// A file to boot instead of the package's image.
    image: Option<PathBuf>,
    qemu: Qemu,
    /// The program in place of QEMU, if there is another.
    altered: Option<Arc<File>>,
    words: Vec<String>,
    limit: Duration,
    /// Pairs of a text in the guest's output and the words to type at the console after a line with
    /// this text.
    conversation: Vec<(String, String)>,
}

impl Guest {
    /// Describes a guest booting the image of a package: one core, 32 MiB, a microvm,
    /// deterministic, 600 s.
    pub fn new(package: &str) -> Guest {
        Guest {
            package: package.into(),
            limit: LIMIT,
            ..Guest::default()
        }
    }

    /// Describes a guest running a test of `tests/guest`.
    pub fn test(name: &str) -> Guest {
        Guest::new("guest-tests").word(&format!("test={name}"))
    }

    /// Sets the number of processors.
    pub fn cores(mut self, cores: u64) -> Guest {
        self.qemu.cores = cores;
        self
    }

    /// Sets the memory, in MiB.
    pub fn memory_mib(mut self, memory_mib: u64) -> Guest {
        self.qemu.memory_mib = memory_mib;
        self
    }

    /// Sets the meaning of time in the guest.
    pub fn mode(mut self, mode: Mode) -> Guest {
        self.qemu.mode = mode;
        self
    }

    /// Runs on emulated processors in real time, where a busy host may hold any of them back at any
    /// moment. So no budget is derived from a WCET, and the test may judge by order and by counts
    /// alone.
    pub fn in_real_time(self) -> Guest {
        self.mode(Mode::Threads).word("budget_factor=0")
    }

    /// Sets the board.
    pub fn machine(mut self, machine: Machine) -> Guest {
        self.qemu.machine = machine;
        self
    }

    /// Boots like a PC from a stick, by a loader; the words and the module are on the stick. The
    /// guest is a q35 in real time: otherwise its firmware would take long.
    pub fn from_stick(self, loader: Loader) -> Guest {
        let mut guest = self.in_real_time().machine(Machine::Q35);
        guest.qemu.loader = loader;
        guest.memory_mib(loader.least_memory_mib().max(32))
    }

    /// Adds words to the guest's command line, such as `jobs=20` or `jobs=20 seed=7`.
    pub fn word(mut self, word: &str) -> Guest {
        self.words.push(word.into());
        self
    }

    /// Boots a file without building it first. The package gives only its name.
    pub fn image(mut self, file: &Path) -> Guest {
        self.image = Some(file.into());
        self
    }

    /// Boots by a QEMU with altered words: `changes` has pairs of our word's place and the other
    /// word, and `more` is added.
    pub fn altered(mut self, changes: &[(&str, &str)], more: &str) -> Guest {
        let program = altered(changes, more);
        self.qemu.program.clone_from(&program.0);
        self.altered = Some(Arc::new(program));
        self
    }

    /// Boots on a processor of a QEMU model, with or without some features: `max,-nx`.
    pub fn model(self, model: &str) -> Guest {
        self.altered(&[("#max", model)], "")
    }

    /// Puts a network card of a kind into the guest, and its network by QEMU's words. The guest is
    /// a q35.
    pub fn network(mut self, card: &'static str, words: &str) -> Guest {
        self.qemu.network = Some(Network {
            words: words.into(),
            card,
            traffic: None,
        });
        self.machine(Machine::Q35)
    }

    /// Leaves a file in the guest's memory.
    pub fn module(mut self, file: &Path) -> Guest {
        self.qemu.module = Some(file.into());
        self
    }

    /// Lets bytes arrive on the app's wire, given as in a file of `run --input`.
    ///
    /// # Panics
    ///
    /// Panics if the text is wrong, or its file cannot be written.
    pub fn input(self, text: &str) -> Guest {
        let entries = wire_script::read(text).unwrap_or_else(|why| panic!("the input:{why}"));
        let script = wire_script::for_guest(&entries);
        let file = system::new_log("input").expect("a folder for logs");
        fs::write(&file, &script).expect("a file in it");
        self.module(&file).word(&format!("input={}", script.len()))
    }

    /// Boots the guest, which must succeed. Returns the bytes sent on its wire, too, and removes
    /// the file of its input.
    ///
    /// # Panics
    ///
    /// As [`succeed`](Self::succeed).
    #[must_use]
    pub fn succeed_sending(mut self) -> (Outcome, Vec<u8>) {
        let file = system::new_log("output").expect("a folder for logs");
        self.qemu.second = Some(SecondPort {
            is_live: false,
            output: Some(file.clone()),
        });
        let outcome = self.succeed();
        let sent = fs::read(&file).expect("QEMU writes it");
        for file in self.qemu.module.iter().chain([&file]) {
            let _ = fs::remove_file(file);
        }
        (outcome, sent)
    }

    /// Writes the guest's recording to a file, from a buffer of `kib` KiB.
    pub fn records(mut self, file: &Path, kib: u64) -> Guest {
        self.qemu.records = Some(file.into());
        self.word(&format!("keep={kib}"))
    }

    /// Makes the guest replay a recording.
    ///
    /// # Panics
    ///
    /// If there is no such file.
    pub fn replays(self, file: &Path) -> Guest {
        let bytes = fs::metadata(file).expect("the recording").len();
        self.module(file).word(&format!("replay={bytes}"))
    }

    /// Gives the guest a console. Each pair is a text to wait for, in any line after the words
    /// typed before, and the words to type then.
    pub fn conversation(self, conversation: &[(&str, &str)]) -> Guest {
        self.typing(conversation).word("console=on")
    }

    /// Types like [`conversation`](Self::conversation), but without a console: the words go to the
    /// app.
    pub fn typing(mut self, conversation: &[(&str, &str)]) -> Guest {
        let owned = |&(text, answer): &(&str, &str)| (text.into(), answer.into());
        self.conversation = conversation.iter().map(owned).collect();
        self.qemu.has_input = true;
        self
    }

    /// Sets the most wall time of the guest.
    pub fn limit(mut self, limit: Duration) -> Guest {
        self.limit = limit;
        self
    }

    /// Builds the image if need be, boots the guest and waits for its end, good or bad.
    ///
    /// # Panics
    ///
    /// Panics if QEMU or the image is missing and cannot be had.
    #[must_use]
    pub fn boot(&self) -> Outcome {
        let pipe = Mutex::new(None);
        let mut left = self.conversation.iter().peekable();
        self.boot_hearing(&pipe, |line| {
            let answers = |(text, _): &&(String, String)| line.contains(text);
            if let Some((_, answer)) = left.next_if(answers) {
                say(&pipe, &format!("{answer}\n"));
            }
        })
    }

    /// Boots the guest, which must succeed, next to a peer receiving the guest's lines. When the
    /// peer has returned, ctrl-C ends the guest.
    ///
    /// # Panics
    ///
    /// As [`succeed`](Self::succeed), and if the peer panics.
    pub fn succeed_beside<T: Send>(
        self,
        peer: impl FnOnce(&Receiver<String>) -> T + Send,
    ) -> (Outcome, T) {
        let mut guest = self.word("console=stop");
        guest.qemu.has_input = true;
        // The peer does not wait for a compiler.
        let _ = built(&guest.package);
        let pipe = Mutex::new(None);
        let (tell, lines) = mpsc::channel();
        thread::scope(|scope| {
            let peer = scope.spawn(move || peer(&lines));
            let pipe = &pipe;
            let peer = scope.spawn(move || {
                let found = peer.join();
                say(pipe, "\x03");
                found
            });
            let outcome = guest.boot_hearing(pipe, |line| drop(tell.send(line.into())));
            drop(tell);
            let found = peer.join().flatten();
            let found = found.unwrap_or_else(|why| {
                eprintln!("{}", outcome.tail());
                panic::resume_unwind(why)
            });
            (judged(outcome), found)
        })
    }

    fn boot_hearing(&self, pipe: &Mutex<Option<ChildStdin>>, hear: impl FnMut(&str)) -> Outcome {
        let run = || {
            let image = match &self.image {
                Some(file) => install::ensure_qemu().map(|()| file.clone())?,
                None => built(&self.package)?,
            };
            install::ensure_loader(self.qemu.loader)?;
            let log = system::new_log(&self.package)?;
            let mut qemu = self.qemu.clone();
            let mode = format!("mode={}", qemu.mode);
            let words = std::iter::once(&mode).chain(&self.words);
            qemu.guest_words = words.cloned().collect::<Vec<_>>().join(" ");
            let connect = |input| *pipe.lock().expect("nobody panics with it") = input;
            boot_with_input(&qemu, &image, &log, self.limit, connect, hear)
        };
        run().unwrap_or_else(|error: String| panic!("`{}` did not boot: {error}", self.package))
    }

    /// Boots the guest, which must succeed.
    ///
    /// # Panics
    ///
    /// Panics with the serial log's end if the guest fails.
    #[must_use]
    pub fn succeed(&self) -> Outcome {
        judged(self.boot())
    }

    /// Boots the guest, which must end with a status in both its verdict and its exit status.
    ///
    /// # Panics
    ///
    /// Panics with the serial log's end if the guest ends otherwise.
    #[must_use]
    pub fn end_in(&self, status: Status) -> Outcome {
        let outcome = self.boot();
        let verdict = outcome.transcript.verdict().map(|verdict| verdict.status);
        let exit = &outcome.ending;
        if *exit != tool::qemu::RunEnd::Guest(status) || verdict != Ok(status) {
            let tail = outcome.tail();
            panic!("wanted the end {status:?}, got: {exit}; verdict {verdict:?}\n{tail}");
        }
        let _ = fs::remove_file(&outcome.log);
        outcome
    }

    /// Boots the guest, which must refuse its words or its file, and returns the reason.
    ///
    /// # Panics
    ///
    /// As [`end_in`](Self::end_in).
    #[must_use]
    pub fn refusal(&self) -> String {
        self.end_in(Status::Usage).reason()
    }
}

/// Types words to a guest. If the guest is gone, its outcome tells.
fn say(pipe: &Mutex<Option<ChildStdin>>, words: &str) {
    if let Some(pipe) = pipe.lock().expect("nobody panics with it").as_mut() {
        let _ = pipe.write_all(words.as_bytes());
    }
}

/// Judges an outcome, which must be a success, removes its log, and returns the outcome.
#[track_caller]
fn judged(outcome: Outcome) -> Outcome {
    if let Err(fault) = outcome.judge() {
        panic!("{}\n{}", fault.reason, outcome.tail());
    }
    let _ = fs::remove_file(&outcome.log);
    outcome
}

/// Returns a package's image, built once in the life of a test binary.
pub(crate) fn built(package: &str) -> Result<PathBuf, String> {
    static BUILT: Mutex<BTreeMap<String, PathBuf>> = Mutex::new(BTreeMap::new());
    // The map is whole at every moment, so a panic elsewhere does not harm it.
    let mut built = BUILT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(image) = built.get(package) {
        return Ok(image.clone());
    }
    install::ensure_qemu()?;
    let image = image::build(package)?;
    built.insert(package.into(), image.clone());
    Ok(image)
}
