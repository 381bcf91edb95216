//! `cargo xtask tidy`: checks that no linter knows.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{Outcome, project};

/// What a crate may depend on: crates of the workspace, and crates from outside.
///
/// Dev-dependencies follow the same arrows within the workspace.
const LAYERS: &[(&str, &[&str], &[&str])] = &[
    ("rayset-simd", &[], &["libc"]),
    ("rayset-geometry", &["rayset-simd"], &["glam"]),
    ("rayset-bvh", &["rayset-geometry", "rayset-simd"], &["rayon"]),
    (
        "rayset-scene",
        &["rayset-geometry"],
        &["earcut", "flate2", "libm", "rand_chacha", "strsim", "thiserror", "tobj", "toml"],
    ),
    ("rayset-engine", &["rayset-bvh", "rayset-geometry", "rayset-scene", "rayset-simd"], &["libm", "rayon"]),
    ("rayset-image", &[], &["exr", "image", "libm", "rayon", "thiserror"]),
    (
        "rayset-study",
        &["rayset", "rayset-engine", "rayset-geometry", "rayset-image", "rayset-scene", "rayset-simd"],
        &["base64", "cpu-time", "csv", "maud", "plotters", "serde", "serde_json", "thiserror"],
    ),
    (
        "rayset",
        &["rayset-bvh", "rayset-engine", "rayset-geometry", "rayset-image", "rayset-scene", "rayset-simd"],
        &[],
    ),
    ("rayset-cli", &["rayset"], &["clap", "ctrlc", "indicatif", "rayon", "serde", "serde_json", "sha2"]),
    (
        "xtask",
        &["rayset", "rayset-engine", "rayset-image", "rayset-scene", "rayset-study"],
        &["clap", "ctrlc", "indicatif", "libm", "rayon", "serde_json", "sha2", "tempfile"],
    ),
];

/// The one crate where `unsafe` may stand.
const UNSAFE_CRATE: &str = "rayset-simd";

/// The other libraries of the bench: a workspace of its own, with an interface to C.
const UNSAFE_WORKSPACE: &str = "xtask/peers";

pub(crate) fn run() -> Outcome {
    let output = project::cargo(&["metadata", "--format-version", "1", "--no-deps"]).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    let metadata: Value = serde_json::from_slice(&output.stdout)?;
    let mut problems = layer_problems(&metadata);
    problems.extend(unsafe_problems(project::root())?);
    for problem in &problems {
        println!("{problem}");
    }
    match problems.len() {
        0 => {
            println!("the layers are as they should be");
            Ok(())
        }
        count => Err(format!("{count} problems").into()),
    }
}

/// Dependencies that the layers do not allow, and crates that lack what a published crate needs.
fn layer_problems(metadata: &Value) -> Vec<String> {
    let mut problems = Vec::new();
    let empty = Vec::new();
    for package in metadata["packages"].as_array().unwrap_or(&empty) {
        let name = package["name"].as_str().unwrap_or_default();
        let Some((_, inside, outside)) = LAYERS.iter().find(|layer| layer.0 == name) else {
            problems.push(format!("{name} has no place among the layers of xtask/src/tidy.rs"));
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap_or(&empty) {
            let other = dependency["name"].as_str().unwrap_or_default();
            let is_ours = LAYERS.iter().any(|layer| layer.0 == other);
            let is_dev = dependency["kind"].as_str() == Some("dev");
            let allowed = if is_ours { inside.contains(&other) } else { is_dev || outside.contains(&other) };
            if !allowed {
                problems.push(format!("{name} must not depend on {other}"));
            }
        }
        let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
        if name != "xtask" {
            let folder = manifest.parent().unwrap_or(manifest);
            for file in ["README.md", "LICENSE"] {
                if !folder.join(file).exists() {
                    problems.push(format!("{name} has no {file}"));
                }
            }
            if package["description"].as_str().is_none() {
                problems.push(format!("{name} has no description"));
            }
        }
        match fs::read_to_string(manifest) {
            Ok(text) if text.contains("[lints]\nworkspace = true") || name == UNSAFE_CRATE => {}
            _ => problems.push(format!("{name} does not inherit the lints of the workspace")),
        }
    }
    problems
}

/// Source files outside the one crate that use `unsafe`, by word; the compiler forbids it too.
fn unsafe_problems(root: &Path) -> Result<Vec<String>, std::io::Error> {
    let mut problems = Vec::new();
    let mut folders = vec![root.join("crates"), root.join("xtask")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                if !path.ends_with(UNSAFE_CRATE) && !path.ends_with(UNSAFE_WORKSPACE) {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path)?;
                let block = ["unsafe", " {"].concat();
                if text.contains(&block) {
                    problems.push(format!("{} uses unsafe code", path.display()));
                }
            }
        }
    }
    Ok(problems)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn problems(name: &str, dependency: &str, kind: Option<&str>) -> Vec<String> {
        let manifest = project::root().join("crates").join(name).join("Cargo.toml");
        let manifest = if name == "xtask" { project::root().join("xtask/Cargo.toml") } else { manifest };
        layer_problems(&json!({ "packages": [{
            "name": name,
            "description": "",
            "manifest_path": manifest,
            "dependencies": [{ "name": dependency, "kind": kind }],
        }]}))
    }

    #[test]
    fn arrows_go_down_only() {
        assert_eq!(problems("rayset-engine", "rayset-scene", None), [""; 0]);
        assert_eq!(
            problems("rayset-scene", "rayset-engine", None),
            ["rayset-scene must not depend on rayset-engine"]
        );
        assert_eq!(
            problems("rayset-image", "rayset-geometry", Some("dev")),
            ["rayset-image must not depend on rayset-geometry"]
        );
    }

    #[test]
    fn crates_from_outside_are_named_unless_they_only_test() {
        assert_eq!(problems("rayset-scene", "tobj", None), [""; 0]);
        assert_eq!(problems("rayset-engine", "tobj", None), ["rayset-engine must not depend on tobj"]);
        assert_eq!(problems("rayset-engine", "proptest", Some("dev")), [""; 0]);
    }
}
