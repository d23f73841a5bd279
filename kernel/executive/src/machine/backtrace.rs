//! Backtraces: finds the calls on a stack, for the report of a fault.
//!
//! Code is compiled without frame pointers, and images have no unwind tables, to save time and
//! room. The stack is therefore read word by word: any code address right after a call instruction
//! counts as a return address. Some of these words are left over from calls already finished,
//! because functions do not write to all of their frame. Each call therefore comes with its callee,
//! if the instruction names it: the host knows where functions begin, and follows the chain.

use boot_entry::image;

use super::this_core;

/// The most words read of a stack: 8 KiB, since interrupts are disabled meanwhile.
const WORDS: u64 = 1024;

/// The longest call instruction, in bytes: two of REX and opcode, a ModRM, a SIB, four of
/// displacement, in the forms used by compilers (Intel SDM 2, `CALL`).
const LONGEST: usize = 7;

/// The return address of a call, and its callee.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CallSite {
    /// The address after the call instruction.
    pub returns_to: u64,
    /// The address of the called function; `None` if held in a register or memory.
    pub callee: Option<u64>,
}

/// Returns the calls on this core's stack from `stack_pointer` on, the innermost first; none if the
/// address is outside the stack.
pub fn calls(stack_pointer: u64) -> impl Iterator<Item = CallSite> {
    let core = this_core::is_ready().then(this_core::get);
    let stack = core.and_then(|core| core.context().stack_at(stack_pointer));
    let stack = stack.unwrap_or(0..0);
    let start = stack_pointer.max(stack.start).next_multiple_of(8);
    let words = stack.end.saturating_sub(start) / 8;
    (0..words.min(WORDS)).filter_map(move |index| {
        let word = (start + index * 8) as *const u64;
        // SAFETY: the word lies in the stack of the context that this core runs, which is
        // mapped for good; what the code above it on the same stack writes, it has written.
        before(unsafe { word.read_volatile() })
    })
}

/// Returns the call with return address `address`, if the code before is a call.
fn before(address: u64) -> Option<CallSite> {
    let text = image::text();
    let start = address.checked_sub(LONGEST as u64)?;
    if start < text.start || address > text.end {
        return None;
    }
    // SAFETY: the bytes are the image's code, which is mapped and constant.
    let bytes = unsafe { *(start as *const [u8; LONGEST]) };
    let callee = decode(bytes)?.map(|distance| address.wrapping_add_signed(distance));
    if callee.is_some_and(|callee| !text.contains(&callee)) {
        return None;
    }
    Some(CallSite {
        returns_to: address,
        callee,
    })
}

/// Decodes the call instruction at the end of these bytes, if there is one: the distance of the
/// jump, or `None` if a register or memory has the address.
fn decode(bytes: [u8; LONGEST]) -> Option<Option<i64>> {
    match bytes {
        [_, _, 0xe8, a, b, c, d] => Some(Some(i64::from(i32::from_le_bytes([a, b, c, d])))),
        // Through a register; through memory that a register points to, with a displacement
        // of no, one or four bytes; and through a word near the instruction.
        [.., 0xff, 0xd0..=0xd7 | 0x10..=0x13 | 0x16 | 0x17]
        | [.., 0xff, 0x50..=0x53 | 0x55..=0x57 | 0x14, _]
        | [.., 0xff, 0x54, _, _]
        | [_, 0xff, 0x15 | 0x90..=0x93 | 0x95..=0x97, ..]
        | [0xff, 0x94, ..] => Some(None),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn calls_are_told_from_what_else_ends_there() {
        assert_eq!(decode([0, 0, 0xe8, 0xfe, 0xff, 0xff, 0xff]), Some(Some(-2)));
        assert_eq!(decode([0, 0, 0xe8, 0, 1, 0, 0]), Some(Some(256)));
        let indirect = [
            [0, 0, 0, 0, 0, 0xff, 0xd0],       // call rax
            [0, 0, 0, 0, 0x41, 0xff, 0xd7],    // call r15
            [0, 0, 0, 0, 0, 0xff, 0x13],       // call [rbx]
            [0, 0, 0, 0, 0xff, 0x50, 0x18],    // call [rax + 24]
            [0, 0, 0, 0xff, 0x54, 0x24, 8],    // call [rsp + 8]
            [0, 0xff, 0x15, 1, 2, 3, 0],       // call [rip + ...]
            [0, 0xff, 0x93, 0x80, 0, 0, 0],    // call [rbx + 128]
            [0xff, 0x94, 0x24, 0x80, 0, 0, 0], // call [rsp + 128]
        ];
        for bytes in indirect {
            assert_eq!(decode(bytes), Some(None), "{bytes:x?}");
        }
        assert_eq!(decode([0, 0, 0xe9, 0, 1, 0, 0]), None, "a jump");
        assert_eq!(decode([0, 0, 0, 0, 0, 0xff, 0xe0]), None, "a jump");
        assert_eq!(decode([0; 7]), None);
    }
}
