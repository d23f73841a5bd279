//! A source file without its comments and literals, so that a check of the tree
//! reads code and nothing that only looks like it.

/// Returns the text with comments and literals left out, line ends kept.
pub(super) fn code_only(text: &str) -> String {
    let mut code = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let skipped = literal_or_comment(rest);
        let (taken, keep) = match skipped {
            0 => (first.len_utf8(), true),
            length => (length, false),
        };
        if keep {
            code.push(first);
        } else {
            code.push(' ');
            code.extend(rest[..taken].chars().filter(|c| *c == '\n'));
        }
        rest = &rest[taken..];
    }
    code
}

/// Returns the length of the comment or literal that `text` begins with; 0 if
/// it begins with neither.
fn literal_or_comment(text: &str) -> usize {
    let until = |end: &str, from: usize| {
        let found = text[from..].find(end);
        found.map_or(text.len(), |at| from + at + end.len())
    };
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        return block_comment(text);
    }
    if text.starts_with('"') {
        return quoted(text, '"');
    }
    if let Some(raw) = text.strip_prefix('r') {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        if raw[hashes..].starts_with('"') {
            let end = format!("\"{}", "#".repeat(hashes));
            return until(&end, hashes + 2);
        }
    }
    let mut characters = text.chars();
    if characters.next() == Some('\'') {
        // A lifetime has no closing quote after its first character.
        let (first, second) = (characters.next(), characters.next());
        if first == Some('\\') || second == Some('\'') {
            return quoted(text, '\'');
        }
    }
    0
}

fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Block comments nest in Rust.
fn block_comment(text: &str) -> usize {
    let mut depth = 0_usize;
    let mut at = 0;
    while at < text.len() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return at;
            }
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::code_only;

    #[test]
    fn comments_and_literals_are_left_out_and_lines_kept() {
        for (text, code) in [
            ("a // b\nc", "a  \nc"),
            ("a /* b\n/* c */\n*/ d", "a  \n\n d"),
            ("f(\"x \\\" y\")", "f( )"),
            ("r#\"a \" b\"# c", "  c"),
            ("'\"' b", "  b"),
            ("<'a>(x: &'a u8)", "<'a>(x: &'a u8)"),
        ] {
            assert_eq!(code_only(text), code, "{text}");
        }
    }
}
