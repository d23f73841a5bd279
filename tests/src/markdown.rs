//! The blocks of a page in Markdown.
//!
//! A *block* is the text between two fences; its *info* is the text behind the first fence, such as
//! `rust` or `text output-new-app`.

use std::fs;

use tool::system::workspace;

/// A block of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The text of the opening fence.
    pub info: String,
    /// The block's lines, each with its newline.
    pub text: String,
}

/// Reads a file of the workspace: a page, or a source.
///
/// # Panics
///
/// Panics if the file cannot be read.
#[track_caller]
pub fn page(path: &str) -> String {
    let text = fs::read_to_string(workspace().join(path));
    text.unwrap_or_else(|why| panic!("{path}: {why}"))
}

/// Takes the blocks out of a page.
pub fn blocks(page: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), open.as_mut()) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(info), None) => {
                open = Some(Block {
                    info: info.into(),
                    text: String::new(),
                });
            }
            (None, Some(block)) => block.text += &format!("{line}\n"),
            (None, None) => {}
        }
    }
    // A fence without end would hide the rest of the page.
    blocks.extend(open);
    blocks
}
