//! Serves the page, and the growing record of a run, to this computer alone: `run --page`.
//!
//! The server has two routes. `/` is the page, and `/record?from=N` is the record from byte N on.
//! The answer has two headers: `bytes:` has the record's length, and `record:` says `going`, or
//! `over` when the run has ended and the record is complete. A complete record begins with another
//! header than a growing record, so a page reads it anew from byte 0.
//!
//! A request must name this server as its host, so a page of another origin cannot read a run by a
//! name directed to this computer. A request for the record is also refused if the browser says
//! that it comes from another origin: such a page cannot keep a run waiting at its end by loading
//! the record as an image. Each request has a thread. The thread ends when a client sends or takes
//! nothing for 2 s.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use crate::recordings;

/// The longest silence of a client.
const PATIENCE: Duration = Duration::from_secs(2);

/// The most bytes of a request.
const MOST_REQUEST_BYTES: u64 = 16 << 10;

/// The most bytes of a record in an answer.
const MOST_BYTES: usize = 8 << 20;

/// The most requests at a time: each takes a thread and an open file, and the run itself needs open
/// files, too.
const MOST_REQUESTS: usize = 64;

/// A page counts as following the run while its latest request is younger than this.
const ASKS: Duration = Duration::from_secs(5);

/// The longest wait for a page that follows the run to take the whole record.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// Why a lock is not poisoned.
const UNBROKEN: &str = "no thread panics with it";

/// A server, alive until the program ends.
pub(super) struct PageServer {
    pub(super) port: u16,
    page: String,
    /// The file of the growing record.
    raw: PathBuf,
    /// The record of the run, after its end.
    whole: OnceLock<Vec<u8>>,
    /// The time of the latest request for the record, and the number of bytes taken from the whole
    /// record, counted from the first byte on.
    taken: Mutex<(Option<Instant>, usize)>,
}

impl PageServer {
    /// Serves a page, and the record in `raw`.
    ///
    /// # Errors
    ///
    /// In words: there is no port.
    pub(super) fn start(page: String, raw: &Path) -> Result<&'static PageServer, String> {
        let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
        let bound = bound.and_then(|listener| Ok((listener.local_addr()?.port(), listener)));
        let no_port = |why| format!("`--page` finds no port of 127.0.0.1: {why}");
        let (port, listener) = bound.map_err(no_port)?;
        let server: &PageServer = Box::leak(Box::new(PageServer {
            port,
            page,
            raw: raw.into(),
            whole: OnceLock::new(),
            taken: Mutex::default(),
        }));
        let requests = Arc::new(());
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let request = Arc::clone(&requests);
                if Arc::strong_count(&request) <= MOST_REQUESTS {
                    // A client that goes away harms nobody, so its failure is ignored.
                    thread::spawn(move || (server.answer(stream).ok(), request));
                }
            }
        });
        Ok(server)
    }

    /// Serves the whole record from now on. If a page is still asking, waits until that page has
    /// taken everything, for at most [`LONGEST_WAIT`]. Reports whether a page has ever asked.
    pub(super) fn finish(&self, whole: Vec<u8>) -> bool {
        let until = Instant::now() + LONGEST_WAIT;
        let bytes = self.whole.get_or_init(|| whole).len();
        loop {
            let (asked, taken) = *self.taken.lock().expect(UNBROKEN);
            let is_followed = asked.is_some_and(|asked| asked.elapsed() < ASKS);
            if taken == bytes || !is_followed || Instant::now() > until {
                return asked.is_some();
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Reads a request, and answers it.
    fn answer(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let lines = BufReader::new((&stream).take(MOST_REQUEST_BYTES)).lines();
        let lines = lines.map_while(|line| line.ok().filter(|line| !line.is_empty()));
        let lines: Vec<String> = lines.collect();
        let own = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port));
        let values = |name: &'static str| {
            let headers = lines.iter().filter_map(|line| line.split_once(':'));
            let of_name = headers.filter(move |header| header.0.eq_ignore_ascii_case(name));
            of_name.map(|header| header.1.trim())
        };
        let mut are_ours = values("host").map(|host| own.iter().any(|own| own == host));
        let is_for_us = are_ours.next() == Some(true) && are_ours.all(|is_ours| is_ours);
        let is_foreign = values("sec-fetch-site").any(|site| site != "same-origin");
        let asked = lines.first().and_then(|line| line.strip_prefix("GET "));
        let path = asked.and_then(|asked| asked.split(' ').next());
        let from = path.and_then(|path| path.strip_prefix("/record?from=")?.parse().ok());
        match (path, from) {
            _ if !is_for_us || from.is_some() && is_foreign => {
                write(stream, "403 Forbidden", "", b"")
            }
            (None, _) => write(stream, "405 Method Not Allowed", "", b""),
            (_, Some(from)) => self.answer_record(stream, from),
            (Some("/"), _) => {
                let kind = "content-type: text/html; charset=utf-8\r\n";
                write(stream, "200 OK", kind, self.page.as_bytes())
            }
            _ => write(stream, "404 Not Found", "", b""),
        }
    }

    /// Answers with the record, beginning at a byte.
    fn answer_record(&self, stream: TcpStream, from: usize) -> io::Result<()> {
        self.taken.lock().expect(UNBROKEN).0 = Some(Instant::now());
        let (whole, grown) = (self.whole.get(), recordings::received(&self.raw));
        // Until the guest sends something, there is no file.
        let (record, state) = match whole {
            Some(whole) => (whole, "over"),
            None => (&grown.unwrap_or_default(), "going"),
        };
        let length = record.len();
        let rest = &record[from.min(length)..from.saturating_add(MOST_BYTES).min(length)];
        let headers = format!("record: {state}\r\nbytes: {length}\r\n");
        write(stream, "200 OK", &headers, rest)?;
        let taken = &mut self.taken.lock().expect(UNBROKEN).1;
        // Only bytes without a gap count as taken: `finish` waits until a page has all of them.
        if whole.is_some() && from <= *taken {
            *taken = (*taken).max(from + rest.len());
        }
        Ok(())
    }
}

/// Writes an answer and so ends the connection.
fn write(mut stream: TcpStream, status: &str, headers: &str, body: &[u8]) -> io::Result<()> {
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\n{headers}content-length: {length}\r\ncache-control: no-store\r\n\
         cross-origin-resource-policy: same-origin\r\nx-content-type-options: nosniff\r\n\
         connection: close\r\n\r\n"
    )?;
    stream.write_all(body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::rows;
    use recording::MAGIC;
    use std::fs;

    /// Sends a request to a server; returns the head of the answer, and its content.
    fn ask(server: &PageServer, request: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect((Ipv4Addr::LOCALHOST, server.port)).unwrap();
        let request = request.replace("PORT", &server.port.to_string()) + "\n\n";
        stream.write_all(request.as_bytes()).unwrap();
        let mut said = Vec::new();
        stream.read_to_end(&mut said).unwrap();
        let end = said.windows(4).position(|four| four == b"\r\n\r\n");
        let content = said.split_off(end.unwrap() + 4);
        (String::from_utf8(said).unwrap(), content)
    }

    const REQUESTS: &str = r"
GET / HTTP/1.1\nHost: 127.0.0.1:PORT | 200 OK | the page
GET / HTTP/1.1\nAccept: */*\nhost:localhost:PORT | 200 OK | the page
GET / HTTP/1.1\nHost: example.org:PORT | 403 Forbidden
GET / HTTP/1.1\nHost: localhost | 403 Forbidden
GET / HTTP/1.1 | 403 Forbidden
GET / HTTP/1.1\nHost: localhost:PORT\nHost: example.org | 403 Forbidden
GET /record?from=0 HTTP/1.1\nHost: localhost:PORT\nSec-Fetch-Site: cross-site | 403 Forbidden
POST / HTTP/1.1\nHost: localhost:PORT | 405 Method Not Allowed
GET /record HTTP/1.1\nHost: localhost:PORT | 404 Not Found
GET /record?from=-1 HTTP/1.1\nHost: localhost:PORT | 404 Not Found
GET /../Cargo.toml HTTP/1.1\nHost: localhost:PORT | 404 Not Found";

    #[test]
    fn only_requests_of_this_host_for_one_of_two_routes_are_answered() {
        let server = PageServer::start("the page".into(), Path::new("no file")).unwrap();
        for [request, status, expected] in rows(REQUESTS) {
            let (head, content) = ask(server, &request);
            let is_status = head.starts_with(&format!("HTTP/1.1 {status}\r\n"));
            assert!(
                is_status && content == expected.as_bytes(),
                "{request}: {head}"
            );
        }
        // Nobody has asked for the record, so nobody is waited for.
        assert!(!server.finish(MAGIC.to_vec()));
    }

    #[test]
    fn clients_that_say_nothing_take_no_more_than_their_share() {
        let server = PageServer::start("the page".into(), Path::new("no file")).unwrap();
        let connect = |_| TcpStream::connect((Ipv4Addr::LOCALHOST, server.port)).unwrap();
        let silent: Vec<TcpStream> = (0..4 * MOST_REQUESTS).map(connect).collect();
        // The others are refused for what they say: nothing.
        let is_turned_away = |mut client: TcpStream| !matches!(client.read(&mut [0]), Ok(1));
        assert!(silent.into_iter().any(is_turned_away));
    }

    #[test]
    fn a_record_is_served_while_it_grows_and_waited_for_until_it_is_taken() {
        let raw = crate::system::new_log("served").unwrap();
        let server = PageServer::start(String::new(), &raw).unwrap();
        let taken = || server.taken.lock().unwrap().1;
        let from = |byte: usize| {
            let request = format!("GET /record?from={byte} HTTP/1.1\nHost: localhost:PORT");
            let (head, content) = ask(server, &request);
            let is_over = head.contains("\r\nrecord: over\r\n");
            assert!(is_over || head.contains("\r\nrecord: going\r\n"), "{head}");
            (is_over, content)
        };
        assert_eq!(from(0), (false, vec![]));
        // A firmware has said something before the guest began.
        fs::write(&raw, [b"BIOS", &MAGIC[..], b"one"].concat()).unwrap();
        assert_eq!(from(0), (false, [&MAGIC[..], b"one"].concat()));
        fs::write(&raw, [b"BIOS", &MAGIC[..], b"one, two"].concat()).unwrap();
        assert_eq!(from(MAGIC.len() + 3), (false, b", two".to_vec()));
        assert_eq!(from(usize::MAX), (false, vec![]));
        fs::remove_file(&raw).unwrap();

        let bytes = (0..MOST_BYTES + 5).map(|byte| byte.to_le_bytes()[0]);
        let whole: Vec<u8> = bytes.collect();
        thread::scope(|scope| {
            let ending = scope.spawn(|| server.finish(whole.clone()));
            while from(MOST_BYTES) != (true, whole[MOST_BYTES..].to_vec()) {}
            // It has the end, but not what was before.
            assert_eq!(taken(), 0);
            assert_eq!(from(0).1, whole[..MOST_BYTES]);
            assert_eq!(taken(), MOST_BYTES);
            assert_eq!(from(MOST_BYTES).1.len(), 5);
            assert!(ending.join().unwrap());
            assert_eq!(taken(), whole.len());
        });
    }
}
