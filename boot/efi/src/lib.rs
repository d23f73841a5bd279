//! A loader of images where a firmware has UEFI and nothing else: the parts of
//! it that only look at bytes.
//!
//! The *application* (`main.rs`) is a PE file that the firmware starts. The host tool makes
//! it, and puts the image, the words and the module into it as sections ([`mod@file`]). The
//! application lays the image out where it belongs, tells it what GRUB would tell ([`list`]),
//! leaves the firmware and enters the image where GRUB would. So the image knows nothing of
//! UEFI.
//!
//! The application runs wherever the firmware has put it. Its few absolute addresses are
//! those that the linker lists; the host tool has the firmware correct them, and refuses
//! any other.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod file;
pub mod list;
