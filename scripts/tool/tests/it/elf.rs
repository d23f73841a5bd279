//! An image: its bytes that count, and a refusal of any other file.

use tool::elf::{check_bootable, loaded, stripped_bytes};

use crate::tiny::{TinyEnd, tiny_image};

#[test]
fn what_is_loaded_is_what_is_left_without_symbols_which_do_not_count() {
    let image = tiny_image("hello", TinyEnd::Never);
    let bytes = u64::try_from(image.len()).expect("an image");
    let stripped = stripped_bytes(&image).expect("an image");
    assert!((bytes..bytes + 256).contains(&stripped), "{stripped}");
    let mut with_symbols = image.clone();
    with_symbols.extend([7; 5000]);
    assert_eq!(stripped_bytes(&with_symbols), Ok(stripped));
    with_symbols[40] = 200; // the table of sections lies among them
    with_symbols[60] = 3;
    let alone = loaded(image.clone()).expect("an image");
    assert_eq!(alone.len(), image.len());
    assert_eq!(loaded(with_symbols), Ok(alone));
    let error = loaded(image[..image.len() - 1].to_vec()).unwrap_err();
    assert_eq!(error, "a segment lies outside the file");
}

/// `files.rs` has programs and texts that are refused.
#[test]
fn an_image_is_told_from_other_files() {
    let mut image = tiny_image("hello", TinyEnd::Exit(0x10));
    assert_eq!(check_bootable(&image), Ok(()));
    let cut = Err("a header points outside the file".into());
    assert_eq!(check_bootable(&image[..100]), cut);
    assert_eq!(stripped_bytes(&image[..100]).map(drop), cut);
    assert!(loaded(b"#!/bin/sh".to_vec()).is_err());
    let mut owners = image.windows(4);
    let note = owners.position(|bytes| bytes == b"Xen\0");
    let note = note.expect("an image");
    image[note] = b'x';
    assert!(check_bootable(&image).unwrap_err().contains("PVH note"));
}
