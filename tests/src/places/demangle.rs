//! From a symbol's name to the name that its author gave.
//!
//! The compiler has two schemes: the legacy one (`_ZN`, lengths and names, `E`;
//! as in C++, with escapes and a hash) for what we compile, and `v0` (`_R`) for
//! much of its own library. What is neither, such as a label in assembly, stays.

use super::v0;

/// Returns the readable form of a symbol's name, or the name itself.
pub(super) fn demangle(symbol: &str) -> String {
    // What the optimizer appends says nothing about the source: `.llvm.1`, `.2`.
    let plain = symbol.split('.').next().unwrap_or(symbol);
    let readable = v0::demangle(plain).or_else(|| legacy(symbol));
    readable.unwrap_or_else(|| symbol.into())
}

fn legacy(name: &str) -> Option<String> {
    let mut rest = name.strip_prefix("_ZN")?;
    let mut parts = Vec::new();
    while rest != "E" && !rest.starts_with("E.") {
        let digits = rest.find(|letter: char| !letter.is_ascii_digit())?;
        let length: usize = rest[..digits].parse().ok()?;
        let end = digits.checked_add(length)?;
        parts.push(rest.get(digits..end)?);
        rest = rest.get(end..)?;
    }
    parts.pop_if(|part| is_hash(part));
    let parts: Vec<String> = parts.into_iter().map(unescape).collect();
    (!parts.is_empty()).then(|| parts.join("::"))
}

fn is_hash(part: &str) -> bool {
    let digits = part.strip_prefix('h');
    digits.is_some_and(|digits| digits.len() == 16 && digits.bytes().all(|d| d.is_ascii_hexdigit()))
}

/// Resolves the escapes for what may not stand in a symbol: `$LT$`, `$u20$`.
fn unescape(part: &str) -> String {
    // An underscore stands before an escape at the beginning.
    let mut rest = match part.strip_prefix('_') {
        Some(escaped) if escaped.starts_with('$') => escaped,
        _ => part,
    };
    let mut text = String::new();
    while let Some(letter) = rest.chars().next() {
        let escape = rest.strip_prefix('$').and_then(|rest| rest.split_once('$'));
        if let Some((escaped, after)) = escape.and_then(|(e, after)| Some((resolve(e)?, after))) {
            text.push(escaped);
            rest = after;
        } else if let Some(after) = rest.strip_prefix("..") {
            text.push_str("::");
            rest = after;
        } else {
            text.push(letter);
            rest = &rest[letter.len_utf8()..];
        }
    }
    text
}

fn resolve(escape: &str) -> Option<char> {
    let known = [
        ("SP", '@'),
        ("BP", '*'),
        ("RF", '&'),
        ("LT", '<'),
        ("GT", '>'),
        ("LP", '('),
        ("RP", ')'),
        ("C", ','),
    ];
    let hex = || char::from_u32(u32::from_str_radix(escape.strip_prefix('u')?, 16).ok()?);
    let found = known.iter().find(|(name, _)| *name == escape);
    found.map(|(_, letter)| *letter).or_else(hex)
}

#[cfg(test)]
mod tests {
    use super::demangle;

    #[test]
    fn legacy_names_lose_their_hash_and_escapes() {
        for (symbol, name) in [
            (
                "_ZN6faults6crimes11read_wildly17h117ab146529e4b3fE",
                "faults::crimes::read_wildly",
            ),
            (
                "_ZN68_$LT$kernel..json..Fields$LT$F$GT$$u20$as$u20$core..fmt..Display$GT$\
                 3fmt17hf4e6afedaf45cc63E",
                "<kernel::json::Fields<F> as core::fmt::Display>::fmt",
            ),
            (
                "_ZN5alloc2rc15Rc$LT$T$C$A$GT$9drop_slow17hd1c84bf6303bbfb2E.llvm.123",
                "alloc::rc::Rc<T,A>::drop_slow",
            ),
            ("_ZN3app4mainE", "app::main"),
        ] {
            assert_eq!(demangle(symbol), name);
        }
    }

    #[test]
    fn what_is_not_mangled_stays() {
        for symbol in [
            "interrupt_common",
            "_ZN3ap",
            "_ZN99xE",
            "_ZNE",
            "_Rxyz",
            "",
            "_ZN1$E",
        ] {
            let name = demangle(symbol);
            assert!(
                name == symbol || symbol == "_ZN1$E" && name == "$",
                "{name}"
            );
        }
    }
}
