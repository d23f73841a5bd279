//! A child process with a limit: it is waited for, watched, and killed by its
//! own process id when its time is over or when we let go of it. One that can end in order is
//! asked to do so first.
//!
//! It is asked at its limit, and when a *signal* asks us to end, such as ctrl-C (`asking`). What it
//! prints goes to a file, which is followed (`tail`).
//!
//! Where the program `setpriv` exists, the system kills the child also if the
//! tool itself is killed, so nothing is left behind in any case.

mod asking;
mod tail;

use std::fs::File;
use std::io;
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{self, ChildStdin, ChildStdout, Command, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

use linux::EndSignals;

use crate::system;
pub use asking::Asked;
use asking::{Asking, Step};
use tail::Tail;

/// How long one look at the process is from the next.
const PAUSE: Duration = Duration::from_millis(10);

/// A child process that was started.
#[derive(Debug)]
pub struct Child {
    process: process::Child,
    started: Instant,
}

/// Why the wait for a child ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited {
    /// It ended by itself.
    Ended(ExitStatus),
    /// Its time was over, and it was killed.
    TimedOut,
    /// The watcher gave it up, and it was killed.
    GivenUp,
    /// A person pressed ctrl-C again before it had ended, and it was killed.
    Killed,
}

/// The end of a child that was followed.
#[derive(Debug)]
pub struct Followed {
    /// Why the wait ended.
    pub waited: Waited,
    /// Why it was asked to end before its time, if it was.
    pub asked: Option<Asked>,
    /// All that it has printed; bytes that are no UTF-8 are replaced.
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

    /// Waits for the end, for at most `limit` since the start. `watch` is
    /// called now and then; when it returns `false`, the child is given up.
    pub fn wait(&mut self, limit: Duration, mut watch: impl FnMut() -> bool) -> Waited {
        loop {
            match self.process.try_wait() {
                Ok(Some(status)) => return Waited::Ended(status),
                Ok(None) => {}
                // It is no child of ours any more: nothing is left to kill.
                Err(_) => return Waited::GivenUp,
            }
            if self.started.elapsed() >= limit {
                self.kill();
                return Waited::TimedOut;
            }
            if !watch() {
                self.kill();
                return Waited::GivenUp;
            }
            thread::sleep(PAUSE);
        }
    }

    /// Works like [`wait`](Self::wait), and shows each whole line of `log`, where the child
    /// prints, to `show` as it comes. It is given up when `is_well`, which gets the number of
    /// bytes there, says so. One that can end in order is asked to by `stop` before it is killed.
    ///
    /// # Errors
    ///
    /// In words: the log cannot be read.
    pub fn follow(
        &mut self,
        limit: Duration,
        log: &Path,
        show: &mut dyn FnMut(&str),
        mut stop: Option<&mut dyn FnMut(Asked)>,
        mut is_well: impl FnMut(u64) -> bool,
    ) -> Result<Followed, String> {
        let (mut tail, mut asking) = (Tail::new(log), Asking::new(limit));
        let signals = stop.as_ref().map(|_| EndSignals::catch());
        let (started, mut killed) = (self.started, Waited::GivenUp);
        let of_wait = signals.as_ref().map_or(limit, |_| Duration::MAX);
        let waited = self.wait(of_wait, || {
            let _ = tail.follow(show);
            let printed_bytes = tail.bytes();
            if !is_well(printed_bytes) {
                return false;
            }
            let (Some(ask), Some(signals)) = (&mut stop, &signals) else {
                return true;
            };
            match asking.step(started.elapsed(), signals.count(), printed_bytes) {
                Step::Wait => return true,
                Step::Ask(why) => {
                    if why == Asked::ByPerson {
                        eprintln!("ending in order; ctrl-C again ends it at once");
                    }
                    ask(why);
                    return true;
                }
                Step::Kill => killed = Waited::Killed,
                Step::TimeOut => killed = Waited::TimedOut,
            }
            false
        });
        let text = tail.finish(show);
        Ok(Followed {
            waited: if waited == Waited::GivenUp {
                killed
            } else {
                waited
            },
            asked: asking.why(),
            text: text.map_err(|why| format!("cannot read the log `{}`: {why}", log.display()))?,
        })
    }

    /// Returns the child's process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Returns another handle of the child's standard input, if that is a pipe and was not taken.
    pub fn second_input(&self) -> Option<File> {
        let input = self.process.stdin.as_ref()?;
        let other = input.as_fd().try_clone_to_owned();
        other.ok().map(File::from)
    }

    /// Takes the child's standard input, if that is a pipe and was not taken.
    pub fn input(&mut self) -> Option<ChildStdin> {
        self.process.stdin.take()
    }

    /// Takes what the child prints, if that is a pipe and was not taken.
    pub fn output(&mut self) -> Option<ChildStdout> {
        self.process.stdout.take()
    }

    /// Returns the time since the start.
    #[must_use]
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    fn kill(&mut self) {
        // It may have ended by itself in between: then there is nothing to do.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Returns a command for `program` that the system kills when the calling
/// thread dies, if `setpriv` is there to ask for it. `setpriv` becomes the
/// program, so the process id stays the same.
#[must_use]
pub fn bound_to_us(program: &Path) -> Command {
    if system::find_program("setpriv").is_none() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.args(["--pdeathsig", "KILL", "--"]).arg(program);
    command
}

#[cfg(test)]
mod tests {
    use super::{Child, Waited, bound_to_us};
    use std::path::Path;
    use std::time::Duration;

    fn wait(words: &[&str], limit: Duration, watch: impl FnMut() -> bool) -> Waited {
        let mut command = bound_to_us(Path::new(words[0]));
        let mut child = Child::start(command.args(&words[1..])).expect(words[0]);
        child.wait(limit, watch)
    }

    #[test]
    fn a_child_ends_is_killed_or_is_given_up() {
        let long = Duration::from_secs(60);
        let ended = wait(&["sh", "-c", "exit 7"], long, || true);
        assert!(matches!(ended, Waited::Ended(status) if status.code() == Some(7)));
        let short = Duration::from_millis(50);
        assert_eq!(wait(&["sleep", "60"], short, || true), Waited::TimedOut);
        assert_eq!(wait(&["sleep", "60"], long, || false), Waited::GivenUp);
    }
}
