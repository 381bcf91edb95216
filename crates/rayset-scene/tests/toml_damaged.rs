//! Scene files of any bytes: they load, or the error names the file; nothing panics.
#![cfg(feature = "toml")]

use std::path::Path;

use proptest::prelude::*;
use proptest::sample::{Index, select};
use proptest::test_runner::{RngSeed, TestRunner};
use rayset_scene::{Limits, LoadOptions, SceneError, read_toml};

const WHOLE: &str = r#"# Everything but files.
resolution = [64, 48]
background = [0.1, 0.2, 0.3]
ambient = 0.1
max_volume_primitives = 2

[camera]
from = [0, 0, 6]
at = [0, 0, 0]
up = [0, 1, 0]
angle = 28

[[light]]
position = [-4, 6, 6]
color = [1, 0.9, 0.8]

[[light]]
towards = [1, 1, 1]
intensity = 0.5

[material.glass]
diffuse = 0.1
specular = 0.5
shininess = 40
reflectance = 0.1
transmittance = [0.8, 0.9, 1]
index = 1.5

[material."night light"]
emission = 1

[[sphere]]
center = [0, 0, 0]
radius = 1
material = "glass"
object = "thing"

[[triangle]]
corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
normals = [[0, 0, 1], [0, 1, 1], [1, 0, 1]]
material = "night light"
sides = "front"

[[polygon]]
corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0.4, 0], [0, 1, 0]]

[[cone]]
base = [0, 0, 0]
base_radius = 1
apex = [0, 2, 0]
apex_radius = 0.5
object = "thing"

[[random_spheres]]
count = 3
seed = 5
radius = [0.1, 0.2]
separate = true
reflectance = 0.1
transmittance = 0.2
"#;

/// Whether a text loads; fails if its error does not say where it is from.
fn loads(text: &str) -> Result<bool, TestCaseError> {
    let limits = Limits { faces: 10_000, ..Limits::default() };
    let path = Path::new("a.toml");
    match read_toml(text, path, &LoadOptions { limits, ..LoadOptions::default() }) {
        Ok(_) => Ok(true),
        Err(error) => {
            let n_lines = text.split('\n').count();
            match &error {
                SceneError::Parse { path: found, line, message } => {
                    prop_assert_eq!(found, path);
                    prop_assert!((1..=n_lines).contains(line), "{}", error);
                    prop_assert!(!message.contains(char::is_control), "{:?}", message);
                }
                _ => return Err(TestCaseError::fail(error.to_string())),
            }
            Ok(false)
        }
    }
}

#[test]
fn file_cut_off_anywhere_loads_or_is_refused() {
    assert!(loads(WHOLE).unwrap());
    let n_loaded = (0..WHOLE.len()).filter(|&end| loads(&WHOLE[..end]).unwrap()).count();
    assert!(n_loaded > 20 && n_loaded < WHOLE.len() / 2, "{n_loaded}");
}

/// What stands in damaged, foreign and hostile files.
const WORDS: &[&str] = &[
    "",
    "0",
    "-1",
    "1",
    "2.5",
    "-0.0",
    "1e60",
    "-1e60",
    "1e61",
    "1e308",
    "1e-320",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "0xffffffffffffffff",
    "18446744073709551616",
    "4294967295",
    "1_000",
    "true",
    "1979-05-27",
    "\"",
    "\"\"",
    "'a'",
    "[]",
    "[[]]",
    "[",
    "]",
    "{}",
    "{",
    "}",
    "=",
    ".",
    ",",
    "#",
    "[0, 0, 0]",
    "[1, 2, 3]",
    "[1e60, -1e60, 1e60]",
    "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]",
    "\"glass\"",
    "\"thing\"",
    "\"back\"",
    "[[sphere]]",
    "[sphere]",
    "[camera]",
    "[material.glass]",
    "[material]",
    "[[obj]]",
    "radius",
    "center",
    "corners",
    "material",
    "object",
    "coverage",
    "angle",
    "a.b.c",
    "\u{feff}",
    "\u{e9}",
    "\r",
    "\n",
    "\t",
    "\0",
];

/// A change of a text.
#[derive(Clone, Debug)]
enum Damage {
    /// A word is put in the place of another.
    Word(Index, &'static str),
    /// The value of a key is replaced.
    Value(Index, &'static str),
    /// A line is left out.
    Drop(Index),
    /// A line is copied to another place.
    Copy(Index, Index),
}

fn damage() -> impl Strategy<Value = Damage> {
    let word = || select(WORDS);
    prop_oneof![
        1 => (any::<Index>(), word()).prop_map(|(i, word)| Damage::Word(i, word)),
        2 => (any::<Index>(), word()).prop_map(|(i, word)| Damage::Value(i, word)),
        1 => any::<Index>().prop_map(Damage::Drop),
        1 => (any::<Index>(), any::<Index>()).prop_map(|(i, j)| Damage::Copy(i, j)),
    ]
}

fn damaged(damages: &[Damage]) -> String {
    let mut lines: Vec<Vec<String>> =
        WHOLE.lines().map(|line| line.split(' ').map(str::to_owned).collect()).collect();
    for damage in damages {
        match damage {
            Damage::Word(i, word) => {
                let n_words = lines.iter().map(Vec::len).sum();
                *lines.iter_mut().flatten().nth(i.index(n_words)).unwrap() = (*word).to_owned();
            }
            Damage::Value(i, word) => {
                let line = i.get_mut(&mut lines);
                line.truncate(2);
                line.push((*word).to_owned());
            }
            Damage::Drop(i) => {
                lines.remove(i.index(lines.len()));
            }
            Damage::Copy(i, j) => {
                let line = i.get(&lines).clone();
                lines.insert(j.index(lines.len()), line);
            }
        }
    }
    lines.iter().map(|line| line.join(" ") + "\n").collect()
}

fn runner(cases: u32) -> TestRunner {
    TestRunner::new(ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() })
}

#[test]
fn damaged_files_load_or_are_refused() {
    let n_loaded = std::cell::Cell::new(0);
    let damages = prop::collection::vec(damage(), 0..3);
    let result = runner(6_000).run(&damages, |damages| {
        n_loaded.set(n_loaded.get() + u32::from(loads(&damaged(&damages))?));
        Ok(())
    });
    result.unwrap();
    // Else nothing was tested.
    assert!((1_000..5_000).contains(&n_loaded.get()), "{}", n_loaded.get());
}

#[test]
fn arbitrary_words_load_or_are_refused() {
    let line = prop::collection::vec(select(WORDS), 0..6);
    let lines = prop::collection::vec(line, 0..20);
    let text = lines.prop_map(|lines| lines.iter().map(|line| line.join(" ") + "\n").collect::<String>());
    runner(3_000).run(&text, |text| loads(&text).map(|_| ())).unwrap();
}
