//! Images of 64 KiB, and the pool that they are taken from.
//!
//! An image is written by one subtask and read by others, which share it. When the last of
//! them has let go of it, the pool that it is from fills it anew. So a pool needs an image for
//! each job in flight, and one that is being filled.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

/// Rows, and columns, of an image.
pub const SIDE: usize = 256;

/// An image, row by row, from 0 (dark) to 255.
pub type Image = Arc<[u8]>;

/// The images that one subtask writes.
#[derive(Debug)]
pub struct Pool(Vec<Image>);

impl Pool {
    /// Makes a pool of so many images.
    #[must_use]
    pub fn new(images: usize) -> Pool {
        Pool((0..images).map(|_| vec![0; SIDE * SIDE].into()).collect())
    }

    /// Fills an image that nobody reads any more.
    ///
    /// # Panics
    ///
    /// If all are in use.
    pub fn fill(&mut self, fill: impl FnOnce(&mut [u8])) -> Image {
        let is_free = |image: &mut Image| Arc::get_mut(image).is_some();
        let free = self.0.iter_mut().position(is_free);
        let image = &mut self.0[free.expect("an image more than jobs in flight")];
        if let Some(pixels) = Arc::get_mut(image) {
            fill(pixels);
        }
        Arc::clone(image)
    }
}

/// Returns a pixel, of a row and column that the image has.
pub(crate) fn at(pixels: &[u8], row: usize, column: usize) -> i32 {
    i32::from(pixels[row * SIDE + column])
}

#[cfg(test)]
mod tests {
    use super::Pool;

    #[test]
    fn an_image_is_filled_anew_when_nobody_reads_it() {
        let mut pool = Pool::new(2);
        let first = pool.fill(|pixels| pixels.fill(1));
        let reader = first.clone();
        let second = pool.fill(|pixels| pixels.fill(2));
        drop(first);
        assert_eq!((reader[0], second[0]), (1, 2));
        drop(reader);
        assert_eq!((pool.fill(|pixels| pixels.fill(3))[0], second[0]), (3, 2));
    }
}
