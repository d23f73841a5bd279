//! A list of bounded length, for code that runs before there is a heap.

use core::fmt;

/// Up to `N` values, in the order in which they were pushed.
#[derive(Clone, Copy)]
pub struct List<T, const N: usize> {
    items: [T; N],
    length: usize,
}

/// The list is full: the value did not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl<T: Copy, const N: usize> List<T, N> {
    /// Creates an empty list; `filler` occupies the unused places.
    pub const fn new(filler: T) -> Self {
        Self {
            items: [filler; N],
            length: 0,
        }
    }

    /// Appends a value.
    ///
    /// # Errors
    ///
    /// [`Full`] if there are `N` values already.
    pub fn push(&mut self, value: T) -> Result<(), Full> {
        let place = self.items.get_mut(self.length).ok_or(Full)?;
        *place = value;
        self.length += 1;
        Ok(())
    }

    /// Returns the values, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.items[..self.length]
    }

    /// Returns the values.
    pub fn as_slice(&self) -> &[T] {
        &self.items[..self.length]
    }
}

impl<T: Copy + fmt::Debug, const N: usize> fmt::Debug for List<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_slice().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_order_and_refuses_more_than_fits() {
        let mut list = List::<u8, 2>::new(0);
        assert_eq!(list.as_slice(), &[] as &[u8]);
        assert_eq!(list.push(7), Ok(()));
        assert_eq!(list.push(8), Ok(()));
        assert_eq!(list.push(9), Err(Full));
        assert_eq!(list.as_slice(), &[7, 8]);
    }
}
