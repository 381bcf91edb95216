//! Which files `load_obj` opens: regular ones in the folder of the scene.
#![cfg(all(feature = "obj", unix))]

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

use rayset_scene::{LoadOptions, ObjModel, SceneError, load_obj};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
const RED: &str = "newmtl red\nKd 1 0 0\n";

/// A folder of its own for each test with a folder `scene` in it, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("rayset-obj-files-{name}-{}", std::process::id()));
        fs::create_dir_all(path.join("scene")).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).unwrap();
    }

    fn load(&self, name: &str, allow_outside: bool) -> Result<ObjModel, SceneError> {
        load_obj(&self.0.join(name), &LoadOptions { allow_outside, ..LoadOptions::default() })
    }

    /// Loads, but does not wait for ever if what is opened never comes.
    fn load_in_time(&self, name: &str) -> Result<ObjModel, SceneError> {
        let (sender, receiver) = mpsc::channel();
        let path = self.0.join(name);
        let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
        std::thread::spawn(move || sender.send(load_obj(&path, &options)));
        receiver.recv_timeout(Duration::from_secs(20)).expect("it waits for something that never comes")
    }

    /// The materials that a library of this name gives, and the warnings.
    fn library(&self, name: &str, allow_outside: bool) -> (usize, Vec<String>) {
        self.write("scene/a.obj", &format!("mtllib {name}\n{TRIANGLE}"));
        let model = self.load("scene/a.obj", allow_outside).unwrap();
        (model.materials.len(), model.warnings.into_iter().map(|warning| warning.message).collect())
    }

    fn fifo(&self, name: &str) {
        assert!(Command::new("mkfifo").arg(self.0.join(name)).status().unwrap().success());
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn nothing_outside_is_read_unless_allowed() {
    let folder = Folder::new("outside");
    folder.write("out.mtl", RED);
    folder.write("scene/in.mtl", RED);
    let absolute = folder.0.join("out.mtl").to_str().unwrap().to_owned();
    let inside = folder.0.join("scene/in.mtl").to_str().unwrap().to_owned();
    for name in ["../out.mtl", "./../out.mtl", "../scene/in.mtl", &absolute, &inside, "/dev/null"] {
        let (materials, warnings) = folder.library(name, false);
        assert_eq!(materials, 0, "{name}");
        assert!(warnings[0].contains("lies outside the folder of the scene"), "{warnings:?}");
    }
    for name in ["../out.mtl", "../scene/in.mtl", &absolute] {
        assert_eq!(folder.library(name, true), (1, Vec::new()), "{name}");
    }
    assert_eq!(folder.library("in.mtl", false).0, 1);
}

#[test]
fn links_count_where_they_lead() {
    let folder = Folder::new("links");
    folder.write("out.mtl", RED);
    folder.write("scene/in.mtl", RED);
    fs::create_dir(folder.0.join("other")).unwrap();
    folder.write("other/deep.mtl", RED);
    symlink("../out.mtl", folder.0.join("scene/leads-out.mtl")).unwrap();
    symlink("in.mtl", folder.0.join("scene/leads-in.mtl")).unwrap();
    symlink("../other", folder.0.join("scene/sub")).unwrap();
    symlink("loop.mtl", folder.0.join("scene/loop.mtl")).unwrap();
    for name in ["leads-out.mtl", "sub/deep.mtl", "sub/../out.mtl"] {
        let (materials, warnings) = folder.library(name, false);
        assert_eq!(materials, 0, "{name}");
        assert!(warnings[0].contains("lies outside"), "{name}: {warnings:?}");
        assert_eq!(folder.library(name, true).0, 1, "{name}");
    }
    assert_eq!(folder.library("leads-in.mtl", false), (1, Vec::new()));
    // The same file by two names is read once.
    assert_eq!(folder.library("leads-in.mtl in.mtl", false), (1, Vec::new()));
    assert_eq!(folder.library("loop.mtl", true).0, 0);
    // The folder itself may be reached by a link.
    symlink("scene", folder.0.join("link")).unwrap();
    folder.write("scene/a.obj", &format!("mtllib in.mtl\n{TRIANGLE}"));
    assert_eq!(folder.load("link/a.obj", false).unwrap().materials.len(), 1);
}

#[test]
fn only_regular_files_are_opened() {
    let folder = Folder::new("regular");
    folder.fifo("scene/fifo.mtl");
    fs::create_dir(folder.0.join("scene/folder.mtl")).unwrap();
    symlink("/dev/zero", folder.0.join("scene/zero.mtl")).unwrap();
    folder.write("scene/waits.obj", &format!("mtllib fifo.mtl\n{TRIANGLE}"));
    assert_eq!(folder.load_in_time("scene/waits.obj").unwrap().materials.len(), 0);
    for name in ["fifo.mtl", "folder.mtl", "zero.mtl", "/dev/zero", "/dev/stdin"] {
        for allow_outside in [false, true] {
            let (materials, warnings) = folder.library(name, allow_outside);
            assert_eq!((materials, warnings.len()), (0, 2), "{name}: {warnings:?}");
        }
    }
    assert!(folder.library("zero.mtl", true).1[0].contains("no regular file"));
    // So is the OBJ file itself: nothing waits for what never comes.
    folder.fifo("scene/fifo.obj");
    for name in ["scene/fifo.obj", "scene", "scene/zero.mtl", "scene/missing.obj"] {
        let error = folder.load_in_time(name).unwrap_err();
        assert!(matches!(&error, SceneError::Read { path, .. } if *path == folder.0.join(name)), "{error}");
    }
}

#[test]
fn library_name_is_bytes() {
    let folder = Folder::new("bytes");
    let name = b"mat\xe9riaux.mtl";
    if fs::write(folder.0.join("scene").join(std::ffi::OsStr::from_bytes(name)), RED).is_err() {
        // Not every file system has such names.
        return;
    }
    let obj = [&b"mtllib "[..], name, b"\n", TRIANGLE.as_bytes()].concat();
    fs::write(folder.0.join("scene/a.obj"), obj).unwrap();
    assert_eq!(folder.load("scene/a.obj", false).unwrap().materials.len(), 1);
}
