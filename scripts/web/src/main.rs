//! The page's engine: a request on standard input, an answer on standard output.
//!
//! A *request* is a line `WHAT NAME=VALUE ...` and a body behind it: a DAG file, or records. An
//! *answer* is a head in JSON with columns of numbers behind it ([`answer`]), or the bytes of a
//! file that the page saves.
//!
//! In a browser the program is wasm, started anew for each request. It is the same on the host,
//! where tests compare its answers. A request that it refuses is answered, too: no input ends it.

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

/// The memory of wasm ends at 4 GiB, and a record takes some twenty-five times its size.
const MOST_BYTES: usize = 100 << 20;

fn main() -> io::Result<()> {
    let mut bytes = Vec::new();
    io::stdin().read_to_end(&mut bytes)?;
    // Most is taken at once, if it is there: each growth of wasm's memory costs a browser as much
    // as thousands of allocations.
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
