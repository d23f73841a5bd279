//! A child process with a limit: it is waited for, watched, and killed by its
//! own process id when its time is over or when we let go of it.
//!
//! Where the program `setpriv` exists, the system kills the child also if the
//! tool itself is killed, so nothing is left behind in any case.

use std::io;
use std::process::{self, ChildStdin, ChildStdout, Command, ExitStatus};
use std::thread;
use std::time::{Duration, Instant};

use crate::system;

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
pub fn bound_to_us(program: &std::path::Path) -> Command {
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
