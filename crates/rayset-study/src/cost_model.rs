//! The cost model of section 3, fitted to measurements.

use serde::Serialize;

/// The three constants of the paper's cost model, in seconds a ray.
///
/// A ray of the standard algorithm takes `t_ST = k n + alpha`; a ray that builds a cylinder `t_ST + lambda n`; a
/// coherent ray `alpha`.
///
/// Source: Speer et al. 1985, section 3. Section 4 of our text has alpha where section 3 has lambda.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CostModel {
    /// The cost of a partition for each volume.
    pub k: f64,
    /// The cost of a cylinder for each volume.
    pub lambda: f64,
    /// The cost of a ray that does not depend on the number of volumes.
    pub alpha: f64,
}

/// What both algorithms took for one number of volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// The number of volumes.
    pub n: f64,
    /// The fraction of rays that were coherent, from 0 to 1.
    pub coherence: f64,
    /// Seconds a ray, standard algorithm.
    pub standard: f64,
    /// Seconds a ray, coherent algorithm.
    pub coherent: f64,
}

impl CostModel {
    /// Fits the constants: `k` and `alpha` by least squares to the standard algorithm, then `lambda` to the coherent
    /// one.
    ///
    /// With measurements of fewer than two numbers of volumes, `k` takes all and `alpha` is zero.
    #[must_use]
    pub fn fit(measurements: &[Measurement]) -> Self {
        let sum = |term: &dyn Fn(&Measurement) -> f64| measurements.iter().fold(0.0, |sum, m| sum + term(m));
        let (count, n) = (sum(&|_| 1.0), sum(&|m| m.n));
        let (n_n, t, n_t) = (sum(&|m| m.n * m.n), sum(&|m| m.standard), sum(&|m| m.n * m.standard));
        let determinant = count * n_n - n * n;
        let (k, alpha) = if determinant > 0.0 {
            ((count * n_t - n * t) / determinant, (n_n * t - n * n_t) / determinant)
        } else {
            (n_t / n_n, 0.0)
        };
        // coherent - [C alpha + (1 - C)(k n + alpha)] = (1 - C) n lambda
        let share = |m: &Measurement| (1.0 - m.coherence) * m.n;
        let rest = |m: &Measurement| m.coherent - alpha - share(m) * k;
        let lambda = sum(&|m| share(m) * rest(m)) / sum(&|m| share(m) * share(m));
        Self { k, lambda, alpha }
    }

    /// The coherence above which the coherent algorithm should win: `C_T = 1 / (1 + k / lambda)`.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        1.0 / (1.0 + self.k / self.lambda)
    }

    /// The time of the coherent algorithm over that of the standard one, for `n` volumes and a fraction of coherent
    /// rays.
    #[must_use]
    pub fn ratio(&self, n: f64, coherence: f64) -> f64 {
        let standard = self.k * n + self.alpha;
        (self.alpha + (1.0 - coherence) * n * (self.k + self.lambda)) / standard
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn fit_recovers_a_model_that_holds() {
        let model = CostModel { k: 3.0, lambda: 5.0, alpha: 7.0 };
        let measurements: Vec<_> = [(1.0, 0.9), (2.0, 0.8), (4.0, 0.5), (8.0, 0.7)]
            .iter()
            .map(|&(n, coherence)| {
                let standard = model.k * n + model.alpha;
                Measurement { n, coherence, standard, coherent: standard * model.ratio(n, coherence) }
            })
            .collect();
        let fitted = CostModel::fit(&measurements);
        for (expected, actual) in
            [(model.k, fitted.k), (model.lambda, fitted.lambda), (model.alpha, fitted.alpha)]
        {
            assert_abs_diff_eq!(expected, actual, epsilon = 1e-10);
        }
    }

    #[test]
    fn threshold_is_where_the_ratio_is_one_without_a_constant_cost() {
        let model = CostModel { k: 0.511, lambda: 1.0, alpha: 0.0 };
        assert_abs_diff_eq!(model.ratio(8.0, model.threshold()), 1.0, epsilon = 1e-12);
    }
}
