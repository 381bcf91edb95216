//! Grids and walks by hand, and against a loop over all primitives where rounding decides.

use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Cone, Polygon, Primitive, Ray, Side, Sides, Span, Sphere, Triangle, unit};
use rayset_scene::{LightId, Material, ObjectId, PrimitiveId, SceneBuilder};

use super::*;
use crate::{RaySetIndex, Slot};

/// Each primitive an object of its own.
fn scene_of(primitives: &[Primitive]) -> Scene {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    for primitive in primitives {
        builder.add_object("", material, [primitive.clone()]);
    }
    builder.build().unwrap()
}

fn brute_force(primitives: &[Primitive], ray: &Ray, span: Span) -> Option<Hit> {
    let hits = primitives.iter().zip(0..).filter_map(|(primitive, i)| {
        let t = primitive.intersect(ray, span, Sides::Both, None)?;
        Some(Hit { t, object: ObjectId(i), primitive: PrimitiveId(i) })
    });
    hits.fold(
        None,
        |least: Option<Hit>, hit| {
            if least.is_none_or(|least| hit.precedes(&least)) { Some(hit) } else { least }
        },
    )
}

fn nearest(tracer: &mut dyn Tracer, ray: Ray, span: Span) -> Option<Hit> {
    tracer.nearest(&RayQuery { ray_set: RaySetIndex(0), slot: Slot::ROOT, originating: None, ray, span })
}

/// Whether a light ray is blocked that leaves the last primitive, which is where no ray comes.
fn occluded(tracer: &mut dyn Tracer, left: usize, ray: Ray, span: Span) -> bool {
    let id = u32::try_from(left).unwrap();
    let originating = Originating { object: ObjectId(id), primitive: PrimitiveId(id), side: Side::Front };
    tracer.occluded(&ShadowQuery {
        ray_set: RaySetIndex(0),
        slot: Slot::ROOT,
        light: LightId(0),
        originating,
        ray,
        span,
    })
}

/// Spheres and triangles on a lattice of 4 by 4 by 4, some of them twice, and two that reach over many cells.
fn lattice() -> Vec<Primitive> {
    let mut primitives: Vec<Primitive> = Vec::new();
    for i in 0..64 {
        let center = dvec3(f64::from(i % 4), f64::from(i / 4 % 4), f64::from(i / 16));
        if i % 3 == 0 {
            let corner = center + DVec3::splat(0.5);
            primitives.push(Triangle::new(center, corner, center + 0.5 * DVec3::X).into());
        } else {
            primitives.push(Sphere::new(center, 0.25 + 0.25 * f64::from(i % 2)).into());
        }
        if i % 7 == 0 {
            primitives.push(primitives[primitives.len() - 1].clone());
        }
    }
    primitives.push(Sphere::new(DVec3::splat(1.5), 1.75).into());
    primitives.push(Triangle::new(DVec3::ZERO, dvec3(3.0, 3.0, 0.0), dvec3(0.0, 3.0, 3.0)).into());
    primitives
}

#[test]
fn coordinates_are_found_between_the_planes_that_hold_them() {
    let planes = [0.0, 0.1, 0.2, 0.30000000000000004, 0.4, 0.5];
    let cell = |x| grid::locate(&planes, x);
    for i in 0..5 {
        assert_eq!(cell(planes[i]), i);
        assert_eq!(cell(planes[i].next_down()), i.saturating_sub(1));
        assert_eq!(cell(planes[i + 1].next_down()), i);
    }
    assert_eq!([cell(-1.0), cell(0.5), cell(7.0), cell(f64::INFINITY)], [0, 4, 4, 4]);
    assert_eq!(grid::locate(&[2.0, 2.0], 2.0), 0);
}

#[test]
fn walk_visits_the_cells_of_a_diagonal_and_of_a_row() {
    // 36 points make a grid of 6 by 6 by 6.
    let points: Vec<Primitive> =
        (0..36).map(|i| Sphere::new(DVec3::splat(f64::from(i % 2) * 6.0), 0.0).into()).collect();
    let scene = scene_of(&points);
    let grid = Grid::of(&scene, CELL_MARGIN).unwrap();
    assert_eq!(grid.strides, [1, 6, 36]);
    let walk = |origin: DVec3, direction: DVec3, end: f64| {
        let ray = Ray::new(origin, unit(direction).unwrap());
        let Entry::Inside(mut walk) = grid.enter(&ray, Span { start: 0.0, end }) else { return Vec::new() };
        let mut cells = vec![walk.cell];
        while walk.step(f64::INFINITY) {
            cells.push(walk.cell);
        }
        cells
    };
    let row: Vec<usize> = (0..6).map(|i| i + 2 * 6 + 3 * 36).collect();
    let back: Vec<usize> = row.iter().rev().copied().collect();
    assert_eq!(walk(dvec3(-1.0, 2.5, 3.5), DVec3::X, f64::INFINITY), row);
    assert_eq!(walk(dvec3(7.0, 2.5, 3.5), -DVec3::X, f64::INFINITY), back);
    // From inside, and to a span's end in the second cell from there.
    assert_eq!(walk(dvec3(2.5, 2.5, 3.5), dvec3(1.0, -0.0, 0.0), 1.0), row[2..4]);
    // Past the grid, and away from it.
    assert!(walk(dvec3(-1.0, 7.0, 3.5), DVec3::X, f64::INFINITY).is_empty());
    assert!(walk(dvec3(-1.0, 2.5, 3.5), -DVec3::X, f64::INFINITY).is_empty());
    assert!(walk(dvec3(-1.0, 2.5, 3.5), DVec3::X, 0.5).is_empty());
    let diagonal = walk(DVec3::splat(-1.0), DVec3::ONE, f64::INFINITY);
    assert_eq!((diagonal[0], diagonal[diagonal.len() - 1]), (0, 215));
    // Three steps a cell at most, and one at least.
    assert!((6..=16).contains(&diagonal.len()), "{diagonal:?}");
}

#[test]
fn rays_on_faces_edges_and_corners_of_cells_find_what_brute_force_finds() {
    let primitives = lattice();
    let scene = scene_of(&primitives);
    for backend in Backend::ALL {
        let strategy = Cellular::on(&scene, *backend);
        let grid = strategy.grid.as_ref().unwrap();
        let mut tracer = strategy.begin_sweep(Recording::Off);
        let tiny = [0.0, -0.0, f64::from_bits(1), -f64::MIN_POSITIVE, 1e-31, -1e-29, 1e-16];
        let mut directions = Vec::new();
        for i in 0..27 {
            let sign = |i: i32| f64::from(i % 3 - 1);
            let direction = dvec3(sign(i), sign(i / 3), sign(i / 9));
            for (j, small) in tiny.iter().enumerate() {
                // A small number in place of every zero.
                let replaced = direction.to_array().map(|d| if d == 0.0 { *small } else { d });
                let is_new = j == 0 || direction.to_array().contains(&0.0);
                directions.extend(unit(DVec3::from_array(replaced)).filter(|_| is_new && i != 13));
            }
        }
        let places: Vec<Vec<f64>> = (0..3)
            .map(|k| {
                let planes = &grid.planes[k];
                let n = planes.len() - 1;
                [planes[0], planes[1], planes[n / 2], planes[n], 1.25, -9.0].into()
            })
            .collect();
        let mut hits = 0;
        for i in 0..216 {
            let origin = dvec3(places[0][i % 6], places[1][i / 6 % 6], places[2][i / 36]);
            for &direction in &directions {
                let ray = Ray::new(origin, direction);
                let whole = brute_force(&primitives, &ray, Span::FORWARD);
                assert_eq!(nearest(tracer.as_mut(), ray, Span::FORWARD), whole, "{ray:?}");
                let t = whole.map_or(2.0, |hit| hit.t);
                hits += usize::from(whole.is_some());
                for (start, end) in [(0.0, t), (0.0, t.next_up()), (t, 1e9), (t.next_down(), f64::MAX)] {
                    let span = Span { start, end };
                    let expected = brute_force(&primitives, &ray, span);
                    assert_eq!(nearest(tracer.as_mut(), ray, span), expected, "{ray:?}, {span:?}");
                }
            }
        }
        assert!(hits > 5000, "{hits}");
    }
}

#[test]
fn light_rays_are_blocked_where_brute_force_says() {
    let mut primitives = lattice();
    primitives.push(Sphere::new(DVec3::splat(-40.0), 0.0).into());
    let left = primitives.len() - 1;
    let scene = scene_of(&primitives);
    let strategy = Cellular::new(&scene);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let mut dice = Dice(3);
    let mut blocked = 0;
    for _ in 0..20_000 {
        let origin = DVec3::splat(1.5) + 3.0 * dice.vector();
        let ray = Ray::new(origin, unit(dice.vector()).unwrap());
        let span = Span { start: 1e-9, end: 0.5 + dice.number().abs() };
        let expected = brute_force(&primitives, &ray, span).is_some();
        blocked += usize::from(expected);
        assert_eq!(occluded(tracer.as_mut(), left, ray, span), expected, "{ray:?}, {span:?}");
    }
    assert!((2000..18_000).contains(&blocked), "{blocked}");
}

#[test]
fn of_equally_near_hits_in_one_cell_the_least_id_counts_whatever_the_volume() {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    // Split by x: the volume with ids 2 and 3 comes first, and its columns are followed by those of ids 0 and 1.
    builder.add_object("", material, [0.5, 0.5, 0.0, 0.0].map(|x| Sphere::new(dvec3(x, 0.0, 0.0), 1.0)));
    builder.max_volume_primitives(Some(2));
    let scene = builder.build().unwrap();
    for backend in Backend::ALL {
        let strategy = Cellular::on(&scene, *backend);
        let mut tracer = strategy.begin_sweep(Recording::Off);
        let hit = nearest(tracer.as_mut(), Ray::new(dvec3(0.25, 0.0, -3.0), DVec3::Z), Span::FORWARD);
        assert_eq!(hit.map(|hit| hit.primitive), Some(PrimitiveId(0)));
        // A run of one object's primitives is tested at once all the same.
        assert_eq!(scene.location(PrimitiveId(2)).index + 2, scene.location(PrimitiveId(0)).index);
    }
}

/// Numbers from -1 to 1 that are the same every time.
struct Dice(u64);

impl Dice {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        dvec3(self.number(), self.number(), self.number())
    }
}

#[test]
fn margin_is_needed_and_enough() {
    let mut dice = Dice(1985);
    let (mut hits, mut lost) = (0, [0; 2]);
    for case in 0..1500 {
        let (center, axis) = (dice.vector(), case % 3);
        let corners = [0; 3].map(|_| center + 0.3 * dice.vector());
        let primitive: Primitive = match case % 4 {
            0 => Sphere::new(center, 0.3).into(),
            1 => Triangle::new(corners[0], corners[1], corners[2]).into(),
            2 => Polygon::new(corners.into()).unwrap().into(),
            _ => Cone::new(corners[0], 0.1, corners[1], 0.0).unwrap().into(),
        };
        // The point that touches the upper face of the box, seen from as far away as can be.
        let target = match &primitive {
            Primitive::Sphere(sphere) => {
                let mut top = sphere.center();
                top[axis] += 0.3;
                top
            }
            Primitive::Cone(cone) => cone.apex(),
            _ => corners.into_iter().max_by(|a, b| a[axis].total_cmp(&b[axis])).unwrap(),
        };
        let primitives = [primitive];
        let scene = scene_of(&primitives);
        let strategies =
            [0.0, CELL_MARGIN].map(|margin| Cellular::with_margin(&scene, Backend::Scalar, margin));
        let mut tracers = strategies.each_ref().map(|strategy| strategy.begin_sweep(Recording::Off));
        for _ in 0..40 {
            let mut direction = dice.vector();
            direction[axis] *= [1.0, 1e-7, 0.0][case / 4 % 3];
            let direction = unit(direction).unwrap();
            let far = 1000.0 * scene.extent() / direction.abs().max_element();
            let ray = Ray::new(target + 1e-13 * dice.vector() - far * direction, direction);
            let expected = brute_force(&primitives, &ray, Span::FORWARD);
            hits += usize::from(expected.is_some());
            for (tracer, lost) in tracers.iter_mut().zip(&mut lost) {
                *lost += usize::from(nearest(tracer.as_mut(), ray, Span::FORWARD) != expected);
            }
        }
    }
    eprintln!("{hits} hits, {lost:?} lost without and with the margin");
    assert!(hits > 10_000 && lost[0] > 100, "{hits} hits, {lost:?} lost");
    assert_eq!(lost[1], 0);
}

#[test]
fn scenes_of_any_size_and_place_agree_with_brute_force() {
    let mut dice = Dice(1987);
    let mut hits = 0;
    for case in 0..120_i32 {
        let scale = [1e-140, 1e-30, 1e-3, 1.0, 1e6, 1e50][usize::try_from(case % 6).unwrap()];
        let place = [0.0, 1.0, 1e4][usize::try_from(case / 6 % 3).unwrap()] * DVec3::new(1.0, -1.0, 0.5);
        let flat = if case % 4 == 0 { dvec3(1.0, 1.0, 0.0) } else { DVec3::ONE };
        let mut primitives: Vec<Primitive> = Vec::new();
        for i in 0..40 {
            let mut point = || scale * (place + flat * dice.vector());
            let (a, b, c) = (point(), point(), point());
            let size = 0.1 * scale * [1.0, 1e-3, 10.0][i % 3];
            primitives.push(match (case, i % 5) {
                (_, 0) => Triangle::new(a, a + 0.2 * (b - a), a + 0.2 * (c - a)).into(),
                (_, 1) => Cone::new(a, 0.3 * size, a + 0.3 * (b - a), 0.0).unwrap().into(),
                // The same once more: only the id tells them apart.
                (_, 2) if i > 5 => primitives[i - 5].clone(),
                _ => Sphere::new(a, size).into(),
            });
        }
        let scene = scene_of(&primitives);
        let strategy = Cellular::new(&scene);
        let mut tracer = strategy.begin_sweep(Recording::Off);
        for i in 0..150_usize {
            let target = scene.objects()[i % 40].bounds.center;
            let away = [0.3, 3.0, 500.0, 1e5][i % 4] * scale;
            let mut direction = dice.vector();
            direction[i % 3] *= f64::from(u8::from(i % 5 > 0));
            let direction = unit(direction).unwrap();
            let ray = Ray::new(target - away * direction, direction);
            let expected = brute_force(&primitives, &ray, Span::FORWARD);
            hits += usize::from(expected.is_some());
            assert_eq!(nearest(tracer.as_mut(), ray, Span::FORWARD), expected, "{case}, {ray:?}");
        }
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn rays_in_doubt_are_partitioned() {
    let primitives = [Sphere::new(DVec3::ZERO, 1.0).into(), Sphere::new(dvec3(0.0, 0.0, 3.0), 1.0).into()];
    let scene = scene_of(&primitives);
    let strategy = Cellular::new(&scene);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let far = |z: f64| Ray::new(dvec3(0.5, 0.0, z), DVec3::Z);
    for (ray, span, partitions) in [
        (far(-4000.0), Span::FORWARD, 0),
        (far(-5000.0), Span::FORWARD, 1),
        (far(-1e100), Span::FORWARD, 2),
        (far(0.0), Span { start: -1.0, end: 1.0 }, 3),
        (far(0.0), Span { start: 0.0, end: f64::NAN }, 4),
        (far(0.0), Span { start: f64::NAN, end: 1.0 }, 5),
        (far(0.0), Span { start: 2.0, end: 1.0 }, 6),
        (Ray::new(DVec3::NAN, DVec3::Z), Span::FORWARD, 7),
    ] {
        assert_eq!(nearest(tracer.as_mut(), ray, span), brute_force(&primitives, &ray, span), "{ray:?}");
        assert_eq!(tracer.stats().work.partitions, partitions, "{ray:?}, {span:?}");
    }
}

#[test]
fn scenes_without_a_proof_have_no_grid() {
    assert!(Cellular::new(&scene_of(&[])).grid.is_none());
    let tiny = [Sphere::new(DVec3::ZERO, 1e-160).into(), Sphere::new(DVec3::splat(1e-160), 1e-161).into()];
    assert!(Cellular::new(&scene_of(&tiny)).grid.is_none());
    assert!(Cellular::new(&scene_of(&[Sphere::new(DVec3::ZERO, 1e-140).into()])).grid.is_some());
    let point = scene_of(&[Sphere::new(DVec3::ONE, 0.0).into()]);
    let strategy = Cellular::new(&point);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let hit = nearest(tracer.as_mut(), Ray::new(dvec3(1.0, 1.0, -1.0), DVec3::Z), Span::FORWARD);
    assert_eq!(hit.map(|hit| hit.t), Some(2.0));
}

/// Cells along each axis, and references.
fn size_of(primitives: &[Primitive]) -> ([usize; 3], usize) {
    let grid = Grid::of(&scene_of(primitives), CELL_MARGIN).unwrap();
    let all: usize =
        (0..grid.strides[2] * (grid.planes[2].len() - 1)).map(|i| grid.references(i).len()).sum();
    (grid.planes.each_ref().map(|planes| planes.len() - 1), all)
}

#[test]
fn size_of_a_grid_is_bounded() {
    let n = 20_000;
    let ball = |center: DVec3, radius: f64| Primitive::from(Sphere::new(center, radius));
    // All in one place: any division would hold each in every cell.
    let (cells, references) = size_of(&vec![ball(DVec3::ZERO, 1.0); n]);
    assert!(cells.iter().product::<usize>() <= 27 && references <= 16 * n + (1 << 16), "{cells:?}");
    // A giant round many dwarfs: they fall into few cells.
    let mut dice = Dice(1);
    let mut uneven: Vec<_> = (1..n).map(|_| ball(dice.vector(), 1e-3)).collect();
    uneven.push(ball(DVec3::ZERO, 1e6));
    let (cells, references) = size_of(&uneven);
    assert!(cells.iter().all(|&n| (40..60).contains(&n)), "{cells:?}");
    assert!(references < 8 * n, "{references}");
    // A plane, a line and a point.
    let flat: Vec<_> = (0..n).map(|_| ball(dice.vector() * dvec3(1.0, 1.0, 0.0), 0.0)).collect();
    assert!(matches!(size_of(&flat), ([300..400, 300..400, 1], _)));
    let line: Vec<_> = (0..n).map(|_| ball(dice.number() * DVec3::Y, 0.0)).collect();
    assert!(matches!(size_of(&line), ([1, 1024, 1], _)));
    assert!(matches!(size_of(&[ball(DVec3::ONE, 0.0)]), ([1 | 2, 1 | 2, 1 | 2], 1..=8)));
}

#[test]
fn no_primitive_is_tested_twice_even_when_ray_numbers_start_again() {
    let scene = scene_of(&[Sphere::new(DVec3::ZERO, 1.0).into(), Sphere::new(DVec3::splat(9.0), 1.0).into()]);
    let grid = Grid::of(&scene, CELL_MARGIN).unwrap();
    let mut mailboxes = Mailboxes::of(&grid);
    for ray in [0, u32::MAX, 7, u32::MAX - 1] {
        mailboxes.ray = ray;
        mailboxes.next_ray();
        assert!(mailboxes.is_new(0) && !mailboxes.is_new(0) && mailboxes.is_new(1), "{ray}");
    }
    // A ray through all cells of the diagonal that misses both.
    let strategy = Cellular::new(&scene);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let direction = unit(DVec3::ONE).unwrap();
    assert_eq!(nearest(tracer.as_mut(), Ray::new(dvec3(1.5, -1.0, 0.0), direction), Span::FORWARD), None);
    let work = tracer.stats().work;
    assert!(work.primitive_tests <= 2 && work.cells_visited > 2, "{work:?}");
}
