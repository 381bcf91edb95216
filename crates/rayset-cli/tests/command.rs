//! The command as a user runs it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

const SCENE: &str = r#"
background = [0.1, 0.2, 0.3]
[camera]
from = [0, 0, 6]
at = [0, 0, 0]
angle = 28
[[light]]
position = [-4, 6, 6]
[[random_spheres]]
count = 8
seed = 1
"#;

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("spheres.toml"), SCENE).unwrap();
    folder
}

fn rayset(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rayset"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

/// Runs a command that must succeed; what it prints.
fn done(folder: &Path, arguments: &str) -> String {
    let output = rayset(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "rayset {arguments}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Runs a command that must fail with status 2; its message.
fn refused(folder: &Path, arguments: &str) -> String {
    let output = rayset(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "rayset {arguments}");
    String::from_utf8(output.stderr).unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn entries(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn image_goes_beside_the_user_under_the_name_of_the_scene() {
    let folder = folder();
    done(folder.path(), "render spheres.toml --resolution 32x24");
    assert_eq!(entries(folder.path()), ["spheres.exr", "spheres.toml"].map(String::from).into());
    let image = rayset::image::read_exr(&folder.path().join("spheres.exr")).unwrap();
    assert_eq!((image.width(), image.height()), (32, 24));
    let names: Vec<_> = image.channels().iter().map(|channel| channel.name()).collect();
    assert_eq!(names, ["R", "G", "B"]);
}

#[test]
fn statistics_hold_the_documented_fields_and_the_hash_of_the_file() {
    use sha2::{Digest, Sha256};
    let folder = folder();
    done(folder.path(), "render spheres.toml --resolution 32x24 --out a.exr --stats a.json --audit");
    let statistics = json(&folder.path().join("a.json"));
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/statistics.md"));
    let text = text.unwrap();
    for (field, value) in statistics.as_object().unwrap() {
        let is_described = text.contains(&format!("`{field}`")) || text.contains(&format!("`{field}."));
        assert!(is_described, "{field} is not described");
        for key in value.as_object().into_iter().flat_map(|object| object.keys()) {
            let described = [format!("`{key}`"), format!("`{field}.{key}`")];
            assert!(described.iter().any(|name| text.contains(name)), "{field}.{key} is not described");
        }
    }
    assert_eq!(statistics["resolution"], serde_json::json!([32, 24]));
    assert_eq!(statistics["rays"]["initial"]["cast"], 32 * 24);
    let image = rayset::image::read_exr(&folder.path().join("a.exr")).unwrap();
    let plane = |name: &str| image.channel(name).unwrap().floats().unwrap().to_vec();
    let (red, green, blue) = (plane("R"), plane("G"), plane("B"));
    let mut hash = Sha256::new();
    for i in 0..red.len() {
        for value in [red[i], green[i], blue[i]] {
            hash.update(value.to_le_bytes());
        }
    }
    let expected: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(statistics["image_bits"], expected);
    assert_eq!(statistics["audit"]["wrong_pixels"], 0);
}

#[test]
fn nothing_but_the_eye_rays_and_the_tree_changes_the_image() {
    let folder = folder();
    let bits = |arguments: &str| {
        done(folder.path(), &format!("render spheres.toml --resolution 40x30 --stats s.json {arguments}"));
        let statistics = json(&folder.path().join("s.json"));
        statistics["image_bits"].as_str().unwrap().to_owned()
    };
    let plain = bits("");
    for same in ["--threads 1", "--order tiles", "--order tiles=4", "--layers all --out a.exr", "--samples 1"]
    {
        assert_eq!(bits(same), plain, "{same}");
    }
    for other in [
        "--eye-rays corners",
        "--samples 2",
        "--depth 1",
        "--angle 20",
        "--from -1,0,6",
        "--up 0.2,1,0",
        "--at 0.1,0,0",
        "--crop 3,4,10,10",
    ] {
        assert_ne!(bits(other), plain, "{other}");
    }
    assert_eq!(bits("--from 0,0,6 --at 0,0,0 --up 0,1,0 --angle 28"), plain);
}

#[test]
fn corner_rays_are_one_more_each_way() {
    let folder = folder();
    done(folder.path(), "render spheres.toml --resolution 40x30 --eye-rays corners --stats s.json");
    assert_eq!(json(&folder.path().join("s.json"))["rays"]["initial"]["cast"], 41 * 31);
}

#[test]
fn comparison_tells_by_its_status() {
    let folder = folder();
    let path = folder.path();
    done(path, "render spheres.toml --resolution 32x24 --out a.exr");
    done(path, "render spheres.toml --resolution 32x24 --out b.exr --layers beauty,depth,object");
    done(path, "render spheres.toml --resolution 32x24 --out c.exr --depth 1");
    done(path, "render spheres.toml --resolution 16x24 --out small.exr");
    assert!(done(path, "compare a.exr a.exr").contains("identical"));
    assert!(done(path, "compare a.exr b.exr --layers beauty").contains("identical"));
    assert!(done(path, "compare b.exr b.exr").contains("object"));
    for (arguments, expected) in [
        ("compare a.exr c.exr --diff diff.png", "the images differ in"),
        ("compare a.exr b.exr", "the images differ: images differ in channels"),
        ("compare a.exr small.exr", "the images differ: "),
    ] {
        let output = rayset(path, arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains(expected), "{arguments}: {text}");
    }
    assert!(path.join("diff.png").exists());
    done(path, "compare a.exr c.exr --tolerance 100");
    assert!(refused(path, "compare a.exr b.exr --layers depth").contains("has no layer `depth`"));
    assert!(refused(path, "compare a.exr none.exr").contains("none.exr"));
    assert!(refused(path, "compare a.exr spheres.toml").contains("spheres.toml"));
}

#[test]
fn layers_are_those_asked_for() {
    let folder = folder();
    let layers = |arguments: &str| {
        done(folder.path(), &format!("render spheres.toml --resolution 32x24 --out a.exr {arguments}"));
        let image = rayset::image::read_exr(&folder.path().join("a.exr")).unwrap();
        image.layer_names().into_iter().map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(layers("--layers beauty"), ["beauty"]);
    assert_eq!(layers("--layers depth,rays"), ["depth", "rays"]);
    let all = layers("--layers all --strategy speer-1985");
    assert_eq!(all.len(), rayset::engine::Layer::ALL.len());
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/statistics.md"));
    let text = text.unwrap();
    let help = done(folder.path(), "render --help");
    for layer in all {
        assert!(text.contains(&format!("| `{layer}` |")), "{layer} is not described");
        assert!(help.contains(&layer), "{layer} is not in the help");
    }
}

#[test]
fn png_is_written_and_holds_beauty_alone() {
    let folder = folder();
    done(folder.path(), "render spheres.toml --resolution 32x24 --out a.png --exposure -1");
    assert!(fs::read(folder.path().join("a.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(refused(folder.path(), "render spheres.toml --out a.png --layers all").contains("beauty alone"));
}

#[test]
fn scenes_of_every_format_are_described() {
    let fixtures = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let box_of_triangles = done(&fixtures, "info obj/cornell/CornellBox-Original.obj");
    assert!(box_of_triangles.contains("36 triangles"), "{box_of_triangles}");
    let split = done(&fixtures, "info --split 4 obj/cornell/CornellBox-Sphere.obj");
    assert!(split.contains("4 primitives in the largest"), "{split}");
    let folder = folder();
    assert!(done(folder.path(), "info spheres.toml").contains("8 spheres"));
    let nff = "b 0 0 0\nv\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 45\nhither 1\nresolution 64 32\n\
               f 1 1 1 1 0 1 0 1\ns 0 0 0 1\n";
    fs::write(folder.path().join("one.nff"), nff).unwrap();
    let one = done(folder.path(), "info one.nff");
    assert!(one.contains("1 spheres") && one.contains("64x32"), "{one}");
}

#[test]
fn errors_say_where_and_leave_nothing() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 7\n").unwrap();
    let before = entries(path);
    for (arguments, expected) in [
        ("render none.obj", "none.obj"),
        ("render bad.obj", "bad.obj:3: "),
        ("render spheres.abc", "spheres.abc"),
        ("render spheres.toml --out a.jpg", "a.jpg"),
        ("render spheres.toml --out missing/a.exr", "missing/a.exr"),
        ("render spheres.toml --strategy octree", "octree"),
        ("render spheres.toml --layers beauty,alpha", "alpha"),
        ("render spheres.toml --crop 600,0,10,10", "crop"),
        ("render spheres.toml --samples 2 --eye-rays corners", "--samples"),
        ("render spheres.toml --resolution 0x10", "0 x 10"),
        ("render spheres.toml --from 0,0,0 --at 0,0,0", "coincide"),
        ("render spheres.toml --depth 21", "21"),
        ("render bad.obj --limit faces=0", "bad.obj"),
        ("info --limit colour=1 spheres.toml", "colour"),
    ] {
        let message = refused(path, arguments);
        assert!(message.contains(expected), "rayset {arguments}: {message}");
    }
    assert_eq!(entries(path), before);
}

#[cfg(target_os = "linux")]
#[test]
fn interrupted_render_writes_nothing() {
    let folder = folder();
    let arguments = "render spheres.toml --resolution 16000x16000 --out a.exr --stats a.json";
    let child = Command::new(env!("CARGO_BIN_EXE_rayset"))
        .current_dir(folder.path())
        .args(arguments.split_whitespace())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Before the handler stands the signal would kill the process without a word.
    let id = child.id().to_string();
    let handles_interrupts = || {
        let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(mask.trim(), 16).unwrap() & 2 != 0
    };
    while !handles_interrupts() {
        std::thread::yield_now();
    }
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8(output.stderr).unwrap().contains("nothing was written"));
    assert_eq!(entries(folder.path()), ["spheres.toml"].map(String::from).into());
}

#[test]
fn version_names_the_backend() {
    let output = Command::new(env!("CARGO_BIN_EXE_rayset"))
        .arg("--version")
        .env("RAYSET_SIMD", "scalar")
        .output()
        .unwrap();
    assert!(String::from_utf8(output.stdout).unwrap().contains("SIMD backend: scalar"));
    let output = Command::new(env!("CARGO_BIN_EXE_rayset"))
        .args(["info", "x.toml"])
        .env("RAYSET_SIMD", "sse9")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("sse9"));
}
