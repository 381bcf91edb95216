//! What the fuzzer has found worth keeping (`cargo xtask fuzz --minimize`), read once more.
#![cfg(all(feature = "obj", feature = "toml"))]

mod readers;

use std::fs;
use std::path::Path;

#[test]
fn corpus_of_the_fuzzer_does_no_harm() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/fuzz");
    for (name, read) in [
        ("obj", readers::obj as fn(&[u8])),
        ("mtl", readers::mtl),
        ("nff", readers::nff),
        ("toml", readers::toml),
    ] {
        let inputs =
            fs::read_dir(folder.join(name)).unwrap().map(|entry| fs::read(entry.unwrap().path()).unwrap());
        let count = inputs.map(|input| read(&input)).count();
        assert!(count > 50, "{name} has only {count} inputs");
    }
}
