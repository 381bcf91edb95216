//! NFF files that are compressed.

use std::path::{Path, PathBuf};

use rayset_scene::{LoadOptions, SceneError, load_nff, load_scene, read_nff};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nff").join(format!("{name}.nff.gz"))
}

#[cfg(not(feature = "gzip"))]
#[test]
fn without_the_feature_the_error_names_it() {
    let error = load_nff(&fixture("tetra"), &LoadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("tetra.nff.gz"), "{error}");
    let cause = std::error::Error::source(&error).unwrap().to_string();
    assert!(cause.contains("feature `gzip` is off"), "{cause}");
    assert!(load_scene(&fixture("tetra"), &LoadOptions::default()).is_err());
    let plain = read_nff(&b"s 0 0 0 1"[..], Path::new("a.nff"), &LoadOptions::default());
    assert!(matches!(plain, Ok(loaded) if loaded.scene.n_primitives() == 1));
    assert!(matches!(error, SceneError::Read { .. }));
}

#[cfg(feature = "gzip")]
mod with_the_feature {
    use std::error::Error;
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;
    use rayset_scene::Limits;

    use super::*;

    fn compressed(text: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    }

    fn cause(data: &[u8], limits: Limits) -> String {
        let options = LoadOptions { limits, ..LoadOptions::default() };
        let error = read_nff(data, Path::new("a.nff.gz"), &options).unwrap_err();
        assert_eq!(error.to_string(), "cannot read `a.nff.gz`");
        error.source().unwrap().to_string()
    }

    #[test]
    fn standard_scenes_have_their_primitives_and_lights() {
        for (name, primitives, lights) in [
            ("balls", 7382, 3),
            ("gears", 9345, 5),
            ("mount", 8196, 1),
            ("rings", 8401, 3),
            ("teapot", 9264, 2),
            ("tetra", 4096, 1),
            ("tree", 8191, 7),
        ] {
            let loaded = load_scene(&fixture(name), &LoadOptions::default()).unwrap();
            assert_eq!(loaded.warnings, [], "{name}");
            assert_eq!(loaded.scene.objects().len(), primitives, "{name}");
            assert_eq!(loaded.scene.n_primitives(), primitives, "{name}");
            assert_eq!(loaded.scene.lights().len(), lights, "{name}");
            assert_eq!(loaded.resolution, Some((512, 512)), "{name}");
        }
    }

    #[test]
    fn compression_is_known_by_the_first_bytes_too() {
        let data = compressed(b"s 0 0 0 1");
        let loaded = read_nff(&data[..], Path::new("a.nff"), &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.n_primitives(), 1);
        // Files may be joined.
        let joined = [compressed(b"s 0 0 0"), compressed(b" 1\ns 3 0 0 1")].concat();
        let loaded = read_nff(&joined[..], Path::new("a.nff.gz"), &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.n_primitives(), 2);
    }

    #[test]
    fn damaged_data_are_refused() {
        let data = compressed(&b"s 0 0 0 1\n# a comment\n".repeat(100));
        assert!(cause(b"s 0 0 0 1", Limits::default()).contains("damaged"));
        for end in 1..data.len() {
            let cause = cause(&data[..end], Limits::default());
            assert!(cause.contains("damaged or end early"), "{end}: {cause}");
        }
        let mut damaged = data.clone();
        let end = damaged.len() - 6;
        damaged[end] ^= 1;
        assert!(cause(&damaged, Limits::default()).contains("damaged"), "the checksum");
    }

    #[test]
    fn what_grows_too_large_is_refused_while_it_is_read() {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        for _ in 0..64 {
            encoder.write_all(&[b'\n'; 1 << 16]).unwrap();
        }
        let limits = Limits { memory_bytes: 1 << 20, ..Limits::default() };
        assert!(cause(&encoder.finish().unwrap(), limits).contains("too large"));
    }

    #[test]
    fn missing_file_is_named() {
        let error = load_nff(Path::new("no/such.nff.gz"), &LoadOptions::default()).unwrap_err();
        assert!(matches!(&error, SceneError::Read { .. }), "{error}");
        assert_eq!(error.to_string(), "cannot read `no/such.nff.gz`");
    }
}
