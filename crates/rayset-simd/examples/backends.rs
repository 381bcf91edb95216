//! Runs one kernel on every backend of this machine: `cargo run -p rayset-simd --example backends`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_simd::{Backend, Kernel, Lanes, Simd};

/// The sum of squares of each lane position, folded at the end.
struct SumOfSquares<'a>(&'a [f64]);

impl Kernel for SumOfSquares<'_> {
    type Output = (usize, f64);

    fn run<S: Simd>(self, simd: S) -> (usize, f64) {
        let mut sums = simd.splat_f64(0.0);
        for chunk in self.0.chunks_exact(S::F64::LANES) {
            let values = simd.load_f64(chunk);
            sums = sums + values * values;
        }
        (S::F64::LANES, (0..S::F64::LANES).fold(0.0, |sum, i| sum + sums.lane(i)))
    }
}

fn main() {
    let values: Vec<f64> = (1..=16).map(f64::from).collect();
    for backend in Backend::available() {
        let (lanes, sum) = backend.run(SumOfSquares(&values));
        println!("{backend}: {lanes} lanes of f64, sum of squares {sum}");
    }
}
