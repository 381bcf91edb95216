//! Least squares whose coefficients are not negative.

/// Coefficients `c >= 0` that minimise the squared sum of `1 - c . row / y`: relative errors count alike.
///
/// Coordinate descent: each coefficient in turn takes its best value, the others being held, until nothing changes.
pub(super) fn fit_relative(rows: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let n_columns = rows.first().map_or(0, Vec::len);
    let scaled: Vec<Vec<f64>> =
        rows.iter().zip(y).map(|(row, y)| row.iter().map(|value| value / y).collect()).collect();
    let mut coefficients = vec![0.0; n_columns];
    let mut rest = vec![1.0; rows.len()];
    for _ in 0..20_000 {
        let mut change = 0.0_f64;
        for column in 0..n_columns {
            let dot = |other: &dyn Fn(usize) -> f64| {
                scaled.iter().enumerate().fold(0.0, |sum, (i, row)| sum + row[column] * other(i))
            };
            let norm = dot(&|i| scaled[i][column]);
            if norm <= 0.0 {
                continue;
            }
            let best = (coefficients[column] + dot(&|i| rest[i]) / norm).max(0.0);
            let step = best - coefficients[column];
            for (rest, row) in rest.iter_mut().zip(&scaled) {
                *rest -= step * row[column];
            }
            coefficients[column] = best;
            change = change.max(step.abs() * norm.sqrt());
        }
        if change < 1e-12 {
            break;
        }
    }
    coefficients
}

/// What the coefficients predict for a row.
pub(super) fn predict(coefficients: &[f64], row: &[f64]) -> f64 {
    coefficients.iter().zip(row).fold(0.0, |sum, (coefficient, value)| sum + coefficient * value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn coefficients_that_hold_are_found() {
        let rows: Vec<Vec<f64>> =
            (1..20_u32).map(|i| vec![f64::from(i), f64::from(i * i % 7), 1.0]).collect();
        let y: Vec<_> = rows.iter().map(|row| predict(&[2.0, 0.5, 3.0], row)).collect();
        let found = fit_relative(&rows, &y);
        for (found, expected) in found.iter().zip([2.0, 0.5, 3.0]) {
            assert_abs_diff_eq!(*found, expected, epsilon = 1e-6);
        }
    }

    #[test]
    fn no_coefficient_is_negative() {
        let rows: Vec<Vec<f64>> = (1..20_u32).map(|i| vec![f64::from(i), f64::from(20 - i)]).collect();
        let y: Vec<_> = rows.iter().map(|row| 2.0 * row[0] - 0.05 * row[1]).collect();
        let found = fit_relative(&rows, &y[..].iter().map(|y| y.abs().max(0.1)).collect::<Vec<_>>());
        assert!(found.iter().all(|&coefficient| coefficient >= 0.0), "{found:?}");
        assert!(fit_relative(&[], &[]).is_empty());
    }
}
