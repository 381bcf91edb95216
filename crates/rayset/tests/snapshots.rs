//! Rendered images and their counts as snapshots a reviewer can read, and as goldens compared bit by bit.

use std::path::PathBuf;

use rayset::ChannelNames;
use rayset::engine::{Backend, Frame, Layers, RenderOptions, StrategyKind, render};
use rayset::image::{Image, Samples, compare, read_exr, write_exr};
use rayset::scene::{RandomSpheres, Scene};

/// The options of the golden images.
fn options() -> RenderOptions {
    RenderOptions { width: 64, height: 48, ..RenderOptions::default() }
}

fn spheres(count: u32) -> Scene {
    RandomSpheres { count, seed: 1, ..RandomSpheres::default() }.scene().unwrap()
}

fn image_of(frame: &Frame) -> Image {
    rayset::image_of(frame, ChannelNames::Plain, &[]).unwrap()
}

/// Writes an image and reads it back; the two must have the same bits.
fn through_a_file(image: &Image) -> Image {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.exr");
    write_exr(&path, image).unwrap();
    let read = read_exr(&path).unwrap();
    let comparison = compare(image, &read, 0.0).unwrap();
    assert!(comparison.is_identical(), "{comparison}");
    read
}

fn golden(name: &str) -> Image {
    let fixtures = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    read_exr(&fixtures.join("golden").join(format!("{name}.exr"))).unwrap()
}

fn check(name: &str, scene: &Scene) {
    for &kind in StrategyKind::ALL {
        let strategy = kind.bind_on(scene, Backend::Portable);
        let frame = render(strategy.as_ref(), &options()).unwrap();
        let image = through_a_file(&image_of(&frame));
        insta::assert_snapshot!(format!("{name}-{kind}-image"), image.summary(8, 6));
        insta::assert_snapshot!(
            format!("{name}-{kind}-counts"),
            format!("{}\n{}", frame.counts, frame.stats)
        );
        if strategy.is_exact() {
            let comparison = compare(&golden(name), &image, 0.0).unwrap();
            assert!(comparison.is_identical(), "{name} by {kind}: {comparison}");
        }
    }
}

#[test]
fn one_sphere_looks_as_it_did() {
    check("spheres-1", &spheres(1));
}

#[test]
fn eight_spheres_look_as_they_did() {
    check("spheres-8", &spheres(8));
}

#[cfg(feature = "obj")]
#[test]
fn cornell_box_loads_as_it_did() {
    let fixtures = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let model = rayset::scene::load_obj(
        &fixtures.join("obj/cornell/CornellBox-Sphere.obj"),
        &rayset::scene::LoadOptions::default(),
    )
    .unwrap();
    let mut text = String::new();
    for group in &model.groups {
        let material = group.material.map_or("none", |i| model.materials[i].0.as_str());
        text += &format!("{}: {} triangles of {material}\n", group.name, group.triangles.len());
    }
    for warning in &model.warnings {
        text += &format!("line {}: {}\n", warning.line, warning.message);
    }
    for (name, material) in &model.materials {
        text += &format!("{name}: {material:?}\n");
    }
    insta::assert_snapshot!(text);
}

#[test]
fn every_layer_survives_a_file() {
    let scene = spheres(8);
    let options = RenderOptions { layers: Layers::ALL, ..options() };
    let mut frame =
        render(StrategyKind::Speer1985.bind_on(&scene, Backend::Portable).as_ref(), &options).unwrap();
    let exact = render(StrategyKind::Standard.bind_on(&scene, Backend::Portable).as_ref(), &options).unwrap();
    frame.mark_wrong(&exact);
    let image = rayset::image_of(&frame, ChannelNames::Layered, &[]).unwrap();
    let image = through_a_file(&image);
    let layers: Vec<_> = image
        .layers()
        .iter()
        .map(|layer| {
            let components = layer.channels.iter().map(|channel| match channel.samples() {
                Samples::F32(_) => format!("{} float", channel.component()),
                Samples::U32(_) => format!("{} uint", channel.component()),
            });
            format!("{}: {}", layer.name, components.collect::<Vec<_>>().join(", "))
        })
        .collect();
    insta::assert_snapshot!(layers.join("\n"));
    let rays: u64 = ["initial", "reflected", "refracted", "shadow"]
        .iter()
        .flat_map(|kind| frame.integers(&format!("rays.{kind}")).unwrap())
        .map(|&rays| u64::from(rays))
        .sum();
    assert_eq!(rays, frame.counts.total().cast, "every ray belongs to one pixel");
    let wrong: u32 = frame.integers("wrong.1985").unwrap().iter().sum();
    assert_eq!(wrong as usize, frame.differing_pixels(&exact));
}

#[test]
fn recording_changes_no_pixel_and_no_count() {
    let scene = spheres(8);
    for &kind in StrategyKind::ALL {
        let strategy = kind.bind_on(&scene, Backend::Portable);
        let plain = render(strategy.as_ref(), &options()).unwrap();
        let options = RenderOptions { layers: Layers::ALL, ..options() };
        let recorded = render(strategy.as_ref(), &options).unwrap();
        assert_eq!(plain.differing_pixels(&recorded), 0, "{kind}");
        assert_eq!(plain.stats, recorded.stats, "{kind}");
    }
}
