//! An OBJ file, and after a zero byte the library that every `mtllib` finds.
#![no_main]

use std::io::{BufRead, Cursor};
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use rayset_scene::{LoadOptions, read_obj};

fuzz_target!(|data: &[u8]| {
    let mut parts = data.splitn(2, |&byte| byte == 0);
    let obj = parts.next().unwrap_or_default();
    let library = parts.next().unwrap_or_default().to_vec();
    let options = options();
    let model = read_obj(obj, Path::new("fuzz.obj"), &options, |_| {
        Ok(Box::new(Cursor::new(library.clone())) as Box<dyn BufRead>)
    });
    if let Ok(model) = model {
        let _ = model.into_scene(&options);
    }
});

fn options() -> LoadOptions {
    let mut options = LoadOptions { max_volume_primitives: Some(4), ..LoadOptions::default() };
    options.limits.memory_bytes = 64 << 20;
    options
}
