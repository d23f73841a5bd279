//! The form of an answer: a head in JSON, then columns of numbers.
//!
//! The head's length comes first, in four bytes, the least significant byte first. Blanks pad the
//! head so that the columns begin at a multiple of 8, as each column does. So a script sees the
//! columns as arrays of numbers without copying.

use views::json::Object;

/// Columns, each with its name and the type of its elements in the head.
#[derive(Default)]
pub(crate) struct TypedColumns {
    head: Vec<String>,
    bytes: Vec<u8>,
}

impl TypedColumns {
    fn add<const N: usize>(&mut self, names: [&str; 2], values: impl Iterator<Item = [u8; N]>) {
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        let from = self.bytes.len();
        values.for_each(|value| self.bytes.extend_from_slice(&value));
        let count = (self.bytes.len() - from) / N;
        let column = Object::new().text("name", names[0]).text("type", names[1]);
        let column = column.number("from", from as u64);
        let column = column.number("count", count as u64);
        self.head.push(column.into_text());
    }

    /// Adds a column of times in nanoseconds; NaN for a missing time.
    pub(crate) fn times(&mut self, name: &str, values: impl Iterator<Item = Option<u64>>) {
        #[allow(
            clippy::cast_precision_loss,
            reason = "exact up to 2^53 ns, which is 104 days"
        )]
        let float = |ns: Option<u64>| ns.map_or(f64::NAN, |ns| ns as f64).to_le_bytes();
        self.add([name, "Float64Array"], values.map(float));
    }

    /// Adds a column of numbers.
    pub(crate) fn numbers(&mut self, name: &str, values: impl Iterator<Item = u64>) {
        let number = |value| u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes();
        self.add([name, "Uint32Array"], values.map(number));
    }

    /// Adds a column of bytes.
    pub(crate) fn bytes(&mut self, name: &str, values: impl Iterator<Item = u8>) {
        self.add([name, "Uint8Array"], values.map(|value| [value]));
    }

    /// Returns the answer with a head and the columns.
    pub(crate) fn under(self, head: Object) -> Vec<u8> {
        framed(&head.list("columns", self.head).into_text(), &self.bytes)
    }
}

/// Returns a head, with the bytes of columns.
pub(crate) fn framed(head: &str, bytes: &[u8]) -> Vec<u8> {
    let mut head = head.as_bytes().to_vec();
    head.resize((head.len() + 4).next_multiple_of(8) - 4, b' ');
    let length = u32::try_from(head.len()).unwrap_or(u32::MAX).to_le_bytes();
    [&length[..], &head, bytes].concat()
}
