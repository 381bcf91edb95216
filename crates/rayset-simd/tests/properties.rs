//! Every operation of every backend has the bits of the scalar operation, lane by lane.

use approx::abs_diff_eq;
use proptest::prelude::*;
use rayset_simd::{Backend, CullLanes, Kernel, LaneMask, Lanes, MAX_LANES, Simd};

/// All results of all operations on `a`, `b`, lane by lane, as bits.
struct AllOperations<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl Kernel for AllOperations<'_> {
    type Output = Vec<Vec<u64>>;

    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut results = vec![Vec::new(); self.a.len()];
        for i in (0..self.a.len()).step_by(S::F64::LANES) {
            let (a, b) = (simd.load_f64(&self.a[i..]), simd.load_f64(&self.b[i..]));
            let masks = [a.lt(b), a.le(b), a.gt(b), a.ge(b), a.eq(b), !a.lt(b), a.lt(b) | b.lt(a)];
            let numbers = [
                a + b,
                a - b,
                a * b,
                a / b,
                -a,
                a.sqrt(),
                a.abs(),
                a.min(b),
                a.max(b),
                a.select(a.lt(b), b),
                a.select(simd.mask_f64(u32::MAX), b),
                a.select(simd.mask_f64(0), b),
                simd.collect_f64(|lane| self.b[i + lane]),
            ];
            for bits in 0..1_u32 << S::F64::LANES {
                let mut front = [0.0; MAX_LANES];
                a.compress(simd.mask_f64(bits), &mut front);
                let set = (0..S::F64::LANES).filter(|lane| bits >> lane & 1 == 1);
                for (lane, found) in set.zip(front) {
                    assert_eq!(found.to_bits(), self.a[i + lane].to_bits());
                }
                let back = simd.expand_f64(simd.mask_f64(bits), &self.a[i..]);
                let mut rank = 0;
                for lane in 0..S::F64::LANES {
                    let is_set = bits >> lane & 1 == 1;
                    let expected = if is_set { self.a[i + rank] } else { 0.0 };
                    assert_eq!(back.lane(lane).to_bits(), expected.to_bits(), "{bits:b}, lane {lane}");
                    rank += usize::from(is_set);
                }
            }
            for lane in 0..S::F64::LANES {
                let mut stored = [0.0; MAX_LANES];
                for number in numbers {
                    number.store(&mut stored);
                    assert_eq!(stored[lane].to_bits(), number.lane(lane).to_bits());
                    // The sign and payload of a NaN that an operation makes are not fixed by IEEE 754.
                    let bits = if stored[lane].is_nan() { f64::NAN } else { stored[lane] };
                    results[i + lane].push(bits.to_bits());
                }
                results[i + lane].extend(masks.iter().map(|mask| u64::from(mask.bits() >> lane & 1)));
                assert_eq!(masks[0].any(), masks[0].bits() != 0);
            }
        }
        results
    }
}

/// Single precision: the same for the operations that a cull uses.
struct Culling<'a> {
    a: &'a [f32],
    b: &'a [f32],
}

impl Kernel for Culling<'_> {
    type Output = Vec<Vec<u32>>;

    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut results = vec![Vec::new(); self.a.len()];
        for i in (0..self.a.len()).step_by(S::F32::LANES) {
            let (a, b) = (simd.load_f32(&self.a[i..]), simd.load_f32(&self.b[i..]));
            let numbers =
                [a + b, a - b, a * b, a / b, a.min(b), a.max(b), b.select(simd.mask_f32(0x5555), a)];
            for lane in 0..S::F32::LANES {
                let bits = |value: f32| if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() };
                results[i + lane].extend(numbers[..6].iter().map(|number| bits(number.lane(lane))));
                results[i + lane].push(a.le(b).bits() >> lane & 1);
            }
        }
        results
    }
}

/// What only culling may use: the fused sum, and the set lanes of both types moved to the front.
struct CullingOnly<'a> {
    a: &'a [f32],
    b: &'a [f32],
    mask: u32,
}

impl Kernel for CullingOnly<'_> {
    type Output = ();

    fn run<S: Simd>(self, simd: S) {
        let n = S::F32::LANES;
        let (a, b) = (simd.load_f32(self.a), simd.load_f32(self.b));
        let greater = a.max_abs(b);
        for (fused, term) in [(a.mul_add(b, a), 1.0), (a.mul_sub(b, a), -1.0)] {
            for i in 0..n {
                let product = f64::from(self.a[i]) * f64::from(self.b[i]);
                let exact = product + term * f64::from(self.a[i]);
                let bound = f64::from(f32::EPSILON) * product.abs().max(exact.abs());
                assert!(
                    abs_diff_eq!(f64::from(fused.lane(i)), exact, epsilon = bound),
                    "{} off {exact}",
                    fused.lane(i)
                );
                assert_eq!(greater.lane(i).to_bits(), self.a[i].abs().max(self.b[i].abs()).to_bits());
            }
        }
        let fold = |f: fn(f32, f32) -> f32| self.a[1..n].iter().copied().fold(self.a[0], f);
        assert_eq!((a.least(), a.greatest()), (fold(f32::min), fold(f32::max)));
        let mask = simd.mask_f32(self.mask);
        let lanes: Vec<usize> = (0..n).filter(|lane| mask.bits() >> lane & 1 == 1).collect();
        let (mut front, mut ids) = ([0.0; MAX_LANES], [0; MAX_LANES]);
        a.compress(mask, &mut front);
        let values: [u32; MAX_LANES] = std::array::from_fn(|i| self.a[i].to_bits());
        simd.compress_u32(mask, &values, &mut ids);
        let mut either_way = [[0; MAX_LANES]; 2];
        simd.compress_u32_either_way(mask, &values, false, &mut either_way[0]);
        simd.compress_u32_either_way(mask, &values, true, &mut either_way[1]);
        for (k, &lane) in lanes.iter().enumerate() {
            assert_eq!(front[k].to_bits(), self.a[lane].to_bits());
            let last = lanes[lanes.len() - 1 - k];
            assert_eq!([ids[k], either_way[0][k], either_way[1][k]], [lane, lane, last].map(|i| values[i]));
        }
        let mut place = b;
        a.put(mask, &mut place);
        for i in 0..n {
            let expected = if mask.bits() >> i & 1 == 1 { self.a[i] } else { self.b[i] };
            assert_eq!(place.lane(i).to_bits(), expected.to_bits());
        }
        let wide: [f64; MAX_LANES] =
            std::array::from_fn(|i| f64::from(self.a[i]) + f64::from(self.b[i]) / 3.0);
        let narrowed = simd.narrow_f32(&wide, 0.1, 0.25);
        let narrowing = simd.narrowing_f32(&wide, 0.1, 0.25);
        let lanes = S::F64::LANES;
        let parts: Vec<_> = wide[..n].chunks(lanes).map(|part| simd.load_f64(part)).collect();
        let joined = simd.join_f32(&parts);
        let rows: [S::F32; 8] = std::array::from_fn(|k| {
            let turned: [f32; MAX_LANES] =
                std::array::from_fn(|i| self.a[(i * (2 * k + 1) + k) % n] - k as f32);
            simd.load_f32(&turned)
        });
        let [a, b, c, d, e, f, g, h] = rows;
        let greatest = simd.greatest_of_eight(&[[a, b, c, d], [e, f, g, h]]);
        assert_eq!(greatest.to_vec(), rows.map(CullLanes::greatest).to_vec());
        let found = simd.equal_u32(&values, values[n - 1]);
        let sharing = simd.any_bits_u32(&values, self.mask);
        for i in 0..n {
            #[expect(clippy::cast_possible_truncation, reason = "what the lanes do")]
            let expected = ((wide[i] - 0.1) * 0.25) as f32;
            assert_eq!(narrowed.lane(i).to_bits(), expected.to_bits());
            #[expect(clippy::cast_possible_truncation, reason = "what the lanes do")]
            let single = wide[i] as f32;
            assert_eq!(joined.lane(i).to_bits(), single.to_bits());
            #[expect(clippy::cast_possible_truncation, reason = "what the lanes do")]
            let lost = ((wide[i] - 0.1) * 0.25 - f64::from(expected)) as f32;
            assert_eq!(narrowing.lane(i).to_bits(), lost.to_bits());
            assert_eq!(found.bits() >> i & 1 == 1, values[i] == values[n - 1]);
            assert_eq!(sharing.bits() >> i & 1 == 1, values[i] & self.mask != 0);
        }
    }
}

fn any_f64() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        -2.0..2.0,
        prop::sample::select(vec![0.0, -0.0, 1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324]),
    ]
}

proptest! {
    #[test]
    fn every_backend_has_the_scalar_bits(
        a in prop::collection::vec(any_f64(), MAX_LANES),
        b in prop::collection::vec(any_f64(), MAX_LANES),
    ) {
        let expected = Backend::Scalar.run(AllOperations { a: &a, b: &b });
        for backend in Backend::available() {
            prop_assert_eq!(&backend.run(AllOperations { a: &a, b: &b }), &expected, "{}", backend);
        }
    }

    #[test]
    fn every_backend_has_the_scalar_bits_in_single_precision(
        a in prop::collection::vec(any::<u32>().prop_map(f32::from_bits), MAX_LANES),
        b in prop::collection::vec(any::<u32>().prop_map(f32::from_bits), MAX_LANES),
    ) {
        let expected = Backend::Scalar.run(Culling { a: &a, b: &b });
        for backend in Backend::available() {
            prop_assert_eq!(&backend.run(Culling { a: &a, b: &b }), &expected, "{}", backend);
        }
    }

    #[test]
    fn culling_operations_keep_their_word(
        a in prop::collection::vec(-2.0_f32..2.0, MAX_LANES),
        b in prop::collection::vec(-2.0_f32..2.0, MAX_LANES),
        mask in prop_oneof![any::<u32>(), (0..32_u32).prop_map(|bit| 1 << bit), Just(0)],
    ) {
        for backend in Backend::available() {
            backend.run(CullingOnly { a: &a, b: &b, mask });
        }
    }
}
