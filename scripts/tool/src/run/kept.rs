//! Keeps the files of a boot: its record, views of the record, and its serial log.
//!
//! The record arrives while the guest runs. At the end, the guest's machine lines complete the
//! record, and the tool writes it to the files named by the options.
//!
//! Even without such an option a guest sends the inputs of its last jobs before a fault. They are
//! written to a file next to the log.
//!
//! A log named by the person stays. If the guest refuses its command line, nothing has run, and the
//! file gets its previous content back.

use std::fs;
use std::path::{Path, PathBuf};

use recording::{Chunk, Header, Recording, Writer};

use super::page::PageServer;
use super::screen::RunDisplay;
use super::{EndedRun, handed};
use crate::files::{self, TemporaryFile};
use crate::options::{CommandLine, OptionName, Refusal};
use crate::outcome::Outcome;
use crate::page::{self, PageContent};
use crate::qemu::RunEnd;
use crate::recordings;
use crate::run_options::name;
use crate::system;
use views::protocol::Status;
use views::record::Record;

/// The kinds of lines left out of the record: lines about progress, and lines carrying the record
/// itself.
const PASSING: [&str; 3] = ["progress", "record", "status"];

/// The options naming a file for the record.
const FILES: [OptionName; 2] = [name::KEEP, name::TRACE];

/// The guest's buffer in KiB for values still waiting for the background to send them.
const ROOM_KIB: &str = "1024";

/// The files kept of a boot.
pub(super) struct KeptFiles {
    /// The file for the bytes as they arrive.
    raw: TemporaryFile,
    app: String,
    /// The guest's word for the wanted kind of record; `None` if no record is wanted.
    word: Option<&'static str>,
    /// The server of the page, if one is wanted.
    server: Option<&'static PageServer>,
}

/// Returns the guest's word for the kind of record wanted by the options.
pub(super) fn word(options: &CommandLine) -> Option<&'static str> {
    // A full record has the events, too, so it prevails over the views.
    match options.given_of(&[name::KEEP, name::PAGE]) {
        Some(_) => Some("keep"),
        None => options
            .given_of(&[name::TRACE, name::PROVE])
            .map(|_| "events"),
    }
}

impl KeptFiles {
    pub(super) fn new(options: &CommandLine, app: &str) -> Result<Self, String> {
        let path = system::new_log(app)?.with_extension("sent");
        let server = options.is_given(name::PAGE).then(|| {
            let page = page::html(&PageContent::default(), true)?;
            PageServer::start(page, &path)
        });
        Ok(Self {
            server: server.transpose()?,
            raw: TemporaryFile(Some(path)),
            app: app.into(),
            word: word(options),
        })
    }

    /// Returns the file for the bytes sent by the guest.
    pub(super) fn raw(&self) -> Option<PathBuf> {
        self.raw.0.clone()
    }

    /// Says where to read the record while the run goes on.
    pub(super) fn introduce(&self, screen: &RunDisplay) {
        if let Some(server) = &self.server {
            // Not by the screen, which `--quiet` silences: without the address the page is of no
            // use.
            eprintln!("page: http://127.0.0.1:{}/", server.port);
        } else if let (Some(_), Some(raw)) = (self.word, &self.raw.0) {
            let (show, raw) = (system::script("recording"), files::shown_path(raw));
            screen.say(&format!(
                "record: until the end of the run `{show} {raw}` shows what came so far\n"
            ));
        }
    }

    /// Returns the guest's word and the file, for Linux programs, which write the file themselves.
    pub(super) fn word_with_file(&self) -> Option<(&'static str, PathBuf)> {
        self.word.zip(self.raw())
    }

    /// Returns the guest's word after a blank, with the size of its buffer; empty without a word.
    pub(super) fn guest_word(&self) -> String {
        match self.word {
            Some("events") => " events=on".into(),
            Some(word) => format!(" {word}={ROOM_KIB}"),
            None => String::new(),
        }
    }

    /// Reads the bytes sent by the guest into `outcome`, from the file or else from the log.
    pub(super) fn receive(&self, outcome: &mut Outcome) -> Result<(), String> {
        // A boot that failed before the guest started leaves no file.
        let sent = self.raw.0.as_deref().map(recordings::received);
        outcome.sent = sent.and_then(Result::ok).unwrap_or_default();
        // Without the port for records the bytes come as text in lines of kind `record`.
        if outcome.sent.is_empty() {
            outcome.sent = views::record::bytes_of_log(&outcome.serial)?;
        }
        Ok(())
    }

    /// Writes the record to the files named by the options. Returns lines announcing the files.
    pub(super) fn write(
        &self,
        options: &CommandLine,
        outcome: &Outcome,
    ) -> Result<Vec<String>, String> {
        // A refused command line: nothing has run, and an older file must stay as it is.
        if outcome.ending == RunEnd::Guest(Status::Usage) {
            return Ok(Vec::new());
        }
        // Bytes that nobody asked for come from a crash.
        if self.word.is_none() {
            return self.write_crash(&outcome.sent);
        }
        let wanted = FILES.into_iter();
        let wanted = wanted.filter_map(|name| Some((name, options.path(name)?)));
        let wanted: Vec<_> = wanted.collect();
        if wanted.is_empty() {
            return Ok(Vec::new());
        }
        let bytes = self.completed(outcome);
        let how = match outcome.transcript.verdict().is_ok() {
            true => "",
            false => "until it died, ",
        };
        let part = self.part(&bytes);
        // A file of DAGs takes no replay, and an app whose topics are not recorded refuses one.
        let values = Recording::read(&bytes).is_ok_and(|of| of.count() > 0 && of.lost() == 0);
        let is_replayed = values && !options.is_given(name::DAG);
        let [check, trace, show] = ["check-trace", "trace", "recording"].map(system::script);
        let announce = |(name, path): (OptionName, &Path)| {
            files::write_named(name.as_str(), path, &bytes)?;
            let file = files::shown_path(path);
            let shown = format!("`{show} {file}` shows what is recorded");
            let uses = match is_replayed {
                true => format!(
                    "{shown}, and `--replay {file}` repeats it{}",
                    but_for(&bytes)
                ),
                false => format!("and {shown}"),
            };
            Ok(format!(
                "{file}: {part}, {how}{} bytes; `{check} {file}` judges it, \
                 `{trace} {file} -o {file}.json` draws it, {uses}",
                bytes.len()
            ))
        };
        let announced: Result<Vec<_>, String> = wanted.into_iter().map(announce).collect();
        let announced = announced?;
        let is_torn = Recording::read(&outcome.sent).is_err() && !outcome.sent.is_empty();
        if is_torn && outcome.judge().is_ok() {
            let raw = self.raw().unwrap_or_default();
            let why = files::why_full(&raw);
            let why = why.unwrap_or("it has no end, although the run has".into());
            let raw = files::shown_path(&raw);
            return Err(format!(
                "{}\nwhat came of the record was not written whole to {raw}: {why}; make room, and \
                 run it again",
                announced.join("\n")
            ));
        }
        Ok(announced)
    }

    /// Says which part of the run is in the record.
    fn part(&self, bytes: &[u8]) -> String {
        let what = match self.word {
            _ if Recording::read(bytes).is_ok_and(|of| of.is_cut()) => "a part of the run",
            Some("events") => "the events of the run",
            _ => "all of the run",
        };
        // The journal of a long run has its latest events only.
        let runs = Record::read(bytes).map_or(Vec::new(), |record| record.runs);
        match runs.iter().map(|run| run.lost).sum::<u64>() {
            0 => what.into(),
            lost => format!("{what} but {lost} events, which are lost"),
        }
    }

    /// Returns the record with a header, completed by the guest's machine lines.
    fn completed(&self, outcome: &Outcome) -> Vec<u8> {
        let sent = match Recording::read(&outcome.sent) {
            Ok(_) => outcome.sent.clone(),
            // The guest died while sending: the whole chunks before the break are kept.
            Err(_) => recording::mended(&outcome.sent).unwrap_or_default(),
        };
        let recording = Recording::read(&sent).ok();
        let mut header = recording
            .as_ref()
            .map_or(Header::default(), |of| of.header().clone());
        if header.app.is_empty() {
            header.app.clone_from(&self.app);
        }
        let mut record = Writer::new(&header);
        for chunk in recording.iter().flat_map(Recording::chunks) {
            match chunk {
                // The new header is written already.
                Chunk::Header(_) => {}
                Chunk::Entry(entry) => record.write(&entry),
                Chunk::Text(text) => record.text(text),
                Chunk::Commit(commit) => record.commit(&commit),
                Chunk::Events(events) => {
                    let words: Vec<_> = events.words().collect();
                    record.events(events.cluster, events.before, &words);
                }
                Chunk::Times(times) => record.times(&times),
            }
        }
        let lines = outcome.transcript.machine.iter();
        let lasting = lines.filter(|line| !PASSING.contains(&line.kind.as_str()));
        let lines: String = lasting.map(|line| line.text.clone() + "\n").collect();
        record.text(&lines);
        let is_whole = outcome.transcript.verdict().is_ok();
        // A reader must be able to distinguish a finished run from a truncated run.
        match is_whole && !recording.is_some_and(|recording| recording.is_cut()) {
            true => record.end(),
            false => record.cut(),
        }
    }

    fn write_crash(&self, bytes: &[u8]) -> Result<Vec<String>, String> {
        // Bytes that are no recording are noise on the port, and not worth a file.
        let (Ok(_), Some(raw)) = (Recording::read(bytes), &self.raw.0) else {
            return Ok(Vec::new());
        };
        let path = raw.with_extension("rec");
        let file = files::shown_path(&path);
        fs::write(&path, bytes).map_err(|error| format!("{file}: cannot be written: {error}"))?;
        let shown = self.replay_package().map_or(String::new(), |package| {
            format!(
                ", and `cargo run --profile linux{package} --example replay -- {file}` shows the job \
                 that crashed"
            )
        });
        Ok(vec![format!(
            "{file}: the inputs of the last jobs before the fault; `{} {file}` lists them{shown}",
            system::script("recording")
        )])
    }

    /// Returns cargo's argument for the package with the app's own replay program; `None` without
    /// such a program.
    fn replay_package(&self) -> Option<String> {
        const EXAMPLE: &str = "examples/replay.rs";
        let app = &self.app;
        let is_ours = (system::workspace().join("apps").join(app).join(EXAMPLE)).is_file();
        let in_its_own = || Path::new(EXAMPLE).is_file().then(String::new);
        is_ours.then(|| format!(" -p {app}")).or_else(in_its_own)
    }
}

/// Names the DAGs of a record that a replay must compute anew, if there are any.
fn but_for(bytes: &[u8]) -> String {
    let Ok(recording) = Recording::read(bytes) else {
        return String::new();
    };
    let header = recording.header();
    let has_values = |name: &str| {
        let mut channels = header.channels.iter();
        channels.any(|channel| header.dags[usize::from(channel.dag)].name == name)
    };
    let commit = recording.chunks().find_map(|chunk| match chunk {
        Chunk::Commit(commit) => Some(commit),
        _ => None,
    });
    let dags = commit.map_or(Vec::new(), |commit| commit.dags);
    let names = dags.iter().map(|dag| &*dag.name);
    match names.filter(|name| !has_values(name)).collect::<Vec<_>>()[..] {
        [] => String::new(),
        ref names => format!(
            ", but for dag `{}`: of it nothing is recorded, what it receives and its requests (of \
             modes and pauses) included; record its sources' topics by `Dag::record`",
            names.join("`, `")
        ),
    }
}

/// Writes and announces the files wanted of a run, and serves the record to its page. Only after a
/// good run, warns of a wire that was never used.
pub(super) fn write(
    options: &CommandLine,
    kept: &KeptFiles,
    mut outcome: Outcome,
    log: SerialLog,
    screen: RunDisplay,
) -> Result<EndedRun, Refusal> {
    kept.receive(&mut outcome)?;
    for line in kept.write(options, &outcome)? {
        screen.say(&line);
    }
    if outcome.judge().is_ok()
        && let Some(warning) = handed::warning(options, &outcome)
    {
        screen.say(&warning);
    }
    if let Some(server) = &kept.server
        && !server.finish(kept.completed(&outcome))
    {
        let page = system::script("page");
        screen.say(&format!(
            "page: nobody has opened it; `--keep X`, then `{page} X` shows a run"
        ));
    }
    Ok(EndedRun {
        outcome,
        log,
        screen,
    })
}

/// The serial log of a run.
pub(super) struct SerialLog {
    pub(super) path: PathBuf,
    /// Whether the person has named the log.
    stays: bool,
    /// The content of the file before the run.
    before: Option<Vec<u8>>,
}

/// Makes sure that the named log can be read back while the guest writes it.
pub(super) fn check(options: &CommandLine) -> Result<(), String> {
    let is_other = |path: &&Path| fs::metadata(path).is_ok_and(|data| !data.is_file());
    options
        .path(name::SERIAL)
        .filter(is_other)
        .map_or(Ok(()), |path| {
            let place = files::shown_path(path);
            Err(format!(
                "`--serial {place}`: it is a device or a pipe, and the log is read while it is \
             written; name a file"
            ))
        })
}

impl SerialLog {
    /// Chooses the log's path. The file is made when the guest starts.
    pub(super) fn choose(options: &CommandLine, app: &str) -> Result<SerialLog, String> {
        let named = options.path(name::SERIAL).map(Path::to_path_buf);
        let stays = named.is_some();
        let path = named.map_or_else(|| system::new_log(app), Ok)?;
        Ok(SerialLog {
            before: fs::read(&path).ok(),
            path,
            stays,
        })
    }

    /// Removes the log, unless the person has named it.
    pub(super) fn discard(&self) {
        if !self.stays {
            // The log is ours; a leftover log harms nothing.
            let _ = fs::remove_file(&self.path);
        }
    }

    /// Gives the file its previous content back, since nothing has run.
    pub(super) fn restore(&self) {
        // An error is ignored: the message about the refusal matters more.
        let _ = match &self.before {
            Some(before) => fs::write(&self.path, before),
            None => fs::remove_file(&self.path),
        };
    }
}
