//! Opened records: of a play, or of one or several files.

use std::borrow::Cow;
use std::ops::Range;

use recording::{MAGIC, completed};
use views::links;
use views::picture::{self, TimeWindow, WindowRequest};
use views::record::{CommittedDags, Record, Run, bytes_of_log};
use views::view::View;

use crate::play;
use crate::request::{Faults, Request};

/// Records, read, with their bytes.
#[derive(Default)]
pub(crate) struct OpenedRecords<'r> {
    pub(crate) records: Vec<(String, Record)>,
    bytes: Vec<Cow<'r, [u8]>>,
    /// The records of several machines, joined.
    joint: Option<Run>,
    /// The warnings of a play's commit; `None` for other records, with inexact times.
    pub(crate) warnings: Option<Vec<String>>,
}

impl<'r> OpenedRecords<'r> {
    /// Plays, and opens the play's record, so the page shows a play as its record.
    pub(crate) fn played(request: &Request<'r>) -> Result<Self, Faults> {
        let (record, warnings) = play::play(request)?;
        Ok(Self {
            records: vec![(String::new(), Record::read(&record)?)],
            bytes: vec![record.into()],
            warnings: Some(warnings),
            ..Self::default()
        })
    }

    /// Opens the records of the body.
    pub(crate) fn read(request: &Request<'r>) -> Result<Self, Faults> {
        let is_live = request.choice("live", &[("no", false), ("yes", true)])?;
        let all = request.body.len().to_string();
        let sizes = request.text("sizes").unwrap_or(&all);
        let mut names = request.text("names").unwrap_or("record").split(',');
        let (mut opened, mut rest) = (Self::default(), request.body);
        for size in sizes.split(',') {
            let size = size.parse().ok();
            let parts = size.and_then(|size| rest.split_at_checked(size));
            let wrong = || format!("sizes: {sizes} are not those of the records that follow");
            let (body, after) = parts.ok_or_else(wrong)?;
            let name = names.next().unwrap_or("record");
            let record = match is_live {
                // The last chunk of a run that goes on may be cut.
                true => Record::sent(body, ""),
                false => Record::read(body),
            };
            let record = record.map_err(|why| format!("{name}: {why}"))?;
            opened.records.push((name.into(), record));
            let log = || bytes_of_log(&String::from_utf8_lossy(body)).unwrap_or_default();
            opened.bytes.push(match body.starts_with(&MAGIC) {
                true => completed(body).unwrap_or_default(),
                false => log().into(),
            });
            rest = after;
        }
        opened.joint = links::join(&opened.records)?;
        if opened.joint.is_none() && opened.records.len() > 1 {
            let why = "no messages connect these records; open each alone";
            return Err(why.to_string().into());
        }
        Ok(opened)
    }

    /// Returns the run with the request's number.
    pub(crate) fn run(&self, request: &Request<'_>) -> Result<&Run, String> {
        let number = request.number("run", 0..=usize::MAX, 0)?;
        let runs = &self.records[0].1.runs;
        let found = self.joint.as_ref().or(runs.get(number));
        let (count, keep) = (runs.len(), "`./scripts/run --trace FILE` keeps one");
        found.ok_or_else(|| format!("run: it has no run {number}, but {count} of them; {keep}"))
    }

    /// Returns each record's bytes and commit, with its DAGs in the shown run.
    pub(crate) fn commits(&self, run: &Run) -> impl Iterator<Item = Part<'_>> {
        let number = usize::try_from(run.number).unwrap_or(usize::MAX);
        let all = self.records.iter().zip(&self.bytes).enumerate();
        all.filter_map(move |(place, ((_, record), bytes))| {
            // The times stand in the order of runs; a run that has died has no times.
            let times = record.times.get(number);
            let commit = match times {
                Some((at, _)) => record.commits.get(*at),
                None => record.commits.last(),
            };
            let dags = run.machines.get(place).map(|it| it.dags.clone());
            Some((&bytes[..], commit?, dags.unwrap_or(0..u32::MAX)))
        })
    }
}

type Part<'o> = (&'o [u8], &'o CommittedDags, Range<u32>);

/// Draws the run named by a request, or a window of the run.
pub(crate) fn svg(opened: &OpenedRecords<'_>, request: &Request<'_>) -> Result<Vec<u8>, Faults> {
    let view = View::new(opened.run(request)?);
    // The `periods` of a play are the play's length.
    let periods = match opened.warnings {
        Some(_) => 1,
        None => request.number("periods", 1..=1000, 1)?,
    };
    let asked = WindowRequest {
        from: request.text("from"),
        to: request.text("to"),
        dags: request.text("dags"),
        periods: Some(periods),
    };
    let window = TimeWindow::of(&view, &asked)?;
    Ok(picture::draw(&view, window)?.into_bytes())
}
