//! Numbers that depend on a seed and on nothing else.

use rayset_scene::glam::DVec3;

/// A generator of 64-bit words.
///
/// Source: Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators" (`SplitMix64`).
#[derive(Clone, Debug)]
pub(crate) struct Dice(u64);

impl Dice {
    /// The generator of one case of a run.
    pub(crate) fn new(seed: u64, case: u64) -> Self {
        let mut dice = Self(seed);
        dice.0 = dice.word() ^ case;
        // Neighbouring cases have nothing in common.
        dice.0 = dice.word();
        dice
    }

    pub(crate) fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Uniform among `0..n`, as good as.
    pub(crate) fn below(&mut self, n: u32) -> u32 {
        u32::try_from(((self.word() >> 32) * u64::from(n)) >> 32).expect("less than n")
    }

    /// Uniform in a range of integers, ends included.
    pub(crate) fn among(&mut self, least: u32, greatest: u32) -> u32 {
        least + self.below(greatest - least + 1)
    }

    /// One of some values.
    pub(crate) fn pick<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(u32::try_from(values.len()).expect("few values")) as usize]
    }

    /// True once in `n` times.
    pub(crate) fn once_in(&mut self, n: u32) -> bool {
        self.below(n) == 0
    }

    /// Uniform between two numbers.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub(crate) fn between(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * ((self.word() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Uniform in the cube from -1 to 1.
    pub(crate) fn point(&mut self) -> DVec3 {
        let x = self.between(-1.0, 1.0);
        let y = self.between(-1.0, 1.0);
        DVec3::new(x, y, self.between(-1.0, 1.0))
    }

    /// A unit vector of any direction.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let point = self.point();
            if point.length_squared() <= 1.0
                && let Some(direction) = rayset_scene::geometry::unit(point)
            {
                return direction;
            }
        }
    }

    /// A unit vector perpendicular to one, up to rounding.
    pub(crate) fn across(&mut self, axis: DVec3) -> DVec3 {
        loop {
            let across = self.direction().cross(axis);
            if across.length_squared() > 0.01 {
                return across.normalize();
            }
        }
    }

    /// A vector along one of the six axes.
    pub(crate) fn axis(&mut self) -> DVec3 {
        self.pick(&[DVec3::X, DVec3::Y, DVec3::Z]) * self.pick(&[-1.0, 1.0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_words_for_ever_and_cases_differ() {
        assert_eq!(Dice(0).word(), 0xe220_a839_7b1d_cdaf);
        assert_ne!(Dice::new(1, 1).word(), Dice::new(1, 2).word());
        assert_ne!(Dice::new(1, 1).word(), Dice::new(2, 1).word());
    }

    #[test]
    fn numbers_lie_in_their_ranges() {
        let mut dice = Dice::new(7, 7);
        let mut seen = [false; 5];
        for _ in 0..1000 {
            seen[dice.below(5) as usize] = true;
            assert!((3..=4).contains(&dice.among(3, 4)));
            assert!((2.0..3.0).contains(&dice.between(2.0, 3.0)));
            let axis = dice.direction();
            assert!((axis.length() - 1.0).abs() < 1e-12 && dice.across(axis).dot(axis).abs() < 1e-12);
        }
        assert_eq!(seen, [true; 5]);
    }
}
