//! The readers as the fuzzer and the replay of its corpus call them.

use std::io::{BufRead, Cursor};
use std::path::Path;

use rayset_scene::{LoadOptions, read_nff, read_obj, read_toml};

/// An OBJ file, and after a zero byte the library that every `mtllib` finds.
pub(crate) fn obj(data: &[u8]) {
    let mut parts = data.splitn(2, |&byte| byte == 0);
    let obj = parts.next().unwrap_or_default();
    let library = parts.next().unwrap_or_default().to_vec();
    let mut options = LoadOptions { max_volume_primitives: Some(4), ..LoadOptions::default() };
    options.limits.memory_bytes = 64 << 20;
    if let Ok(model) = read_obj(obj, Path::new("fuzz.obj"), &options, |_| open(&library)) {
        let _ = model.into_scene(&options);
    }
}

/// A material library, named by an OBJ file of one triangle, which is there whatever the library holds.
pub(crate) fn mtl(data: &[u8]) {
    const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let options = LoadOptions::default();
    let model = read_obj(OBJ, Path::new("fuzz.obj"), &options, |_| open(data));
    let loaded = model.expect("the geometry is sound").into_scene(&options).expect("materials are checked");
    assert_eq!(loaded.scene.n_primitives(), 1);
}

/// A scene in the Neutral File Format.
pub(crate) fn nff(data: &[u8]) {
    let mut options = LoadOptions::default();
    options.limits.memory_bytes = 64 << 20;
    let _ = read_nff(data, Path::new("fuzz.nff"), &options);
}

/// A scene file; what it refers to is not there.
pub(crate) fn toml(data: &[u8]) {
    let mut options = LoadOptions::default();
    options.limits.memory_bytes = 16 << 20;
    options.limits.faces = 10_000;
    if let Ok(text) = std::str::from_utf8(data) {
        let _ = read_toml(text, Path::new("/nonexistent/fuzz.toml"), &options);
    }
}

fn open(library: &[u8]) -> std::io::Result<Box<dyn BufRead>> {
    Ok(Box::new(Cursor::new(library.to_vec())))
}
