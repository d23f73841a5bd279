//! `run --page`: the record of a run is served while it grows, and whole when the run is over.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Stdio;
use std::thread;
use std::time::Duration;

use end_signals::EndSignals;
use views::record::Record;

use crate::support::{command, folder};

/// Gets a path from a server; returns the head of the answer, and its content.
fn get(host: &str, path: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(host).expect("it is there");
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("it listens");
    let mut said = Vec::new();
    stream.read_to_end(&mut said).expect("it answers");
    let end = said.windows(4).position(|four| four == b"\r\n\r\n");
    let content = said.split_off(end.expect("a head") + 4);
    (String::from_utf8(said).expect("UTF-8"), content)
}

/// Gets the rest of the record, with a pause, as a page does. Reports whether the run is over; if it
/// goes on, `grown` gets the rest.
fn is_over(host: &str, grown: &mut Vec<u8>) -> bool {
    thread::sleep(Duration::from_millis(100));
    let (head, rest) = get(host, &format!("/record?from={}", grown.len()));
    if head.contains("\r\nrecord: over\r\n") {
        return true;
    }
    assert!(head.contains("\r\nrecord: going\r\n"), "{head}");
    grown.extend(rest);
    false
}

#[test]
fn a_page_follows_a_run_and_has_all_of_it_in_the_end() {
    let folder = folder("live");
    for on in ["--mode deterministic", "--on linux"] {
        let line = format!("run --page --app fork-join --cores 1 --jobs 5000 --keep kept.rec {on}");
        let mut command = command(&folder, line.split(' '));
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the tool can be started");
        let mut said = BufReader::new(child.stderr.take().expect("it is a pipe")).lines();
        let mut lines = said.by_ref().map(|line| line.expect("UTF-8"));
        let address = |line: String| Some(line.strip_prefix("page: http://")?.replace('/', ""));
        let host = lines.find_map(address).expect("an address");
        let (head, page) = get(&host, "/");
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{head}");
        let page = String::from_utf8(page).expect("UTF-8");
        assert!(page.contains("\nconst LIVE = true;\n"), "{on}");

        let mut grown = Vec::new();
        let events = |bytes: &[u8]| {
            let runs = Record::sent(bytes, "").unwrap_or_default().runs;
            runs.first().map_or(Vec::new(), |run| run.events.clone())
        };
        while events(&grown).len() < 10 {
            assert!(!is_over(&host, &mut grown), "{on}: it goes on");
        }
        EndSignals::send(child.id());
        while !is_over(&host, &mut grown) {}
        let (head, whole) = get(&host, "/record?from=0");
        let length = format!("\r\nrecord: over\r\nbytes: {}\r\n", whole.len());
        assert!(head.contains(&length), "{length}: {head}");
        let status = child.wait().expect("it is ours");
        assert_eq!(status.code(), Some(130), "{:?}", said.collect::<Vec<_>>());
        assert_eq!(fs::read(folder.join("kept.rec")).expect("a file"), whole);
        assert!(Record::read(&whole).expect("it is whole").runs[0].complete);
        assert!(events(&whole).starts_with(&events(&grown)), "{on}");
    }
}
