//! The report's looks: HTML pieces and the style sheet, no content.

use std::fmt::Display;

/// The whole page around its body. It names no other file.
pub(super) fn html(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n{body}\
         </main>\n</body>\n</html>\n"
    )
}

/// Replaces what HTML would take for markup.
pub(super) fn escaped(text: impl Display) -> String {
    let text = text.to_string();
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A table: the heads of its columns, and rows that start a group or not.
pub(super) fn table(heads: &[&str], rows: &[(bool, Vec<String>)]) -> String {
    let cells = |tag: &str, cells: &mut dyn Iterator<Item = String>| {
        let cells: String = cells.map(|cell| format!("<{tag}>{cell}</{tag}>")).collect();
        cells
    };
    let head = cells("th", &mut heads.iter().map(escaped));
    let row = |(starts_group, row): &(bool, Vec<String>)| {
        let class = if *starts_group {
            " class=\"group\""
        } else {
            ""
        };
        let row = cells("td", &mut row.iter().map(escaped));
        format!("<tr{class}>{row}</tr>\n")
    };
    let rows: String = rows.iter().map(row).collect();
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n\
         </table></div>\n"
    )
}

/// A picture with its title and what to see in it.
pub(super) fn figure(address: &str, title: &str, caption: &str) -> String {
    let (title, caption) = (escaped(title), escaped(caption));
    format!(
        "<figure><img src=\"{address}\" alt=\"{title}\">\
         <figcaption><b>{title}.</b> {caption}</figcaption></figure>\n"
    )
}

/// Nanoseconds as people read them.
pub(super) fn ns(ns: u64) -> String {
    let value = ns as f64;
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.2} µs", value / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} ms", value / 1e6),
        _ => format!("{:.2} s", value / 1e9),
    }
}

const STYLE: &str = "
:root { --ink: #1c2430; --soft: #5b6675; --line: #dfe4ea; --back: #f6f7f9; --mark: #1b7837; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif; }
main { max-width: 76rem; margin: 2.5rem auto; padding: 2.5rem 3rem; background: white;
  border: 1px solid var(--line); border-radius: 10px; }
h1 { font-size: 2rem; line-height: 1.2; margin: 0 0 .4rem; }
h2 { font-size: 1.3rem; margin: 2.4rem 0 .6rem; padding-top: 1.2rem;
  border-top: 1px solid var(--line); }
.lead { color: var(--soft); font-size: 1.1rem; margin: 0 0 1.6rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); gap: 1rem; }
.card { border: 1px solid var(--line); border-left: 5px solid var(--soft); border-radius: 8px;
  padding: .8rem 1rem; }
.card.dag { border-left-color: var(--mark); }
.card b { display: block; font-size: 1.5rem; font-variant-numeric: tabular-nums; }
.card span { color: var(--soft); font-size: .92rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .82rem;
  font-variant-numeric: tabular-nums; }
th, td { padding: .34rem .45rem; text-align: right; white-space: nowrap; }
th { white-space: normal; vertical-align: bottom; color: var(--soft); font-weight: 600;
  border-bottom: 2px solid var(--line); }
th:nth-child(2), td:nth-child(2) { text-align: left; }
tr.group td { border-top: 1px solid var(--line); }
figure { margin: 1.6rem 0 2.2rem; }
figure img { width: 100%; height: auto; border: 1px solid var(--line); border-radius: 6px; }
figcaption { color: var(--soft); font-size: .92rem; margin-top: .5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .25rem 1.2rem; }
dt { color: var(--soft); } dd { margin: 0; }
.note { background: #fff8e6; border: 1px solid #f0dfae; border-radius: 6px; padding: .6rem 1rem; }
@media print { body { background: white; } main { border: 0; margin: 0; padding: 0; } }
";

#[cfg(test)]
mod tests {
    use super::{escaped, ns};

    #[test]
    fn markup_in_text_is_text() {
        assert_eq!(escaped("a<b> & \"c\""), "a&lt;b&gt; &amp; &quot;c&quot;");
    }

    #[test]
    fn times_have_a_fitting_unit() {
        let texts = [614, 1_874, 36_500_000, 22_644_000_000].map(ns);
        assert_eq!(texts, ["614 ns", "1.87 µs", "36.50 ms", "22.64 s"]);
    }
}
