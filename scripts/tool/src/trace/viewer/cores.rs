//! The tracks of the cores: what each one executed when.

use sched_dag::journal::What;
use sched_dag::{CoreId, Instance};

use super::super::view::{Slice, View};
use super::flows::Flows;
use super::output::{Output, Track};
use super::{draw_piece, instance_args, instance_name};

/// A piece of an instance's execution, and which one of the instance's it is, counted from 0.
struct Piece {
    instance: Instance,
    slice: Slice,
    number: usize,
}

/// Draws the cores of a run.
pub(super) fn draw(view: &View<'_>, prefix: &str, flows: &Flows, output: &mut Output) {
    let pieces = pieces(view);
    let group = output.group(&format!("{prefix}cores"), "");
    for core in (0..view.run.options.cores).map(CoreId) {
        let mut track = output.track(group, &format!("core {}", core.0));
        for piece in pieces.iter().filter(|piece| piece.slice.core == core) {
            draw_one(view, piece, flows, &mut track);
        }
        draw_preemptions(view, core, &mut track);
        output.add(track);
    }
}

/// Returns all pieces in the order of time.
fn pieces(view: &View<'_>) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (&instance, history) in &view.histories {
        let slices = history.slices.iter().enumerate();
        pieces.extend(slices.map(|(number, &slice)| Piece {
            instance,
            slice,
            number,
        }));
    }
    pieces.sort_by_key(|piece| (piece.slice.from_ns, piece.slice.to_ns.unwrap_or(u64::MAX)));
    pieces
}

fn draw_one(view: &View<'_>, piece: &Piece, flows: &Flows, track: &mut Track) {
    let &Piece {
        instance,
        slice,
        number,
    } = piece;
    let history = &view.histories[&instance];
    let is_last = number + 1 == history.slices.len();
    let begins = if number > 0 {
        "resume"
    } else if history.start_ns.is_some() {
        "start"
    } else {
        "before the trace"
    };
    let ends = match slice.to_ns {
        None => "after the trace",
        Some(_) if !is_last => "suspend",
        Some(_) if history.finish_ns.is_some() => "finish",
        Some(_) if history.dropped_ns.is_some() => "fault",
        Some(_) => "suspend",
    };
    let args = instance_args(instance)
        .number("piece", number as u64 + 1)
        .text("begins", begins)
        .text("ends", ends);
    let name = instance_name(view.run, instance);
    draw_piece(view, (instance, number), (&name, &args.end()), flows, track);
}

fn draw_preemptions(view: &View<'_>, core: CoreId, track: &mut Track) {
    for event in &view.events {
        let what = match event.what {
            What::Request => "preempt for",
            What::Suspend => "preempted",
            What::Ended => "fault in",
            What::Restarted => "goes on without",
            _ => continue,
        };
        if let Some(instance) = event.instance()
            && event.core == core
        {
            let name = format!("{what} {}", instance_name(view.run, instance));
            track.instant(event.time_ns, &name, &instance_args(instance).end());
        }
    }
}
