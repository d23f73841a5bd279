//! Pictures as SVG: text and shapes at whole pixels, on white.
//!
//! A picture is a text, and grows with each shape; later shapes cover earlier shapes.

use std::fmt::Write;

/// A picture.
#[derive(Debug, Default)]
pub struct Svg(String);

// Writing into a `String` cannot fail.
impl Svg {
    /// Adds text on a line that begins, ends or has its middle at a point, as `anchor` says.
    pub fn text(&mut self, (x, y): (u64, u64), anchor: &str, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        let at = format!(r#"x="{x}" y="{y}" text-anchor="{anchor}""#);
        let _ = writeln!(self.0, "<text {at}>{text}</text>");
    }

    /// Adds a box with its left upper corner at a point.
    pub fn rect(&mut self, (x, y): (u64, u64), (width, height): (u64, u64), fill: &str) {
        let at = format!(r#"x="{x}" y="{y}" width="{width}" height="{height}""#);
        let style = format!("rx=\"3\" fill=\"{fill}\" stroke=\"#333333\"");
        let _ = writeln!(self.0, "<rect {at} {style}/>");
    }

    /// Adds a line with attributes.
    pub fn line(&mut self, (x1, y1): (u64, u64), (x2, y2): (u64, u64), style: &str) {
        let ends = format!(r#"x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}""#);
        let _ = writeln!(self.0, "<line {ends} {style}/>");
    }

    /// Adds a path in SVG's own words, with attributes.
    pub fn path(&mut self, path: &str, style: &str) {
        let _ = writeln!(self.0, "<path d=\"{path}\" {style}/>");
    }

    /// Returns the picture as the text of a file.
    pub fn into_text(self, (width, height): (u64, u64)) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            self.0
        )
    }
}
