//! What is said while something lasts of which no one knows how far it is: that it goes on.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::progress::SILENCE;

/// The longest time between two lines.
const MOST: Duration = Duration::from_secs(60);

/// Says on standard error what goes on, after [`SILENCE`] and then ever more seldom, until it is
/// dropped.
#[derive(Debug)]
pub struct Lasting {
    _over: Sender<()>,
}

impl Lasting {
    /// Begins what goes on, in words such as "building `drone`".
    #[must_use = "it ends when it is dropped"]
    pub fn new(what: &str) -> Lasting {
        let what = what.to_string();
        Lasting::saying(SILENCE, move |since| {
            eprintln!("{what}: {} s so far", since.as_secs());
        })
    }

    fn saying(first: Duration, say: impl Fn(Duration) + Send + 'static) -> Lasting {
        let (over, is_over) = channel::<()>();
        thread::spawn(move || {
            let (begun, mut pause) = (Instant::now(), first);
            while is_over.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                say(begun.elapsed());
                pause = (pause * 2).min(MOST);
            }
        });
        Lasting { _over: over }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::Lasting;

    #[test]
    fn what_lasts_is_said_until_it_ends() {
        let (sender, said) = channel();
        let lasting = Lasting::saying(Duration::from_millis(1), move |since| {
            let _ = sender.send(since);
        });
        let first = said.recv().expect("it lasts");
        assert!(first < said.recv().expect("it still lasts"));
        drop(lasting);
        // The thread ends, and with it the way.
        while said.recv().is_ok() {}
    }
}
