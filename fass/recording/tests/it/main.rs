//! Recordings from outside: files, and the values in them.

mod files;
mod values;
