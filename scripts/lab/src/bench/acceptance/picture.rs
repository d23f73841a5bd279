//! Acceptance by utilization as a picture: a panel for each number of cores and kind of deadlines,
//! with a curve for each method.
//!
//! Methods differ by colour and by dashes. The lent cores' curve is the widest and lies below the
//! others, so a coinciding curve stays visible on top. A curve may also come from a measurement
//! elsewhere.

use super::methods::METHODS;
use super::sets::Deadlines;
use super::{AcceptancePoint, PERCENTS};
use views::svg::Svg;

/// The size of a panel's field of curves.
pub(super) const FIELD: (u64, u64) = (224, 180);
/// The distance of the left upper corners of two panels.
pub(super) const STEP: (u64, u64) = (286, 252);
/// The corner of the first field, right of the labels and below the legend.
pub(super) const CORNER: (u64, u64) = (64, 128);
/// The utilizations, in percent, at the ends of a field.
const ENDS: (u64, u64) = (PERCENTS.start, 100);

/// The styles of the methods' curves, in the order of the methods.
const STYLES: [&str; METHODS.len()] = [
    "stroke=\"#7f7f7f\" stroke-width=\"1.6\" stroke-dasharray=\"2 3\"",
    "stroke=\"#0072b2\" stroke-width=\"1.8\" stroke-dasharray=\"7 3\"",
    "stroke=\"#b5179e\" stroke-width=\"1.8\" stroke-dasharray=\"8 3 2 3\"",
    "stroke=\"#b5179e\" stroke-width=\"1.3\"",
    "stroke=\"#f08c2e\" stroke-width=\"4\"",
    "stroke=\"#2a9d3a\" stroke-width=\"1.8\"",
    "stroke=\"#1b1b1b\" stroke-width=\"1.3\"",
    "stroke=\"#7f7f7f\" stroke-width=\"1.3\" stroke-dasharray=\"9 4\"",
];
/// The curve below the others.
const LOWEST: usize = 4;
/// A curve measured elsewhere: deadlines, and utilization and share in percent.
type Told = [(Deadlines, u64, u64)];
/// The style of a curve measured elsewhere.
const ELSEWHERE: &str = "stroke=\"#c1121f\" stroke-width=\"2.2\" stroke-dasharray=\"4 2\"";

/// Draws points, given in the order of their cores, deadlines and utilizations, and a method
/// measured elsewhere.
pub(super) fn draw(points: &[AcceptancePoint], told: &Told) -> String {
    let mut svg = Svg::default();
    let sets = points.first().map_or(0, |point| point.counts.sets);
    let title = format!("Random sets of DAGs that a method accepts, of {sets} a point");
    svg.text((CORNER.0, 24), "start", &title);
    let methods = points
        .first()
        .map_or(0, |point| point.counts.accepted.len());
    legend(&mut svg, methods, told);
    let kinds = Deadlines::ALL.len() as u64;
    let kind = |point: &AcceptancePoint| (point.cores, point.deadlines);
    let curves: Vec<_> = points
        .chunk_by(|one, other| kind(one) == kind(other))
        .collect();
    // A column for each number of cores; with a single number, its panels lie side by side.
    let numbers = curves.len() as u64 / kinds;
    let (columns, rows) = if numbers == 1 {
        (kinds, 1)
    } else {
        (numbers, kinds)
    };
    for (place, curve) in (0..).zip(curves) {
        panel(&mut svg, (place / rows, place % rows), curve, told);
    }
    // The legend takes the room of three panels.
    let width = CORNER.0 + columns.max(3) * STEP.0 - 20;
    svg.into_text((width, CORNER.1 + rows * STEP.1 - 16))
}

/// Draws the name of each method next to a piece of its curve, in three rows.
fn legend(svg: &mut Svg, methods: usize, told: &Told) {
    let titles = METHODS[..methods].iter().map(|method| method.title);
    let elsewhere = told.first().map(|_| ("He 2019, on other draws", ELSEWHERE));
    for (place, (title, style)) in (0..).zip(titles.zip(STYLES).chain(elsewhere)) {
        let (x, y) = (CORNER.0 + place % 3 * 270, 44 + place / 3 * 20);
        svg.line((x, y), (x + 40, y), style);
        svg.text((x + 48, y + 4), "start", title);
    }
}

/// Draws the axes and curves of a panel at a place, by columns and rows.
fn panel(svg: &mut Svg, (column, row): (u64, u64), curve: &[AcceptancePoint], told: &Told) {
    let (left, top) = (CORNER.0 + column * STEP.0, CORNER.1 + row * STEP.1);
    let (right, bottom) = (left + FIELD.0, top + FIELD.1);
    let x = |percent: u64| left + (percent - ENDS.0) * FIELD.0 / (ENDS.1 - ENDS.0);
    // Rounded to the nearest pixel.
    let y = |count: u64, of: u64| bottom - (2 * count * FIELD.1 + of) / (2 * of).max(1);
    let grey = "stroke=\"#333333\" stroke-opacity=\"0.15\"";
    for accepted in [0, 25, 50, 75, 100] {
        let y = y(accepted, 100);
        svg.line((left, y), (right, y), grey);
        svg.text((left - 6, y + 4), "end", &format!("{accepted} %"));
    }
    for percent in (ENDS.0..=ENDS.1).step_by(20) {
        svg.line((x(percent), top), (x(percent), bottom), grey);
        let label = format!("{:.1}", percent as f64 / 100.0);
        svg.text((x(percent), bottom + 17), "middle", &label);
    }
    let axes = format!("M{left} {top} V{bottom} H{right}");
    svg.path(&axes, "fill=\"none\" stroke=\"#333333\"");
    if let Some(AcceptancePoint {
        cores, deadlines, ..
    }) = curve.first()
    {
        let title = format!("m = {cores}, {}", deadlines.names().1);
        svg.text((left, top - 10), "start", &title);
    }
    svg.text((right, bottom + 34), "end", "utilization / m");
    let methods = curve.first().map_or(0, |point| point.counts.accepted.len());
    let others = (0..methods).filter(|method| *method != LOWEST);
    for method in [LOWEST].into_iter().chain(others) {
        let ends = curve.iter().map(
            |AcceptancePoint {
                 percent, counts, ..
             }| {
                format!(
                    "{} {}",
                    x(*percent),
                    y(counts.accepted[method], counts.sets)
                )
            },
        );
        let path = format!("M{}", ends.collect::<Vec<_>>().join(" L"));
        svg.path(&path, &format!("fill=\"none\" {}", STYLES[method]));
    }
    let deadlines = curve.first().map(|point| point.deadlines);
    let here = told.iter().filter(|of| Some(of.0) == deadlines);
    let ends = here.map(|&(_, percent, share)| format!("{} {}", x(percent), y(share, 100)));
    let ends: Vec<String> = ends.collect();
    if !ends.is_empty() {
        svg.path(
            &format!("M{}", ends.join(" L")),
            &format!("fill=\"none\" {ELSEWHERE}"),
        );
    }
}
