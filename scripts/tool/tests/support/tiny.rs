//! A guest of a few instructions, made in memory.
//!
//! It prints a given text on the first serial port, then ends QEMU with a given byte or halts for
//! good. It needs no compiler and no kernel, so it shows by itself whether the tool's own way of
//! starting, reading and ending QEMU works.
//!
//! The image is an ELF file with the note that makes QEMU's `-kernel` enter
//! it by PVH: 32-bit protected mode, flat segments, at the address in the
//! note ("x86/HVM direct boot ABI", `docs/misc/pvh.pandoc` of Xen).

/// Where the image is loaded and entered: above the first MiB.
const BASE: u32 = 0x10_0000;

/// The ELF header and two program headers.
const HEADERS: u32 = 64 + 2 * 56;

/// The PVH note: its header, the name `Xen`, and one 32-bit address.
const NOTE: u32 = 20;

/// Xen's number for the note that holds the 32-bit entry address.
const XEN_ELFNOTE_PHYS32_ENTRY: u32 = 18;

/// How a tiny guest ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TinyEnd {
    /// By writing this byte to QEMU's exit port.
    Exit(u8),
    /// Never: it halts with no interrupt to wake it.
    Never,
}

/// Returns the image of a guest that prints `text` and then ends as `end` says.
pub(crate) fn tiny_image(text: &str, end: TinyEnd) -> Vec<u8> {
    let code_at = BASE + HEADERS + NOTE;
    let length = u32::try_from(text.len()).expect("a tiny guest's text is short");
    let code = code(code_at, length, end);
    let code_length = u32::try_from(code.len()).expect("the code has some 30 bytes");
    let file_length = HEADERS + NOTE + code_length + length;

    // 64-bit, little-endian, version 1; executable, x86-64, version 1.
    let mut image = b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x02\0\x3e\0\x01\0\0\0".to_vec();
    let longs = |image: &mut Vec<u8>, longs: &[u32]| {
        image.extend(longs.iter().flat_map(|long| u64::from(*long).to_le_bytes()));
    };
    // Program headers follow at once, and there are no sections and no flags.
    longs(&mut image, &[code_at, 64, 0]);
    image.extend([0; 4]);
    image.extend(
        [64_u16, 56, 2, 64, 0, 0]
            .iter()
            .flat_map(|half| half.to_le_bytes()),
    );
    for (kind, offset, length) in [(PT_LOAD, 0, file_length), (PT_NOTE, HEADERS, NOTE)] {
        let readable_executable = 5;
        let address = BASE + offset;
        image.extend(
            [kind, readable_executable]
                .iter()
                .flat_map(|word| word.to_le_bytes()),
        );
        longs(&mut image, &[offset, address, address, length, length, 4]);
    }
    for word in [4, 4, XEN_ELFNOTE_PHYS32_ENTRY] {
        image.extend(u32::to_le_bytes(word));
    }
    image.extend(b"Xen\0");
    image.extend(code_at.to_le_bytes());
    image.extend(code);
    image.extend(text.bytes());
    image
}

const PT_LOAD: u32 = 1;
const PT_NOTE: u32 = 4;

fn code(code_at: u32, text_length: u32, end: TinyEnd) -> Vec<u8> {
    // The first instruction's operand is the text's address, which depends on
    // the length of the code but not the other way round.
    let make = |text_at: u32| {
        let mut code = vec![0xbe]; // mov esi, text
        code.extend(text_at.to_le_bytes());
        code.push(0xb9); // mov ecx, length
        code.extend(text_length.to_le_bytes());
        code.extend([0x66, 0xba, 0xf8, 0x03]); // mov dx, 0x3f8: first serial port
        code.push(0xfc); // cld
        code.extend([0xe3, 0x04]); // jecxz over the loop
        code.extend([0xac, 0xee, 0xe2, 0xfc]); // again: lodsb; out dx, al; loop again
        if let TinyEnd::Exit(value) = end {
            code.extend([0xb0, value, 0xe6, 0xf4]); // mov al, value; out 0xf4, al
        }
        code.extend([0xfa, 0xf4, 0xeb, 0xfd]); // cli; halt: hlt; jmp halt
        code
    };
    let length = u32::try_from(make(0).len()).expect("the code has some 30 bytes");
    make(code_at + length)
}
