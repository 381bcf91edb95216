//! Comparison of frames by bits.

use std::fmt::Display;

use rayset_engine::Frame;

/// Fails with the first pixel that differs, and both its values.
pub(crate) fn assert_same_pixels(expected: &Frame, actual: &Frame, what: impl Display) {
    assert_eq!((expected.width, expected.height), (actual.width, actual.height), "{what}");
    let width = expected.width as usize;
    for i in 0..expected.beauty[0].len() {
        let pixel = |frame: &Frame| [0, 1, 2].map(|k: usize| frame.beauty[k][i]);
        let bits = |frame: &Frame| pixel(frame).map(f32::to_bits);
        assert!(
            bits(expected) == bits(actual),
            "{what}: pixel ({}, {}) is {:?}, should be {:?}",
            i % width,
            i / width,
            pixel(actual),
            pixel(expected)
        );
    }
}
