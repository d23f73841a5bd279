//! The page's engine: a request on standard input, an answer on standard output.
//!
//! A *request* is a line `WHAT NAME=VALUE ...` followed by a body: a DAG file, or records. An
//! *answer* is a head in JSON followed by columns of numbers ([`answer`]), or the bytes of a file
//! saved by the page.
//!
//! In a browser the program is wasm, started anew for each request. The same program runs on the
//! host, where tests compare its answers. A refused request is answered, too: no input ends the
//! program.

#![forbid(unsafe_code)]

mod answer;
mod job;
mod opened;
mod play;
mod request;
mod stamps;
mod tables;

use std::io::{self, Read, Write};

use opened::OpenedRecords;
use request::{Faults, Request};

/// The most bytes of a request: the memory of wasm ends at 4 GiB, and a record takes some
/// twenty-five times its size.
const MOST_BYTES: usize = 100 << 20;

fn main() -> io::Result<()> {
    let mut bytes = Vec::new();
    io::stdin().read_to_end(&mut bytes)?;
    // Most memory is taken at once, if available: each growth of wasm's memory costs a browser as
    // much as thousands of allocations.
    let mut memory = Vec::<u8>::new();
    let _ = memory.try_reserve_exact((25 * bytes.len()).clamp(32 << 20, 1 << 30));
    drop(std::hint::black_box(memory));
    let answered = Request::read(&bytes).map_err(Faults::from);
    let answered = answered.and_then(|request| answer(&request));
    io::stdout().write_all(&answered.unwrap_or_else(|faults| faults.answer()))
}

/// Answers a request.
fn answer(request: &Request<'_>) -> Result<Vec<u8>, Faults> {
    let size = request.body.len();
    if size > MOST_BYTES {
        let why = format!("it has {size} bytes; keep a run of {MOST_BYTES} at most");
        return Err(why.into());
    }
    let of_play = request.choice("of", &[("open", false), ("play", true)])?;
    let opened = match request.what {
        "record-of-play" => return Ok(play::play(request)?.0),
        "play" | "svg-of-play" => OpenedRecords::played(request)?,
        "job" if of_play => OpenedRecords::played(request)?,
        _ => OpenedRecords::read(request)?,
    };
    match request.what {
        "play" | "open" => answer::picture(&opened, request),
        "svg-of-play" | "svg" => opened::svg(&opened, request),
        "job" => job::job(&opened, request),
        what => {
            let what = text::quoted(what);
            Err(format!("{what} is no request; ask to play, open, svg or job").into())
        }
    }
}
