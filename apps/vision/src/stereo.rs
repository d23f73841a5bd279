//! From two images to a distance.
//!
//! A feature is looked for in the other camera's image, along its row: the place where its
//! surroundings are the most alike. The *disparity*, by how many columns it is shifted, is in
//! inverse proportion to the distance. The median of all disparities is taken, found from either
//! side, so that some wrong ones do no harm.

use crate::features::{Feature, Features, MARGIN, MOST};
use crate::image::{SIDE, at};
use crate::road::{BASELINE, FOCAL, Side};

/// The largest disparity that is looked for: what is nearer than 2.2 m is too near.
const MOST_DISPARITY: usize = 48;

/// Rows and columns on either side that are compared.
const AROUND: usize = 3;

const _: () = assert!(AROUND < MARGIN);

/// Returns how far away most features are, in metres, if there are any.
#[must_use]
pub fn distance(images: [&[u8]; 2], features: [&Features; 2]) -> Option<f32> {
    let mut found = [0.0; 2 * MOST];
    let mut count = 0;
    let [left, right] = images;
    for (of, images, side) in [
        (features[0], [left, right], Side::Left),
        (features[1], [right, left], Side::Right),
    ] {
        for feature in of.all() {
            if let Some(disparity) = disparity(images, *feature, side) {
                found[count] = disparity;
                count += 1;
            }
        }
    }
    let found = &mut found[..count];
    found.sort_unstable_by(f32::total_cmp);
    let median = found.get(count / 2)?;
    Some(FOCAL * BASELINE / median)
}

/// Returns by how much a feature of the first image is shifted in the second one, to a part of
/// a column, unless the search ends at an end.
#[allow(clippy::cast_precision_loss, reason = "sums are below 2^14")]
fn disparity([from, to]: [&[u8]; 2], feature: Feature, side: Side) -> Option<f32> {
    let mut unlike = [i32::MAX; MOST_DISPARITY + 1];
    for (shift, unlike) in unlike.iter_mut().enumerate() {
        let column = match side {
            Side::Left => feature.column.checked_sub(shift),
            Side::Right => Some(feature.column + shift),
        };
        let is_inside = |column: &usize| (AROUND..SIDE - AROUND).contains(column);
        if let Some(column) = column.filter(is_inside) {
            *unlike = difference(from, to, feature, column);
        }
    }
    let (best, least) = (unlike.iter().enumerate()).min_by_key(|(_, unlike)| **unlike)?;
    let (before, after) = (*unlike.get(best.checked_sub(1)?)?, *unlike.get(best + 1)?);
    if before == i32::MAX || after == i32::MAX {
        return None;
    }
    // The lowest place of the parabola through three points.
    let bend = (before - 2 * least + after).max(1) as f32;
    Some(best as f32 + (before - after) as f32 / (2.0 * bend))
}

/// Returns how unlike the surroundings of a feature and of a place in its row are.
fn difference(from: &[u8], to: &[u8], feature: Feature, column: usize) -> i32 {
    let mut sum = 0;
    for row in feature.row - AROUND..=feature.row + AROUND {
        for along in 0..=2 * AROUND {
            let here = at(from, row, feature.column + along - AROUND);
            sum += (here - at(to, row, column + along - AROUND)).abs();
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use common::random::Random;

    use super::distance;
    use crate::features::{find, smooth};
    use crate::image::SIDE;
    use crate::road::{Side, draw};

    #[test]
    fn the_distance_is_found_from_three_to_ten_metres() {
        for (seed, decimetres) in (30_u16..=100).step_by(5).enumerate() {
            let metres = f32::from(decimetres) / 10.0;
            let mut noise = Random::new(seed as u64);
            let [left, right] = [Side::Left, Side::Right].map(|side| {
                let (mut raw, mut image) = (vec![0; SIDE * SIDE], vec![0; SIDE * SIDE]);
                draw(&mut raw, metres, side, &mut noise);
                smooth(&raw, &mut image);
                image
            });
            let features = [&find(&left), &find(&right)];
            let found = distance([&left, &right], features).expect("it is seen");
            let error = (found - metres).abs() / metres;
            assert!(error < 0.1, "{metres} m, seen as {found} m");
        }
    }

    #[test]
    fn where_nothing_stands_out_there_is_no_distance() {
        let even = vec![30; SIDE * SIDE];
        let none = find(&even);
        assert_eq!(distance([&even, &even], [&none, &none]), None);
    }
}
