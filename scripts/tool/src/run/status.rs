//! The live line: from a machine line of kind `status` to a line on a terminal.

use std::time::Instant;

use crate::protocol::MachineLine;

/// The longest line, so that a narrow terminal does not break it.
const WIDTH: usize = 100;

/// What is known of a run's speed.
#[derive(Debug, Default)]
pub(super) struct StatusLine {
    /// When the first line came, and the run's time in it.
    first: Option<(Instant, u64)>,
}

impl StatusLine {
    /// Says in one line how the run does; `None` if the machine line does not.
    pub(super) fn text(&mut self, line: &MachineLine) -> Option<String> {
        let now = Instant::now();
        let time_ns = line.number_at("time_ns")?;
        let (since, since_ns) = match self.first {
            // Another run of the same boot begins at 0 again.
            Some(first) if first.1 <= time_ns => first,
            _ => *self.first.insert((now, time_ns)),
        };
        let wall_ns = u64::try_from((now - since).as_nanos()).unwrap_or(u64::MAX);
        describe(line, wall_ns, time_ns - since_ns)
    }
}

/// Does so, `wall_ns` of our time after `run_ns` of the run's time have passed.
fn describe(line: &MachineLine, wall_ns: u64, run_ns: u64) -> Option<String> {
    let (done, total) = (line.number_at("done")?, line.number_at("total")?);
    let misses = line.number_at("misses")?;
    let jobs = match total {
        0 => format!("{done} jobs"),
        _ => format!("{done} of {total} jobs"),
    };
    let mut text = format!("{jobs}, {misses} missed");
    let loads = line.value.get("load_permille")?.elements();
    let percent = |load: &crate::json::Value| Some((load.as_u64()? + 5) / 10);
    let loads: Vec<String> = loads
        .iter()
        .filter_map(percent)
        .map(|load| load.to_string())
        .collect();
    if !loads.is_empty() {
        text += &format!(", load {} %", loads.join(" "));
    }
    if let Some(left_ns) = line.number_at("left_ns").filter(|_| run_ns > 0) {
        let left_ns = u128::from(left_ns) * u128::from(wall_ns) / u128::from(run_ns);
        text += &format!(", {} s left", left_ns.div_ceil(1_000_000_000));
    }
    if text.len() > WIDTH {
        text.truncate(text.floor_char_boundary(WIDTH - 2));
        text += "..";
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::{WIDTH, describe};
    use crate::protocol::read_line;

    fn described(rest: &str, wall_ns: u64, run_ns: u64) -> Option<String> {
        let text = format!("{{\"kind\":\"status\",\"time_ns\":5000000000,\"done\":12,{rest}}}");
        let line = read_line(1, &text).expect("a machine line");
        describe(&line.expect("good"), wall_ns, run_ns)
    }

    #[test]
    fn says_jobs_misses_load_and_time_left_as_far_as_they_are_known() {
        let full =
            "\"total\":60,\"misses\":3,\"load_permille\":[894,1000,4],\"left_ns\":9000000000";
        let text = described(full, 2_000_000_000, 3_000_000_000);
        let expected = "12 of 60 jobs, 3 missed, load 89 100 0 %, 6 s left";
        assert_eq!(text.as_deref(), Some(expected));
        // At the first line nothing is known of the speed.
        let expected = expected.strip_suffix(", 6 s left");
        assert_eq!(described(full, 0, 0).as_deref(), expected);
        let endless = "\"total\":0,\"misses\":0,\"load_permille\":[]";
        let expected = Some("12 jobs, 0 missed");
        assert_eq!(described(endless, 1, 1).as_deref(), expected);
        let loads = ["1000"; 64].join(",");
        let many = format!("\"total\":60,\"misses\":3,\"load_permille\":[{loads}]");
        assert_eq!(described(&many, 1, 1).map(|it| it.len()), Some(WIDTH));
    }
}
