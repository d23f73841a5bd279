//! Child processes with a time limit. The tool waits for a child, watches its output, and kills it
//! by process id at the limit or when the [`Child`] is dropped. A child that can end in order is
//! asked to do so first.
//!
//! The request comes at the child's limit, or when a *signal* such as ctrl-C asks the tool to end.
//! After its limit a child may run on as long as it prints, and then for 10 s of silence; the next
//! signal kills it at once. A child without any output is not listening yet, so the request waits
//! for the first byte. The output goes to a file, and each line of the file is shown once, when the
//! line is complete.
//!
//! Where the program `setpriv` exists, the system kills the child even if the tool itself is
//! killed, so nothing is left behind in any case.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{self, ChildStdin, ChildStdout, Command, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

use end_signals::EndSignals;

use crate::system;
use views::protocol::written;

/// The time between two looks at the process.
const PAUSE: Duration = Duration::from_millis(10);

/// A started child process.
#[derive(Debug)]
pub struct Child {
    process: process::Child,
    started: Instant,
}

/// Why the wait for a child ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaitEnd {
    /// The child ended by itself.
    Ended(ExitStatus),
    /// The time limit passed, and the child was killed.
    TimedOut,
    /// The watcher gave up and the child was killed, or the system no longer knows the child.
    GivenUp,
    /// A person pressed ctrl-C after the request to end, and the child was killed.
    Killed,
}

/// How a followed child ended, and its output.
pub struct ChildResult {
    /// Why the wait ended.
    pub waited: WaitEnd,
    /// The reason for asking the child to end early, if anybody asked.
    pub asked: Option<StopReason>,
    /// The whole output; invalid UTF-8 is replaced.
    pub text: String,
}

impl Child {
    /// Starts a program with the arguments and the streams of `command`.
    ///
    /// # Errors
    ///
    /// The program could not be started.
    pub fn start(command: &mut Command) -> io::Result<Child> {
        let process = command.spawn()?;
        let started = Instant::now();
        Ok(Child { process, started })
    }

    /// Waits for the end of the child, for at most `limit` since its start. Calls `watch` at each
    /// look, and kills the child when `watch` returns `false`.
    pub fn wait(&mut self, limit: Duration, mut watch: impl FnMut() -> bool) -> WaitEnd {
        loop {
            match self.process.try_wait() {
                Ok(Some(status)) => return WaitEnd::Ended(status),
                Ok(None) => {}
                // The process is no longer a child of ours, so there is nothing left to kill.
                Err(_) => return WaitEnd::GivenUp,
            }
            if self.started.elapsed() >= limit {
                self.kill();
                return WaitEnd::TimedOut;
            }
            if !watch() {
                self.kill();
                return WaitEnd::GivenUp;
            }
            thread::sleep(PAUSE);
        }
    }

    /// Works like [`wait`](Self::wait), and passes each complete line of the child's output, read
    /// from `log`, to `show` as soon as the line is there. `sent` gets the number of bytes in the
    /// log. It returns how many bytes the child has sent elsewhere, which counts as progress, or
    /// `None` to give the child up. `stop`, if given, asks the child to end in order before the
    /// kill. Such a child may outlive `limit`, as the module describes.
    ///
    /// # Errors
    ///
    /// In words: the log cannot be read.
    pub fn follow(
        &mut self,
        limit: Duration,
        log: &Path,
        show: &mut dyn FnMut(&str),
        mut stop: Option<&mut dyn FnMut(StopReason)>,
        mut sent: impl FnMut(u64) -> Option<u64>,
    ) -> Result<ChildResult, String> {
        let (mut tail, mut asking) = (FollowedFile::new(log), ChildWatch::new(limit));
        let signals = stop.as_ref().map(|_| EndSignals::catch());
        let (started, mut killed) = (self.started, WaitEnd::GivenUp);
        // A child that can be asked to end may outlive its limit; `ChildWatch` decides when to kill
        // the child.
        let of_wait = signals.as_ref().map_or(limit, |_| Duration::MAX);
        let waited = self.wait(of_wait, || {
            // The log may not exist yet, and a lasting error shows in `finish` below.
            let _ = tail.follow(show);
            let printed_bytes = tail.bytes();
            let Some(sent_bytes) = sent(printed_bytes) else {
                return false;
            };
            let (Some(ask), Some(signals)) = (&mut stop, &signals) else {
                return true;
            };
            match asking.step(
                started.elapsed(),
                signals.count(),
                printed_bytes + sent_bytes,
            ) {
                Step::Wait => return true,
                Step::Ask(why) => {
                    if why == StopReason::ByPerson {
                        eprintln!("ending in order; ctrl-C again ends it at once");
                    }
                    ask(why);
                    return true;
                }
                Step::Kill => killed = WaitEnd::Killed,
                Step::TimeOut => killed = WaitEnd::TimedOut,
            }
            false
        });
        let text = tail.finish(show);
        Ok(ChildResult {
            // `wait` knows only that the watcher gave up; `killed` says why it did.
            waited: if waited == WaitEnd::GivenUp {
                killed
            } else {
                waited
            },
            asked: asking.why(),
            text: text.map_err(|why| format!("cannot read the log `{}`: {why}", log.display()))?,
        })
    }

    /// Returns the child's process id.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Returns a second handle of the child's standard input, if the input is a pipe and was not
    /// taken.
    pub fn second_input(&self) -> Option<File> {
        let input = self.process.stdin.as_ref()?;
        let other = input.as_fd().try_clone_to_owned();
        other.ok().map(File::from)
    }

    /// Takes the child's standard input, if the input is a pipe and was not taken.
    pub fn input(&mut self) -> Option<ChildStdin> {
        self.process.stdin.take()
    }

    /// Takes the child's standard output, if the output is a pipe and was not taken.
    pub fn output(&mut self) -> Option<ChildStdout> {
        self.process.stdout.take()
    }

    /// Returns the time since the start.
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    fn kill(&mut self) {
        // The child may have ended by itself in between; then there is nothing to kill.
        let _ = self.process.kill();
        // Reaps the process, so no zombie is left.
        let _ = self.process.wait();
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Returns a command for `program` bound to the calling thread: the system kills the program when
/// the thread dies, if `setpriv` is there to ask for that. `setpriv` executes the program in its
/// own place, so the process id stays the same.
pub fn bound_to_us(program: &Path) -> Command {
    if system::find_program("setpriv").is_none() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL", "--"]).arg(program);
    command
}

/// The longest silence of a child that runs on beyond its limit. Output and the request to end
/// begin the silence anew.
const GRACE: Duration = Duration::from_secs(10);

/// Why a child was asked to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// A person pressed ctrl-C, or this program was asked to end.
    ByPerson,
    /// The child took longer than this limit.
    ByLimit(Duration),
}

/// The next step after a look at the child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Look again.
    Wait,
    /// Ask the child to end.
    Ask(StopReason),
    /// Kill the child, since a person pressed ctrl-C after the request.
    Kill,
    /// Kill the child, since its time is over.
    TimeOut,
}

/// The state of a child as seen so far.
#[derive(Default)]
struct ChildWatch {
    limit: Duration,
    /// The reason, and the number of signals at that time.
    why: Option<(StopReason, u32)>,
    is_asked: bool,
    printed_bytes: u64,
    quiet_since: Duration,
}

impl ChildWatch {
    /// Makes the state at the child's start.
    fn new(limit: Duration) -> ChildWatch {
        ChildWatch {
            limit,
            ..ChildWatch::default()
        }
    }

    /// Returns the reason for asking the child to end, if anybody asked.
    fn why(&self) -> Option<StopReason> {
        self.why.map(|(why, _)| why)
    }

    /// Decides the next step from the time, the signals and the bytes printed since the start.
    fn step(&mut self, elapsed: Duration, signals: u32, printed_bytes: u64) -> Step {
        let is_over = elapsed >= self.limit;
        if printed_bytes > self.printed_bytes {
            self.printed_bytes = printed_bytes;
            self.quiet_since = elapsed;
        }
        match self.why {
            // Only signals after the request count: several signals at the first look are one wish.
            Some((_, before)) if signals > before => return Step::Kill,
            None if signals > 0 => self.why = Some((StopReason::ByPerson, signals)),
            None if is_over => self.why = Some((StopReason::ByLimit(self.limit), signals)),
            _ => {}
        }
        match self.why {
            // A child that has printed nothing is not listening; the request waits for its first
            // byte.
            Some((why, _)) if !self.is_asked && printed_bytes > 0 => {
                self.is_asked = true;
                // The grace begins at the request, however long the child was silent before.
                self.quiet_since = elapsed;
                Step::Ask(why)
            }
            _ if is_over && elapsed.saturating_sub(self.quiet_since) >= GRACE => Step::TimeOut,
            _ => Step::Wait,
        }
    }
}

/// A file read while another process writes it.
struct FollowedFile<'p> {
    path: &'p Path,
    /// The bytes read so far; the first `shown` of them have been shown.
    read: Vec<u8>,
    shown: usize,
}

impl FollowedFile<'_> {
    /// Makes a reader at the start of the file, which need not exist yet.
    fn new(path: &Path) -> FollowedFile<'_> {
        FollowedFile {
            path,
            read: Vec::new(),
            shown: 0,
        }
    }

    /// Returns the number of bytes read so far.
    fn bytes(&self) -> u64 {
        self.read.len() as u64
    }

    /// Shows the lines completed since the last call.
    fn follow(&mut self, show: &mut dyn FnMut(&str)) -> io::Result<()> {
        let mut file = File::open(self.path)?;
        file.seek(SeekFrom::Start(self.bytes()))?;
        file.read_to_end(&mut self.read)?;
        while let Some(length) = self.read[self.shown..]
            .iter()
            .position(|byte| *byte == b'\n')
        {
            // Whole lines only, so a character that was read in halves is never shown broken.
            let line = &self.read[self.shown..self.shown + length];
            show(written(&String::from_utf8_lossy(line)));
            self.shown += length + 1;
        }
        Ok(())
    }

    /// Shows the remaining lines, including an incomplete last line, and returns the whole text.
    fn finish(mut self, show: &mut dyn FnMut(&str)) -> io::Result<String> {
        self.follow(show)?;
        if self.shown < self.read.len() {
            show(&String::from_utf8_lossy(&self.read[self.shown..]));
        }
        Ok(String::from_utf8_lossy(&self.read).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn wait(words: &[&str], limit: Duration, watch: impl FnMut() -> bool) -> WaitEnd {
        let mut command = bound_to_us(Path::new(words[0]));
        let mut child = Child::start(command.args(&words[1..])).expect(words[0]);
        child.wait(limit, watch)
    }

    #[test]
    fn a_child_ends_is_killed_or_is_given_up() {
        let long = Duration::from_secs(60);
        let ended = wait(&["sh", "-c", "exit 7"], long, || true);
        assert!(matches!(ended, WaitEnd::Ended(status) if status.code() == Some(7)));
        let short = Duration::from_millis(50);
        assert_eq!(wait(&["sleep", "60"], short, || true), WaitEnd::TimedOut);
        assert_eq!(wait(&["sleep", "60"], long, || false), WaitEnd::GivenUp);
    }

    const LIMIT: Duration = Duration::from_secs(60);

    #[test]
    fn the_first_signal_or_the_limit_asks_and_the_second_or_silence_kills() {
        let (person, limit) = (
            Step::Ask(StopReason::ByPerson),
            Step::Ask(StopReason::ByLimit(LIMIT)),
        );
        // Looks: seconds, signals, bytes. Of the steps, those that do not wait.
        for (looks, expected) in [
            (
                &[(1, 0, 9), (2, 1, 9), (3, 1, 9), (4, 2, 9)][..],
                &[(2, person), (4, Step::Kill)][..],
            ),
            // Two signals at once count as one, and a child that cannot hear is not asked.
            (&[(1, 2, 0), (2, 2, 0), (3, 2, 1)], &[(3, person)]),
            (&[(1, 1, 0), (2, 2, 0)], &[(2, Step::Kill)]),
            // After the limit it may run on as long as it prints.
            (
                &[
                    (59, 0, 9),
                    (60, 0, 9),
                    (69, 0, 10),
                    (78, 0, 10),
                    (79, 0, 10),
                ],
                &[(60, limit), (79, Step::TimeOut)],
            ),
            (&[(60, 0, 9), (61, 1, 9)], &[(60, limit), (61, Step::Kill)]),
            (&[(60, 0, 0)], &[(60, Step::TimeOut)]),
        ] {
            let mut asking = ChildWatch::new(LIMIT);
            let steps = looks.iter().map(|&(seconds, signals, bytes)| {
                let elapsed = Duration::from_secs(seconds);
                (seconds, asking.step(elapsed, signals, bytes))
            });
            let steps: Vec<_> = steps.filter(|(_, step)| *step != Step::Wait).collect();
            assert_eq!(steps, expected);
        }
    }

    #[test]
    fn a_line_is_shown_once_and_only_when_it_is_whole() {
        let path = crate::system::new_log("tail").unwrap();
        let mut tail = FollowedFile::new(&path);
        let mut shown: Vec<String> = Vec::new();
        let mut show = |line: &str| shown.push(line.to_string());
        assert!(tail.follow(&mut show).is_err(), "it is not there yet");
        let mut file = File::create(&path).unwrap();
        file.write_all(b"one\r\ntw").unwrap();
        tail.follow(&mut show).unwrap();
        tail.follow(&mut show).unwrap();
        file.write_all(b"o\nthree").unwrap();
        tail.follow(&mut show).unwrap();
        let text = tail.finish(&mut show).unwrap();
        assert_eq!(text, "one\r\ntwo\nthree");
        std::fs::remove_file(&path).unwrap();
        assert_eq!(shown, ["one", "two", "three"]);
    }
}
