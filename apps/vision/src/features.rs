//! What stands out in an image: smoothing by a convolution, and corners.

use crate::image::{SIDE, at};

/// The most features of an image: a tile has one at most.
pub const MOST: usize = 64;

/// Rows and columns of a tile.
const TILE: usize = 16;

/// No feature is so near to an image's edge, for its surroundings are compared.
pub const MARGIN: usize = 16;

/// Less is noise.
const THRESHOLD: i32 = 24;

/// A place where brightness changes along the row and along the column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Feature {
    /// Where it is.
    pub row: usize,
    /// Where it is.
    pub column: usize,
}

/// The features of an image.
#[derive(Clone, Copy, Debug)]
pub struct Features {
    all: [Feature; MOST],
    count: usize,
}

impl Features {
    /// Returns them, from the image's top down.
    #[must_use]
    pub fn all(&self) -> &[Feature] {
        &self.all[..self.count]
    }
}

/// Smooths an image by the binomial kernel of three rows and three columns.
pub fn smooth(pixels: &[u8], into: &mut [u8]) {
    into.copy_from_slice(pixels);
    let rows = pixels.windows(3 * SIDE).step_by(SIDE);
    for (three, line) in rows.zip(into.chunks_exact_mut(SIDE).skip(1)) {
        let (above, rest) = three.split_at(SIDE);
        let (own, below) = rest.split_at(SIDE);
        let columns = above.windows(3).zip(own.windows(3)).zip(below.windows(3));
        for (((above, own), below), pixel) in columns.zip(&mut line[1..]) {
            let sum = weighed(above) + 2 * weighed(own) + weighed(below);
            *pixel = u8::try_from(sum / 16).unwrap_or(u8::MAX);
        }
    }
}

/// Weighs three pixels side by side, the middle one twice.
fn weighed(three: &[u8]) -> u32 {
    let [before, here, after] = [0, 1, 2].map(|at| u32::from(three[at]));
    before + 2 * here + after
}

/// Finds the strongest feature of each tile, as far as there are so many.
#[must_use]
pub fn find(pixels: &[u8]) -> Features {
    let mut found = Features {
        all: [Feature::default(); MOST],
        count: 0,
    };
    for top in (MARGIN..SIDE - MARGIN).step_by(TILE) {
        for left in (MARGIN..SIDE - MARGIN).step_by(TILE) {
            if found.count < MOST
                && let Some(feature) = strongest(pixels, top, left)
            {
                found.all[found.count] = feature;
                found.count += 1;
            }
        }
    }
    found
}

fn strongest(pixels: &[u8], top: usize, left: usize) -> Option<Feature> {
    let (mut most, mut strongest) = (THRESHOLD, None);
    for row in top..top + TILE {
        for column in left..left + TILE {
            let along_row = at(pixels, row, column + 1) - at(pixels, row, column - 1);
            let along_column = at(pixels, row + 1, column) - at(pixels, row - 1, column);
            let strength = along_row.abs().min(along_column.abs());
            if strength > most {
                (most, strongest) = (strength, Some(Feature { row, column }));
            }
        }
    }
    strongest
}

#[cfg(test)]
mod tests {
    use super::{MARGIN, find, smooth};
    use crate::image::SIDE;

    /// A bright square with one corner at this row and column.
    fn square(row: usize, column: usize) -> Vec<u8> {
        let mut pixels = vec![10; SIDE * SIDE];
        for line in pixels.chunks_exact_mut(SIDE).skip(row).take(100) {
            line[column..].fill(210);
        }
        pixels
    }

    #[test]
    fn smoothing_keeps_what_is_even_and_softens_an_edge() {
        let (image, mut smooth_image) = (square(60, 90), vec![0; SIDE * SIDE]);
        smooth(&image, &mut smooth_image);
        let row = &smooth_image[100 * SIDE..101 * SIDE];
        assert_eq!(row[86..93], [10, 10, 10, 60, 160, 210, 210]);
    }

    #[test]
    fn a_corner_is_a_feature_and_an_edge_is_none() {
        let found = find(&square(60, 90));
        let [corner, below] = found.all() else {
            panic!("two corners are within the margin: {found:?}");
        };
        assert!(corner.row.abs_diff(60) <= 1 && corner.column.abs_diff(90) <= 1);
        assert!(below.row.abs_diff(160) <= 1 && below.row < SIDE - MARGIN);
    }
}
