//! Values as bytes, and what their types look like.

pub(crate) mod containers;
pub(crate) mod crc;
pub(crate) mod decode;
pub(crate) mod encode;
pub(crate) mod recordable;
pub(crate) mod schema;
pub(crate) mod schema_bytes;
pub(crate) mod shown;
pub(crate) mod structs;
pub(crate) mod text;
pub(crate) mod walk;
