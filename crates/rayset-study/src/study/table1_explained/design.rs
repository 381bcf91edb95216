//! Which settings to try: a screening design, single steps from the default, and steps from the best.

use super::factors::{FACTORS, Setting};

/// Settings in which every level of a factor appears equally often, in columns that are shuffled independently: the effect
/// of each factor is seen against all the others.
pub(super) fn screening(count: usize) -> Vec<Setting> {
    shuffled(count, 1985, |name| match name {
        // With nothing inherited at most every other ray is coherent: three of four settings would tell nothing.
        "inheritance" => Some(&[0, 0, 0, 0, 0, 0, 0, 1]),
        // Large images take long; what lies between is left to the steps from the best.
        "resolution" => Some(&[0, 1, 3, 3, 5, 7]),
        "size" => Some(&[0, 1, 2, 3, 5, 7, 9, 10, 11]),
        _ => None,
    })
}

/// The same, where screening found the paper's figures nearest: with cylinders for misses, and small images.
pub(super) fn focused(count: usize) -> Vec<Setting> {
    shuffled(count, 1986, |name| match name {
        "misses" => Some(&[1]),
        "inheritance" => Some(&[0]),
        "resolution" => Some(&[4, 5, 6, 7]),
        _ => None,
    })
}

/// Columns of levels, shuffled; `levels` gives those of a factor, each as often as it is to appear, if not all alike.
fn shuffled(count: usize, seed: u64, levels: impl Fn(&str) -> Option<&'static [u8]>) -> Vec<Setting> {
    let mut random = Random(seed);
    let mut settings = vec![Setting::default(); count];
    for (place, (name, all)) in FACTORS.iter().enumerate() {
        let all: Vec<u8> = (0..all.len()).map(|level| u8::try_from(level).expect("few levels")).collect();
        let levels = levels(name).unwrap_or(&all);
        let mut column: Vec<u8> = (0..count).map(|i| levels[i % levels.len()]).collect();
        for i in (1..count).rev() {
            column.swap(i, random.below(i + 1));
        }
        for (setting, level) in settings.iter_mut().zip(column) {
            setting.0[place] = level;
        }
    }
    settings
}

/// A setting and all that differ from it in one factor.
pub(super) fn steps_from(setting: Setting) -> Vec<Setting> {
    let mut settings = vec![setting];
    for (name, levels) in FACTORS {
        settings
            .extend(levels.iter().map(|level| setting.with(name, level)).filter(|other| *other != setting));
    }
    settings
}

/// A small generator of its own, so that the design is the same for ever.
///
/// Source: Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators" (`SplitMix64`).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let end = end as u64;
        usize::try_from((z ^ (z >> 31)) % end).expect("below a usize")
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn screening_is_balanced_and_without_repeats() {
        let settings = screening(160);
        assert_eq!(settings, screening(160));
        assert_eq!(settings.iter().collect::<BTreeSet<_>>().len(), 160);
        for (factor, levels) in FACTORS {
            let counts =
                levels.iter().map(|level| settings.iter().filter(|s| s.level(factor) == *level).count());
            let counts: Vec<_> = counts.collect();
            assert!(counts.iter().all(|&count| count == 0 || count >= 17), "{factor}: {counts:?}");
            assert!(
                counts.iter().filter(|&&count| count > 0).count() >= levels.len().min(5),
                "{factor}: {counts:?}"
            );
        }
    }

    #[test]
    fn single_steps_change_one_factor() {
        let steps = steps_from(Setting::default());
        let n_levels: usize = FACTORS.iter().map(|(_, levels)| levels.len() - 1).sum();
        assert_eq!(steps.len(), 1 + n_levels);
        assert!(
            steps[1..].iter().all(|step| step
                .levels()
                .zip(steps[0].levels())
                .filter(|(a, b)| a != b)
                .count()
                == 1)
        );
    }
}
