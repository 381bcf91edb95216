//! A material library, named by an OBJ file of one triangle.
#![no_main]

use std::io::{BufRead, Cursor};
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use rayset_scene::{LoadOptions, read_obj};

const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";

fuzz_target!(|data: &[u8]| {
    let options = LoadOptions::default();
    let library = data.to_vec();
    let model = read_obj(OBJ, Path::new("fuzz.obj"), &options, |_| {
        Ok(Box::new(Cursor::new(library.clone())) as Box<dyn BufRead>)
    });
    // Whatever the library holds, the triangle is there.
    let loaded = model.expect("the geometry is sound").into_scene(&options).expect("materials are checked");
    assert_eq!(loaded.scene.n_primitives(), 1);
});
