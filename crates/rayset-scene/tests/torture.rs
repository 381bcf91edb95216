//! Every file of `fixtures/obj/torture` has exactly the outcome that `outcomes.txt` there states.
//!
//! Areas and normals are what the triangles add up to: a face that is covered twice or not at all shows in them.
#![cfg(feature = "obj")]

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use rayset_scene::geometry::Primitive;
use rayset_scene::glam::DVec3;
use rayset_scene::{LoadOptions, Material, ObjGroup, ObjModel, SceneBuilder, SceneError, load_obj};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/obj/torture")
}

/// A number to four decimals.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        large if !(1e-4..1e7).contains(&large) => format!("{value:.3e}"),
        _ => ((value * 1e4).round() / 1e4).to_string(),
    }
}

fn triple(vector: DVec3) -> String {
    vector.to_array().map(short).join(" ")
}

fn describe_group(group: &ObjGroup) -> String {
    let (mut area, mut vector, mut n_smooth) = (0.0, DVec3::ZERO, 0);
    for part in &group.triangles {
        let Primitive::Triangle(triangle) = &part.primitive else { panic!("{part:?} is no triangle") };
        let [a, b, c] = triangle.vertices();
        let cross = 0.5 * (b - a).cross(c - a);
        area += cross.length();
        vector += cross;
        n_smooth += usize::from(part.normals.is_some());
    }
    let name: String = group.name.chars().take(60).flat_map(char::escape_debug).collect();
    let mut text = format!("group `{name}`: {} triangles, area {}", group.triangles.len(), short(area));
    if area > 0.0 {
        write!(text, ", facing {}", triple(vector / area)).unwrap();
    }
    if n_smooth > 0 {
        write!(text, ", {n_smooth} with normals").unwrap();
    }
    if let Some(material) = group.material {
        write!(text, ", material {material}").unwrap();
    }
    text
}

/// The terms that are not those of the default.
fn describe_material((name, material): &(String, Material)) -> String {
    let default = Material::default();
    let mut text = format!("`{name}`:");
    let mut term = |what: &str, value: DVec3, default: DVec3| {
        if value != default {
            write!(text, " {what} {}", triple(value)).unwrap();
        }
    };
    term("diffuse", material.diffuse, default.diffuse);
    term("specular", material.specular, default.specular);
    term("reflectance", material.reflectance, default.reflectance);
    term("transmittance", material.transmittance, default.transmittance);
    term("emission", material.emission, default.emission);
    for (what, value, default) in
        [("shininess", material.shininess, default.shininess), ("index", material.index, default.index)]
    {
        if value.total_cmp(&default).is_ne() {
            write!(text, " {what} {}", short(value)).unwrap();
        }
    }
    text
}

fn describe(loaded: Result<ObjModel, SceneError>) -> Vec<String> {
    let without_folder = |text: String| text.replace(&format!("{}/", folder().display()), "");
    match loaded {
        Ok(model) => {
            let groups = model.groups.iter().map(describe_group);
            let materials = model
                .materials
                .iter()
                .enumerate()
                .map(|(i, m)| format!("material {i} {}", describe_material(m)));
            let warnings = model.warnings.iter().map(|w| without_folder(format!("warning {w}")));
            let lines = groups.chain(materials).chain(warnings).collect();
            let mut builder = SceneBuilder::new();
            model.add_to(&mut builder);
            if let Err(error) = builder.build() {
                panic!("{lines:?}: not built: {error}");
            }
            lines
        }
        Err(error) => {
            let source = error.source().map(|source| format!(": {source}")).unwrap_or_default();
            vec![without_folder(format!("error {error}{source}"))]
        }
    }
}

/// The cases of `outcomes.txt`: a name, and below it indented what is to come of it.
fn expected() -> BTreeMap<String, Vec<String>> {
    let text = fs::read_to_string(folder().join("outcomes.txt")).unwrap_or_default();
    let mut cases: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut current = String::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        match line.strip_prefix("  ") {
            Some(outcome) => cases.get_mut(&current).expect("a case has a name").push(outcome.to_owned()),
            None => {
                current = line.to_owned();
                let before = cases.insert(current.clone(), Vec::new());
                assert!(before.is_none(), "{current} stands twice in outcomes.txt");
            }
        }
    }
    cases
}

#[test]
fn every_file_has_its_outcome() {
    let expected = expected();
    let mut actual = BTreeMap::new();
    for entry in fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "obj") {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            actual.insert(name, describe(load_obj(&path, &LoadOptions::default())));
        }
    }
    let written = Path::new(env!("CARGO_TARGET_TMPDIR")).join("outcomes.txt");
    let text = actual.iter().map(|(name, lines)| format!("\n{name}\n  {}\n", lines.join("\n  ")));
    fs::write(&written, text.collect::<String>()).unwrap();
    for name in actual.keys().chain(expected.keys()) {
        assert_eq!(actual.get(name), expected.get(name), "{name}; all outcomes are in {}", written.display());
    }
    assert!(actual.len() >= 200, "only {} files", actual.len());
}
