//! The compiler's `v0` names ("Rust Symbol Mangling (v0)", RFC 2603).
//!
//! A symbol is `_R` and a path in prefix form: `Nv` *path* *identifier* is an
//! item in a path, `C` *identifier* a crate, `X`, `Y` and `M` are impls, `I` has
//! generic arguments, and `B` points back to a place in the same symbol. What the
//! reader does not know (constants other than numbers) makes it give up.

/// The parts that one symbol may have, so that no symbol takes for ever.
const MOST_PARTS: u32 = 1000;

/// Returns the readable form of a `v0` symbol.
pub(super) fn demangle(symbol: &str) -> Option<String> {
    let mut reader = Reader {
        text: symbol.strip_prefix("_R")?.as_bytes(),
        at: 0,
        parts_left: MOST_PARTS,
    };
    let path = reader.path()?;
    // The crate that caused an instantiation may follow.
    if reader.at < reader.text.len() {
        reader.path()?;
    }
    (reader.at == reader.text.len()).then_some(path)
}

struct Reader<'a> {
    text: &'a [u8],
    at: usize,
    parts_left: u32,
}

impl Reader<'_> {
    fn path(&mut self) -> Option<String> {
        match self.part()? {
            b'C' => Some(self.identifier()?.0),
            b'N' => self.item(),
            b'M' => {
                self.impl_path()?;
                Some(format!("<{}>", self.type_name()?))
            }
            b'X' => {
                self.impl_path()?;
                self.trait_impl()
            }
            b'Y' => self.trait_impl(),
            b'I' => {
                let path = self.path()?;
                let arguments = self.until_end(Self::generic)?.join(", ");
                Some(format!("{path}<{arguments}>"))
            }
            b'B' => self.back_reference(Self::path),
            _ => None,
        }
    }

    fn item(&mut self) -> Option<String> {
        let namespace = self.next()?;
        let path = self.path()?;
        let (name, number) = self.identifier()?;
        Some(match (namespace, name.as_str()) {
            (b'C', "") => format!("{path}::{{closure#{number}}}"),
            (b'A'..=b'Z', _) => format!("{path}::{{{name}#{number}}}"),
            (_, "") => path,
            _ => format!("{path}::{name}"),
        })
    }

    /// Reads where an impl stands, which a name need not say.
    fn impl_path(&mut self) -> Option<()> {
        self.disambiguator()?;
        self.path().map(drop)
    }

    fn trait_impl(&mut self) -> Option<String> {
        let of = self.type_name()?;
        Some(format!("<{of} as {}>", self.path()?))
    }

    fn generic(&mut self) -> Option<String> {
        if self.takes(b'L') {
            self.base_62()?;
            Some("'_".into())
        } else if self.takes(b'K') {
            self.constant()
        } else {
            self.type_name()
        }
    }

    fn type_name(&mut self) -> Option<String> {
        let tag = self.part()?;
        if let Some(name) = basic(tag) {
            return Some(name.into());
        }
        match tag {
            b'A' => Some(format!("[{}; {}]", self.type_name()?, self.constant()?)),
            b'S' => Some(format!("[{}]", self.type_name()?)),
            b'T' => Some(format!("({})", self.until_end(Self::type_name)?.join(", "))),
            b'R' => self.reference("&"),
            b'Q' => self.reference("&mut "),
            b'P' => Some(format!("*const {}", self.type_name()?)),
            b'O' => Some(format!("*mut {}", self.type_name()?)),
            b'F' => self.function(),
            b'D' => self.dynamic(),
            b'B' => self.back_reference(Self::type_name),
            _ => {
                self.at -= 1;
                self.path()
            }
        }
    }

    fn reference(&mut self, sign: &str) -> Option<String> {
        if self.takes(b'L') {
            self.base_62()?;
        }
        Some(format!("{sign}{}", self.type_name()?))
    }

    fn function(&mut self) -> Option<String> {
        self.binder()?;
        let is_unsafe = if self.takes(b'U') { "unsafe " } else { "" };
        if self.takes(b'K') && !self.takes(b'C') {
            self.plain_identifier()?;
        }
        let arguments = self.until_end(Self::type_name)?.join(", ");
        Some(match self.type_name()?.as_str() {
            "()" => format!("{is_unsafe}fn({arguments})"),
            returned => format!("{is_unsafe}fn({arguments}) -> {returned}"),
        })
    }

    fn dynamic(&mut self) -> Option<String> {
        self.binder()?;
        let bounds = self.until_end(Self::dynamic_bound)?.join(" + ");
        if self.takes(b'L') {
            self.base_62()?;
        }
        Some(format!("dyn {bounds}"))
    }

    fn dynamic_bound(&mut self) -> Option<String> {
        let mut bound = self.path()?;
        while self.takes(b'p') {
            let name = self.plain_identifier()?;
            bound = format!("{bound}<{name} = {}>", self.type_name()?);
        }
        Some(bound)
    }

    fn constant(&mut self) -> Option<String> {
        match self.part()? {
            b'p' => Some("_".into()),
            b'B' => self.back_reference(Self::constant),
            tag => {
                basic(tag)?;
                let sign = if self.takes(b'n') { "-" } else { "" };
                let length = self.text[self.at..].iter().position(|byte| *byte == b'_')?;
                let digits = self.text.get(self.at..self.at + length)?;
                self.at += length + 1;
                let digits = if digits.is_empty() { b"0" } else { digits };
                let value = u128::from_str_radix(str::from_utf8(digits).ok()?, 16).ok()?;
                Some(format!("{sign}{value}"))
            }
        }
    }

    fn back_reference(&mut self, read: fn(&mut Self) -> Option<String>) -> Option<String> {
        let begin = self.at - 1;
        let target = usize::try_from(self.base_62()?).ok()?;
        let after = self.at;
        // Only back, so that following ends.
        self.at = (target < begin).then_some(target)?;
        let name = read(self);
        self.at = after;
        name
    }

    fn until_end(&mut self, read: fn(&mut Self) -> Option<String>) -> Option<Vec<String>> {
        let mut names = Vec::new();
        while !self.takes(b'E') {
            names.push(read(self)?);
        }
        Some(names)
    }

    fn binder(&mut self) -> Option<()> {
        if self.takes(b'G') {
            self.base_62()?;
        }
        Some(())
    }

    /// Reads a name and the number that tells it from others of that name.
    fn identifier(&mut self) -> Option<(String, u64)> {
        let number = self.disambiguator()?;
        Some((self.plain_identifier()?, number))
    }

    fn plain_identifier(&mut self) -> Option<String> {
        // Letters beyond ASCII would be in punycode, which stays as it is.
        self.takes(b'u');
        let length = self.decimal()?;
        self.takes(b'_');
        let end = self.at.checked_add(length)?;
        let name = self.text.get(self.at..end)?;
        self.at = end;
        Some(str::from_utf8(name).ok()?.into())
    }

    /// Reads a length. It has no leading zero: a digit after a 0 is of the next part.
    fn decimal(&mut self) -> Option<usize> {
        if self.takes(b'0') {
            return Some(0);
        }
        let rest = self.text.get(self.at..)?;
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        self.at += digits;
        str::from_utf8(&rest[..digits]).ok()?.parse().ok()
    }

    fn disambiguator(&mut self) -> Option<u64> {
        if self.takes(b's') {
            self.base_62()?.checked_add(1)
        } else {
            Some(0)
        }
    }

    /// Reads a number: `_` is 0, and otherwise the digits are of one less.
    fn base_62(&mut self) -> Option<u64> {
        let mut value = 0u64;
        if self.takes(b'_') {
            return Some(0);
        }
        loop {
            let digit = match self.next()? {
                b'_' => return value.checked_add(1),
                digit @ b'0'..=b'9' => digit - b'0',
                digit @ b'a'..=b'z' => digit - b'a' + 10,
                digit @ b'A'..=b'Z' => digit - b'A' + 36,
                _ => return None,
            };
            value = value.checked_mul(62)?.checked_add(digit.into())?;
        }
    }

    /// Takes the letter that begins a part.
    fn part(&mut self) -> Option<u8> {
        self.parts_left = self.parts_left.checked_sub(1)?;
        self.next()
    }

    fn next(&mut self) -> Option<u8> {
        let byte = *self.text.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn takes(&mut self, byte: u8) -> bool {
        let is_next = self.text.get(self.at) == Some(&byte);
        self.at += usize::from(is_next);
        is_next
    }
}

fn basic(tag: u8) -> Option<&'static str> {
    Some(match tag {
        b'a' => "i8",
        b'b' => "bool",
        b'c' => "char",
        b'd' => "f64",
        b'e' => "str",
        b'f' => "f32",
        b'h' => "u8",
        b'i' => "isize",
        b'j' => "usize",
        b'l' => "i32",
        b'm' => "u32",
        b'n' => "i128",
        b'o' => "u128",
        b'p' => "_",
        b's' => "i16",
        b't' => "u16",
        b'u' => "()",
        b'v' => "...",
        b'x' => "i64",
        b'y' => "u64",
        b'z' => "!",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::demangle;

    #[test]
    fn names_of_the_library_are_readable() {
        for (symbol, name) in [
            (
                "_RNvCsfLfy6EI15iL_7___rustc12___rust_alloc",
                "__rustc::__rust_alloc",
            ),
            (
                "_RNvXsq_NtCslNYArtu3iFV_5alloc6stringNtB5_6StringNtNtCsgEmfK2I1SDS_4core3fmt7\
                 Display3fmt",
                "<alloc::string::String as core::fmt::Display>::fmt",
            ),
            ("_RNvMNtCs1_4core5sliceSh4sort", "<[u8]>::sort"),
            (
                "_RNCINvNtC3app4main4workAhj10_RNtB4_3JobE0B4_",
                "app::main::work<[u8; 16], &app::main::Job>::{closure#0}",
            ),
            (
                "_RNCNCNCNvC3app4main00s_0",
                "app::main::{closure#0}::{closure#0}::{closure#1}",
            ),
            (
                "_RINvC3app4callFUKCmEuDNtB2_6DetectEL_E",
                "app::call<unsafe fn(u32), dyn app::Detect>",
            ),
        ] {
            assert_eq!(demangle(symbol).as_deref(), Some(name), "{symbol}");
        }
    }

    #[test]
    fn what_is_damaged_or_unknown_is_given_up() {
        let good = "_RNCINvNtC3app4main4workAhj10_RNtB4_3JobE0B4_";
        assert!(demangle(good).is_some());
        for end in 0..good.len() {
            let _ = demangle(&good[..end]);
        }
        for symbol in [
            "_R",
            "_RB_",
            "_RNvB_3app",
            "_RC99x",
            "_RNvC3app4main?",
            "_RCzzzzzzzzzzzzzzz_",
        ] {
            assert_eq!(demangle(symbol), None, "{symbol}");
        }
    }
}
