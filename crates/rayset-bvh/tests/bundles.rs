//! Rays traced together have the bits of a loop over all primitives, one by one.

mod together;
mod truth;

use proptest::prelude::*;
use rayset_bvh::{Bundled, Hierarchy, Left};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Cone, Polygon, Primitive, Probe, Ray, Side, Sides, Span, Sphere, Triangle, unit};
use rayset_simd::{Backend, Scalar};

use together::{List, check, check_stages};

fn point() -> impl Strategy<Value = DVec3> {
    (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| dvec3(x, y, z))
}

/// A coordinate of a lattice: many coincide.
fn lattice() -> impl Strategy<Value = DVec3> {
    (-2..=2, -2..=2, -2..=2).prop_map(|(x, y, z)| 0.5 * dvec3(f64::from(x), f64::from(y), f64::from(z)))
}

fn any_point() -> impl Strategy<Value = DVec3> {
    prop_oneof![point(), lattice()]
}

fn primitive() -> impl Strategy<Value = Primitive> {
    let radius = prop_oneof![0.01..0.3, Just(0.25), Just(0.5), Just(0.0)];
    prop_oneof![
        (any_point(), radius).prop_map(|(center, radius)| Sphere::new(center, radius).into()),
        (any_point(), any_point(), any_point(), 0.01..1.0).prop_map(|(a, b, c, size)| Triangle::new(
            a,
            a + size * (b - a),
            a + size * (c - a)
        )
        .into()),
        (any_point(), point(), point(), 3..12_usize, any::<bool>()).prop_filter_map(
            "no polygon",
            |(center, x, y, n, star)| {
                let corner = |i: usize| {
                    let angle = std::f64::consts::TAU * i as f64 / n as f64;
                    let reach = if star && i.is_multiple_of(2) { 0.1 } else { 0.4 };
                    let (sin, cos) = libm::sincos(angle);
                    center + reach * (cos * x + sin * y)
                };
                Polygon::new((0..n).map(corner).collect()).map(Primitive::from)
            }
        ),
        (any_point(), any_point(), 0.01..0.3, prop::sample::select(vec![0.0, 0.5, 1.0])).prop_filter_map(
            "no cone",
            |(base, apex, radius, ratio)| Cone::new(base, radius, apex, ratio * radius).map(Primitive::from)
        ),
    ]
}

fn sides() -> impl Strategy<Value = Sides> {
    prop_oneof![Just(Sides::Both), Just(Sides::Front), Just(Sides::Back)]
}

/// Polygons that are long along the rays, and spans that begin and end within them.
#[test]
fn spans_that_end_where_a_polygon_is_are_kept() {
    let corners =
        [dvec3(-2.0, -1.0, 2.0), dvec3(2.0, -1.0, 2.0), dvec3(2.0, 1.0, 9.0), dvec3(-2.0, 1.0, 9.0)];
    let polygon = Primitive::from(Polygon::new(corners.to_vec()).expect("it is flat"));
    let primitives = [(polygon.clone(), Sides::Both)];
    let (mut list, mut left) = (List::default(), List::default());
    for i in 0..256 {
        let (x, y) = (f64::from(i % 16) / 80.0 - 0.095, f64::from(i / 16) / 80.0 - 0.095);
        let ray = Ray::new(DVec3::ZERO, unit(dvec3(x, y, 1.0)).expect("it has a length"));
        let t = polygon.intersect(&ray, Span::FORWARD, Sides::Both, None).expect("it goes through");
        let span = match i % 4 {
            0 => Span { start: 0.0, end: 0.98 * t },
            1 => Span { start: 1.02 * t, end: f64::INFINITY },
            2 => Span { start: 0.98 * t, end: 1.02 * t },
            _ => Span::FORWARD,
        };
        list.push(&ray, span, None);
        // Away from a place on it, into its front.
        let away = Ray::new(ray.at(t), unit(dvec3(x, 1.0, -y)).expect("it has a length"));
        left.push(&away, Span::FORWARD, Some((0, Side::Front)));
    }
    let together = check(&primitives, &list);
    assert!(together > 0, "some are answered under shafts");
    check(&primitives, &left);
}

/// A star of many corners, a tube and a cone behind it, left by some of the rays that meet them: from outside, and from
/// within.
#[test]
fn rays_leave_long_polygons_and_cones_together() {
    let star = |turned: bool| {
        // Ten corners along each side of a square, every other one farther in.
        let corner = |i: i32| {
            let i = if turned { 39 - i } else { i };
            let (along, size) = (f64::from(i % 10) / 5.0 - 1.0, if i % 2 == 0 { 1.0 } else { 0.6 });
            let (x, y) = [(along, -1.0), (1.0, along), (-along, 1.0), (-1.0, -along)][(i / 10) as usize];
            dvec3(size * x, size * y, 2.0)
        };
        Primitive::from(Polygon::new((0..40).map(corner).collect()).expect("it is flat"))
    };
    let cone = |base, radius, apex, apex_radius| {
        Primitive::from(Cone::new(base, radius, apex, apex_radius).expect("it is one"))
    };
    let shapes = [
        star(false),
        star(true),
        cone(dvec3(-3.0, 0.2, 5.0), 0.7, dvec3(3.0, -0.1, 5.5), 0.7),
        cone(dvec3(0.1, -3.0, 7.0), 0.9, dvec3(-0.2, 3.0, 7.5), 0.4),
    ];
    for (n, eye) in [dvec3(0.0, 0.0, -1.0), dvec3(0.0, 0.0, 5.2)].into_iter().enumerate() {
        for shape in 0..4_u32 {
            let others = [shapes[2].clone(), shapes[3].clone()];
            let mut primitives = vec![(shapes[shape as usize].clone(), Sides::Both)];
            primitives.extend(others.map(|other| (other, [Sides::Both, Sides::Back][n])));
            let mut list = List::default();
            for i in 0..1024_u32 {
                let (x, y) = (f64::from(i % 32) / 80.0 - 0.19, f64::from(i / 32) / 80.0 - 0.19);
                let ray = Ray::new(eye, unit(dvec3(x, y, 1.0)).expect("it has a length"));
                let left = match i % 5 {
                    0 => Some((0, Side::Front)),
                    1 => Some((0, Side::Back)),
                    2 => Some((1 + i % 2, Side::Back)),
                    _ => None,
                };
                list.push(&ray, Span::FORWARD, left);
            }
            let together = check(&primitives, &list);
            assert!(together > 0, "some are answered under shafts");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    #[test]
    fn rays_together_have_the_bits_of_a_loop(
        primitives in prop::collection::vec((primitive(), sides()), 1..150),
        eye in any_point(),
        far in prop::sample::select(vec![0.0, 1.0, 3.0, 10.0, 1e4]),
        target in any_point(),
        spread in prop::sample::select(vec![0.0, 1e-9, 1e-3, 0.1, 0.5]),
        parallel in any::<bool>(),
        jitter in prop::collection::vec((point(), prop::option::of((any::<prop::sample::Index>(), any::<bool>()))), 1..300),
        end in prop::sample::select(vec![f64::INFINITY, 0.5, 1.0, 2.0]),
        scale in prop::sample::select(vec![1.0, 1e-100, 1e6]),
        shift in prop::sample::select(vec![0.0, 0.0, 1e3]),
    ) {
        let place = |p: DVec3| scale * (p + DVec3::splat(shift));
        let primitives: Vec<(Primitive, Sides)> = primitives
            .into_iter()
            .map(|(primitive, sides)| {
                let moved = match primitive {
                    Primitive::Sphere(s) => Sphere::new(place(s.center()), scale * s.radius()).into(),
                    Primitive::Triangle(t) => {
                        let [a, b, c] = t.vertices().map(place);
                        Triangle::new(a, b, c).into()
                    }
                    Primitive::Polygon(p) => {
                        let corners: Vec<DVec3> = p.vertices().iter().copied().map(place).collect();
                        // Moved far off, or made tiny, it may have no plane any more.
                        Polygon::new(corners).map_or_else(|| Sphere::new(place(DVec3::ZERO), 0.0).into(), Primitive::from)
                    }
                    Primitive::Cone(c) => {
                        let moved = Cone::new(
                            place(c.base()),
                            scale * c.base_radius(),
                            place(c.apex()),
                            scale * c.apex_radius(),
                        );
                        moved.map_or_else(|| Sphere::new(place(DVec3::ZERO), 0.0).into(), Primitive::from)
                    }
                };
                (moved, sides)
            })
            .collect();
        let axis = unit(target - eye).unwrap_or(DVec3::NEG_Z);
        let eye = eye - far * axis;
        let mut list = List::default();
        for (offset, left) in &jitter {
            // From one point to several, or side by side.
            let origin = if parallel { eye + spread * *offset } else { eye };
            let direction = unit(axis + if parallel { DVec3::ZERO } else { spread * *offset }).unwrap_or(axis);
            let left = left.map(|(index, front)| {
                let number = u32::try_from(index.index(primitives.len())).unwrap();
                (number, if front { Side::Front } else { Side::Back })
            });
            // Here and there a span in which nothing is.
            let span = match list.left.len() % 16 {
                3 => Span { start: f64::NAN, end: f64::INFINITY },
                9 => Span { start: 0.0, end: f64::NAN },
                _ => Span { start: 0.0, end: scale * (end + far) },
            };
            list.push(&Ray::new(place(origin), direction), span, left);
        }
        check(&primitives, &list);
    }
}

#[test]
fn rays_of_one_eye_are_answered_together() {
    let spheres: Vec<_> = (0..500)
        .map(|i| {
            let at = |k: f64| 2.0 * (f64::from(i) * k).fract() - 1.0;
            let center = dvec3(at(0.618_033_9), at(0.754_877_7), at(0.569_840_3));
            (Primitive::from(Sphere::new(center, 0.05)), Sides::Both)
        })
        .collect();
    // Beside the scene, and so far off that rays are moved first.
    for distance in [3.0, 12.0] {
        let mut list = List::default();
        for y in 0..16 {
            for x in 0..16 {
                let direction =
                    unit(dvec3(f64::from(x) * 0.01, f64::from(y) * 0.01, 0.3 * distance)).unwrap();
                list.push(&Ray::new(dvec3(0.0, 0.0, -distance), direction), Span::FORWARD, None);
            }
        }
        let rays = 2 * 256 * Backend::available().len() as u64;
        let together = check(&spheres, &list);
        assert!(10 * together > 9 * rays, "{together} of {rays} from {distance}");
    }
}

#[test]
fn tiles_that_miss_everything_stand_among_others() {
    // Small shapes along a diagonal: of the tiles, squares of 16 x 16 rays, most see none of them.
    let primitives: Vec<(Primitive, Sides)> = (0..60)
        .map(|i| {
            let at = f64::from(i) / 30.0 - 1.0;
            let center = dvec3(0.9 * at, 0.8 * at, 0.6 * (7.0 * at).fract() - 0.3);
            let primitive = if i % 2 == 0 {
                Primitive::Sphere(Sphere::new(center, 0.03))
            } else {
                let [b, c] = [dvec3(0.05, 0.01, 0.0), dvec3(0.0, 0.05, 0.02)];
                Primitive::Triangle(Triangle::new(center, center + b, center + c))
            };
            (primitive, Sides::Both)
        })
        .collect();
    for eye in [dvec3(0.2, -0.1, -2.5), dvec3(0.3, 0.1, 0.2), dvec3(-4.0, 2.0, 1.0)] {
        let (towards, across) = (-eye, dvec3(0.3, 1.0, 0.1));
        let right = unit(towards.cross(across)).expect("it has a length");
        let up = unit(right.cross(towards)).expect("it has a length");
        let mut list = List::default();
        for tile in 0..36 {
            for pixel in 0..256 {
                let x = f64::from(tile % 6 * 16 + pixel % 16) / 48.0 - 1.0;
                let y = f64::from(tile / 6 * 16 + pixel / 16) / 48.0 - 1.0;
                let direction = unit(towards + 1.3 * towards.length() * (x * right + y * up));
                list.push(&Ray::new(eye, direction.expect("it has a length")), Span::FORWARD, None);
            }
        }
        let stages = check_stages(&primitives, &list);
        // Of rays from one eye most stay together, hits or none.
        assert!(stages.tiles > stages.packets + stages.alone, "{eye}: {stages:?}");
    }
}

/// Halves of the faces of a mesh, which packets test two at a time: from above, and grazing it.
#[test]
fn rays_meet_either_half_of_a_face_together() {
    let height = |x: u32, y: u32| 0.3 * (f64::from(x * 7 + y * 13) * 0.618_033_9).fract();
    let corner = |x: u32, y: u32| dvec3(f64::from(x), f64::from(y), height(x, y));
    let mut primitives = Vec::new();
    for (x, y) in (0..24).flat_map(|y| (0..24).map(move |x| (x, y))) {
        // A face is missing here and there.
        if (x + 3 * y) % 5 != 0 {
            let [a, b] = [corner(x, y), corner(x + 1, y)];
            let [c, d] = [corner(x + 1, y + 1), corner(x, y + 1)];
            primitives.push((Primitive::from(Triangle::new(a, b, c)), Sides::Both));
            // Some halves are turned over, and share no edge then.
            let other = if x % 4 == 3 { Triangle::new(a, d, c) } else { Triangle::new(c, d, a) };
            primitives.push((other.into(), Sides::Both));
        }
    }
    for (eye, spread) in [
        (dvec3(11.0, 12.0, 15.0), 0.2),
        (dvec3(11.0, 12.0, 15.0), 1.0),
        (dvec3(-6.0, 11.0, 0.6), 0.1),
        (dvec3(12.5, -8.0, 1.0), 0.4),
    ] {
        let middle = dvec3(12.0, 12.0, 0.0);
        let mut list = List::default();
        for i in 0..1024_u32 {
            // Along a Z-order curve, as pixels come.
            let bits = |i: u32| (0..5).map(|k| (i >> (2 * k) & 1) << k).sum::<u32>();
            let (u, v) = (f64::from(bits(i)) / 16.0 - 1.0, f64::from(bits(i >> 1)) / 16.0 - 1.0);
            let target = middle + spread * dvec3(9.0 * u, 9.0 * v, 0.2 * v);
            let left = (i % 8 == 3).then_some((i / 2, Side::Front));
            list.push(&Ray::new(eye, unit(target - eye).unwrap()), Span::FORWARD, left);
        }
        let (rays, together) = (2 * 1024 * Backend::available().len() as u64, check(&primitives, &list));
        assert!(2 * together > rays, "{together} of {rays} from {eye}");
    }
}

/// Blocks of several heights on a square, as two triangles a face.
fn blocks(scale: f64) -> Vec<(Primitive, Sides)> {
    let height = |x: i32, y: i32| f64::from((x * 5 + y * 3 + x * y) % 4) * 0.5;
    let mut faces = Vec::new();
    let mut face = |corners: [DVec3; 4]| {
        let [a, b, c, d] = corners.map(|corner| scale * corner);
        faces.push((Primitive::from(Triangle::new(a, b, c)), Sides::Both));
        faces.push((Triangle::new(a, c, d).into(), Sides::Both));
    };
    for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
        let ([x0, x1], [y0, y1]) = ([x, x + 1].map(f64::from), [y, y + 1].map(f64::from));
        let (here, right, behind) = (height(x, y), height(x + 1, y), height(x, y + 1));
        face([dvec3(x0, y0, here), dvec3(x1, y0, here), dvec3(x1, y1, here), dvec3(x0, y1, here)]);
        face([dvec3(x1, y0, here), dvec3(x1, y1, here), dvec3(x1, y1, right), dvec3(x1, y0, right)]);
        face([dvec3(x0, y1, here), dvec3(x1, y1, here), dvec3(x1, y1, behind), dvec3(x0, y1, behind)]);
    }
    faces
}

/// Rays that leave faces of blocks, from points where others have hit them: plainly, or half of them hardly leaving their
/// planes, or starting at once.
fn leaving(blocks: &[(Primitive, Sides)], plainly: bool) -> List {
    let mut list = List::default();
    let part = |i: u32, by: f64| (f64::from(i) * by).fract();
    for i in 0..3000_u32 {
        let number = i * 7 % u32::try_from(blocks.len()).unwrap();
        let Primitive::Triangle(triangle) = &blocks[number as usize].0 else { continue };
        let [a, b, c] = triangle.vertices();
        let target = a + part(i, 0.618_033_9) * 0.5 * (b - a) + part(i, 0.754_877_7) * 0.5 * (c - a);
        let size = a.abs().max_element().max(1e-3);
        let eye = target + size * dvec3(part(i, 0.569_8) - 0.5, part(i, 0.32) - 0.5, part(i, 0.47) + 0.2);
        let Some(arriving) = Ray::between(eye, target) else { continue };
        let Some(t) =
            triangle.intersect(&Probe::new(Scalar, &arriving, Span::FORWARD, true), Sides::Both, None)
        else {
            continue;
        };
        let flat = if plainly || i % 2 == 0 { 1.0 } else { [1e-2, 1e-4, 1e-7, 1e-12][i as usize / 2 % 4] };
        let normal = (b - a).cross(c - a).normalize();
        let along = dvec3(part(i, 0.438) - 0.5, part(i, 0.287) - 0.5, part(i, 0.193) - 0.5);
        let across = along - normal.dot(along) * normal;
        let sense = if i % 3 == 0 { -1.0 } else { 1.0 };
        let Some(direction) = unit(across + sense * flat * normal) else { continue };
        let side = if sense > 0.0 { Side::Front } else { Side::Back };
        // As far as an engine lets rays start, and much nearer.
        let start = if plainly { 1e-12 } else { [1e-12, 1e-12, 1e-14, 0.0][i as usize % 4] } * 20.0 * size;
        let span = Span { start, end: f64::INFINITY };
        list.push(&Ray::new(arriving.at(t), direction), span, Some((number, side)));
    }
    list
}

/// Rays that leave faces on a grid go past the boxes that end in these, and miss nothing that lies in them.
#[test]
fn rays_leave_faces_behind() {
    let mut steps = [0, 0];
    // On a grid that single precision has, and on one that it has not.
    for (steps, scale) in steps.iter_mut().zip([1.0, 1.1 / 3.0]) {
        let blocks = blocks(scale);
        for plainly in [false, true] {
            let list = leaving(&blocks, plainly);
            assert!(list.left.len() > 2000, "{}", list.left.len());
            check_stages(&blocks, &list);
        }
        let list = leaving(&blocks, true);
        let hierarchy = Hierarchy::new(blocks.iter().map(|(primitive, sides)| (primitive, *sides)));
        let mut scratch = hierarchy.scratch();
        let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
        let rays = list.columns(&left);
        let mut occluded = vec![false; list.left.len()];
        hierarchy.occluded_each(&rays, &mut occluded, &mut scratch);
        *steps = scratch.steps.nodes + scratch.steps.leaves;
    }
    assert!(10 * steps[0] < 9 * steps[1], "{steps:?}");
}

/// They are met in the order of the leaves, whatever their numbers are.
#[test]
fn of_equally_near_spheres_that_a_cone_leaves_the_first_is_hit() {
    for order in [[(5.0, 1.0), (6.0, 2.0)], [(6.0, 2.0), (5.0, 1.0)]] {
        let near = order.map(|(z, radius)| Sphere::new(dvec3(0.0, 0.0, z), radius));
        let far = (0..40).map(|i| Sphere::new(dvec3(100.0 + 5.0 * f64::from(i), 0.0, 0.0), 1.0));
        let spheres: Vec<_> =
            near.into_iter().chain(far).map(|sphere| (Primitive::from(sphere), Sides::Both)).collect();
        let mut list = List::default();
        for _ in 0..256 {
            list.push(&Ray::new(dvec3(0.0, 0.0, 0.0), dvec3(0.0, 0.0, 1.0)), Span::FORWARD, None);
        }
        assert!(check(&spheres, &list) > 0);
    }
}

/// Few spheres have no tree: blocks of rays have a cone round them, which shows most spheres to be missed.
#[test]
fn rays_among_few_spheres_are_answered_together() {
    let (mut together, mut rays) = (0, 0);
    for seed in 0..128_u32 {
        // Squares of distances overflow, or underflow.
        let (scale, is_plain) =
            [(1.0, true), (1.3e154, false), (1e-200, false), (3e-161, false)][seed as usize % 4];
        let way = seed / 4 % 4;
        // Up to eight are tested by all; of more, cones leave few, or not; of more than 64, groups have several groups.
        let (n, radius) =
            [(3, 0.0), (4, 0.0), (6, 0.0), (8, 0.0), (9, 0.264), (20, 0.22), (64, 0.044), (500, 0.02)]
                [seed as usize / 16];
        let at = |i: u32, k: f64| 2.0 * (f64::from(1 + seed * 72 + i) * k).fract() - 1.0;
        let point = |i: u32| dvec3(at(i, 0.618_033_9), at(i, 0.754_877_7), at(i, 0.569_840_3));
        let radius = if n <= 8 { 0.1 + 0.1 * f64::from(seed % 5) } else { radius };
        let spheres: Vec<_> = (0..n)
            .map(|i| (Primitive::from(Sphere::new(scale * point(i), scale * radius)), Sides::Both))
            .collect();
        // From an eye, and from all over a patch towards a light, as rays that leave a sphere do.
        let (eye, light) = (2.5 * point(70), 3.0 * point(71));
        let spread = 0.002 * f64::from(1 + seed % 7);
        let mut list = List::default();
        for i in 0..700 {
            let aside = spread * dvec3(f64::from(i % 16), f64::from(i / 16 % 16), 0.0);
            let is_before_cut = (463..466).contains(&i);
            let (origin, target) = match way % 2 {
                // The last ones before the cut, fewer than lanes, go elsewhere.
                0 if is_before_cut => (eye, point(2)),
                0 => (eye, point(n - 1) + aside),
                _ => (point(1) + aside, light),
            };
            let left = (way == 1).then_some((1, Side::Front));
            let direction = unit(target - origin).unwrap();
            list.push(&Ray::new(scale * origin, direction), Span::FORWARD, left);
        }
        let answered = check(&spheres, &list);
        if is_plain {
            together += answered;
            rays += 2 * 700 * Backend::available().len() as u64;
        }
    }
    assert!(10 * together > 7 * rays, "{together} of {rays}");
}

/// A wall before a light: what one ray finds in it answers others, whether these go alone, in packets or in tiles.
#[test]
fn light_rays_are_answered_by_what_blocked_others() {
    for (spread, is_wall_of_spheres) in [(0.01, false), (0.01, true), (1.0, false), (1.0, true)] {
        let at = |i: u32, k: f64| 2.0 * (f64::from(i) * k).fract() - 1.0;
        let point = |i: u32| dvec3(at(i, 0.618_033_9), at(i, 0.754_877_7), at(i, 0.569_840_3));
        // Small ones on this side, so that there is a tree; the wall; the light behind it.
        let mut primitives: Vec<_> = (0..300)
            .map(|i| {
                let (a, b, c) = (point(i), point(i + 400), point(i + 800));
                (Primitive::from(Triangle::new(a, a + 0.05 * b, a + 0.05 * c)), Sides::Both)
            })
            .collect();
        if is_wall_of_spheres {
            primitives.push((Sphere::new(dvec3(0.0, 0.0, -5.0), 3.0).into(), Sides::Both));
        } else {
            let [a, b, c] = [(-9.0, -9.0), (9.0, -9.0), (0.0, 18.0)].map(|(x, y)| dvec3(x, y, -3.0));
            primitives.push((Triangle::new(a, b, c).into(), Sides::Front));
            primitives.push((Triangle::new(a, c, b).into(), Sides::Front));
        }
        let light = dvec3(0.0, 0.0, -20.0);
        let mut list = List::default();
        for i in 0..900 {
            // Some leave the wall itself, on the side of the light, and some end before it.
            let (origin, left) = match i % 16 {
                5 => (dvec3(0.01 * f64::from(i % 7), 0.0, -3.0), Some((300, Side::Front))),
                _ => (spread * point(i), None),
            };
            let ray = Ray::new(origin, unit(light - origin).unwrap());
            let wall = |span| primitives.last()?.0.intersect(&ray, span, Sides::Both, None);
            // Some end before the wall, and some so near that only double precision tells.
            let end = match i % 16 {
                9 => 1.0,
                12 => wall(Span::FORWARD).map_or(1.0, |t| t * (1.0 - 1e-12)),
                13 => wall(Span::FORWARD).map_or(1.0, |t| t * (1.0 + 1e-12)),
                _ => (light - origin).length(),
            };
            list.push(&ray, Span { start: 0.0, end }, left);
        }
        let Bundled { blockers, .. } = check_stages(&primitives, &list);
        let rays = 900 * Backend::available().len() as u64;
        assert!(3 * blockers > rays, "{blockers} of {rays}, spread {spread}");
    }
}

/// In glass: rays that leave spheres into their insides, where others lie before them, or at the same distance.
#[test]
fn rays_inside_spheres_meet_them_again_or_what_lies_before() {
    let at = |i: u32, k: f64| 2.0 * (f64::from(i) * k).fract() - 1.0;
    let point = |i: u32| dvec3(at(i, 0.618_033_9), at(i, 0.754_877_7), at(i, 0.569_840_3));
    let unit_point = |i: u32| unit(point(i)).unwrap_or(DVec3::X);
    for sides in [Sides::Both, Sides::Back, Sides::Front] {
        let mut primitives = Vec::new();
        for i in 0..200 {
            let center = 3.0 * point(i);
            primitives.push((Primitive::from(Sphere::new(center, 0.5)), sides));
            // Small ones inside, and one of the same size, told from the other by its number alone.
            primitives.push((Sphere::new(center + 0.3 * unit_point(i + 7), 0.1).into(), sides));
            if i % 5 == 0 {
                primitives.push((Sphere::new(center, 0.5).into(), sides));
            }
        }
        let spheres: Vec<Sphere> = primitives
            .iter()
            .map(|(primitive, _)| match primitive {
                Primitive::Sphere(sphere) => *sphere,
                _ => unreachable!("all are spheres"),
            })
            .collect();
        let mut list = List::default();
        for i in 0..3000 {
            // Of a few each that part, and of many that stay together: under shafts.
            let (together, spread) = if i < 1000 { (4, 0.3) } else { (64, 0.01) };
            let number = i / together % u32::try_from(spheres.len()).unwrap();
            let sphere = spheres[number as usize];
            let outwards = unit_point(i / together * 13 + 1);
            let inwards = unit(-outwards + spread * unit_point(i + 5)).unwrap();
            // A few leave outwards, and some are short.
            let is_outwards = i < 1000 && i % 11 == 3;
            let (direction, side) = if is_outwards { (outwards, Side::Front) } else { (inwards, Side::Back) };
            let end = [f64::INFINITY, 0.3, f64::INFINITY, f64::NAN][i as usize % 4];
            let origin = sphere.center() + sphere.radius() * outwards;
            list.push(&Ray::new(origin, direction), Span { start: 1e-9, end }, Some((number, side)));
        }
        let Bundled { at_once, .. } = check_stages(&primitives, &list);
        assert_eq!(
            at_once > 500,
            sides != Sides::Front,
            "{sides:?}: {at_once} of 3000 meet their own sphere"
        );
    }
}
