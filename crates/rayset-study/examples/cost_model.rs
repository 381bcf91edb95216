//! Fits the cost model of section 3 to a few measurements: `cargo run -p rayset-study --example cost_model`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_study::{CostModel, Measurement};

fn main() {
    let measurements = [
        Measurement { n: 1.0, coherence: 0.76, standard: 60e-9, coherent: 55e-9 },
        Measurement { n: 8.0, coherence: 0.66, standard: 150e-9, coherent: 160e-9 },
    ];
    let model = CostModel::fit(&measurements);
    println!("k = {:.2e} s, lambda = {:.2e} s, alpha = {:.2e} s", model.k, model.lambda, model.alpha);
    println!("C_T = {:.1} %", 100.0 * model.threshold());
    for m in measurements {
        println!(
            "n = {}: ratio {:.3} predicted, {:.3} measured",
            m.n,
            model.ratio(m.n, m.coherence),
            m.coherent / m.standard
        );
    }
}
