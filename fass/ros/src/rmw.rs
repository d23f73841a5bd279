//! The formats of `rmw_zenoh` on a wire: names allowed by ROS 2, and keys, tokens and attachments.

use alloc::format;
use alloc::string::String;

use super::options::NodeOptions;

/// Reports whether ROS 2 allows a name, absolute or relative: letters, digits and single `_`, no
/// digit first, between `/`.
///
/// ```
/// assert!(["imu", "/robot/imu_2"].map(ros::is_name).iter().all(|is| *is));
/// assert!(!["", "/", "a//b", "2d", "a__b", "a-b", "a/"].map(ros::is_name).iter().any(|is| *is));
/// ```
#[must_use]
pub fn is_name(name: &str) -> bool {
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let is_part = |part: &str| {
        !part.is_empty()
            && !part.starts_with(|letter: char| letter.is_ascii_digit())
            && part.chars().all(is_letter)
    };
    let parts = name.strip_prefix('/').unwrap_or(name);
    // The longest name for which other participants have room.
    parts.len() < 247 && !name.contains("__") && parts.split('/').all(is_part)
}

/// Returns a name with its namespace, and without the `/` at its start.
pub(crate) fn absolute(namespace: &str, name: &str) -> String {
    let namespace = namespace.trim_matches('/');
    match name.strip_prefix('/') {
        Some(name) => name.into(),
        None if namespace.is_empty() => name.into(),
        None => format!("{namespace}/{name}"),
    }
}

/// Returns the type and the hash of a topic in the form used in keys.
pub(crate) fn type_in_keys(name: &str, hash: &str) -> String {
    let (package, name) = name.rsplit_once('/').unwrap_or_default();
    format!(
        "{}::dds_::{name}_/RIHS01_{hash}",
        package.replace('/', "::")
    )
}

/// Returns the token of a node, or of its topic given by `rest`. `id` numbers both.
pub(crate) fn token(of: &NodeOptions, node: &str, kind: &str, id: usize, rest: &str) -> String {
    let (domain, identity) = (of.domain, of.identity);
    let namespace = of.namespace.trim_matches('/').replace('/', "%");
    format!("@ros2_lv/{domain}/{identity:x}/0/{id}/{kind}/%/%{namespace}/{node}{rest}")
}

/// Returns the attachment of a message: its number, its Unix time and its publication, each bare.
/// Other bytes end the process of a subscriber.
pub(crate) fn attachment(number: u64, unix_ns: u64, publication: u128) -> [u8; 33] {
    let mut bytes = [16; 33]; // how many bytes the publication has
    bytes[..8].copy_from_slice(&number.to_le_bytes());
    bytes[8..16].copy_from_slice(&unix_ns.to_le_bytes());
    bytes[17..].copy_from_slice(&publication.to_le_bytes());
    bytes
}
