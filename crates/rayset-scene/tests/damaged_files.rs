//! OBJ and MTL files of any bytes: they load, or the error names the file; nothing panics.
#![cfg(feature = "obj")]

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::sample::{Index, select};
use proptest::test_runner::RngSeed;
use rayset_scene::{LoadOptions, SceneBuilder, load_obj};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

/// A folder of its own for each test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("rayset-scene-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Loads a file and builds a scene of it, or fails if an error does not say where it is from.
fn load_and_build(obj: &Path) -> Result<bool, TestCaseError> {
    let model = match load_obj(obj, &LoadOptions::default()) {
        Ok(model) => model,
        Err(error) => {
            let message = error.to_string();
            let folder = obj.parent().unwrap().to_str().unwrap();
            prop_assert!(message.contains(folder), "the error names no file: {}", message);
            return Ok(false);
        }
    };
    prop_assert!(!model.groups.is_empty());
    for group in &model.groups {
        prop_assert!(!group.triangles.is_empty(), "{}", group.name);
        prop_assert!(
            group.material.is_none_or(|material| material < model.materials.len()),
            "{}",
            group.name
        );
    }
    // What loads can be built: nothing is left that a scene refuses.
    let n_triangles: usize = model.groups.iter().map(|group| group.triangles.len()).sum();
    let mut builder = SceneBuilder::new();
    model.add_to(&mut builder);
    let scene = builder.build().map_err(|error| TestCaseError::fail(format!("not built: {error}")))?;
    prop_assert_eq!(scene.n_primitives(), n_triangles);
    Ok(true)
}

const OBJ: &str = "\
# A comment
mtllib a.mtl
o box
v 0 0 0
v 1 0 0 1.0
v 1 1 0 0.5 0.5 0.5
v 0 1e0 -0.5
vt 0 0
vt 1 0 0
vn 0 0 1
vn 0 1 0
g one two
usemtl red
s 1
f 1 2 3
f 1/1 2/2 3/1 4/2
usemtl glass
f 1//1 2//2 3//1
g three
f -4/-2/-1 -3/-1/-2 -2/1/1
l 1 2
p 3
";

const MTL: &str = "\
# A comment
newmtl red
Ka 1 1 1
Kd 0.8 0.1 0.1
Ks 0.5
Ns 250
illum 2
map_Kd wood.png
newmtl glass
Kd 0 0 0
Ks 1 1 1
Tf 0.9 0.9 1
Ni 1.5
d 0.25
Tr 0.75
illum 7
Ke 0 0 0
";

/// What stands in damaged, foreign and hostile files.
const WORDS: &[&str] = &[
    "",
    "-halo",
    "0",
    "-1",
    "1",
    "2",
    "-0",
    "1e308",
    "-1e308",
    "1e60",
    "1e61",
    "1e-320",
    "1e999",
    "nan",
    "inf",
    "1.5.2",
    "0x10",
    "1/",
    "/1",
    "//",
    "1//1",
    "1/1/1/1",
    "-9",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "f",
    "v",
    "vn",
    "vt",
    "vp",
    "o",
    "g",
    "usemtl",
    "mtllib",
    "newmtl",
    "illum",
    "Kd",
    "Ks",
    "Ke",
    "Tf",
    "Tr",
    "Ni",
    "Ns",
    "d",
    "map_Kd",
    "bump",
    "1.#QNAN",
    "b.mtl",
    ".",
    "xyz",
    "spectral",
    "#",
    "\\",
    "a.mtl",
    "a.obj",
    "..",
    "../a.mtl",
    "red",
    "glass",
    "\u{feff}",
    "\u{e9}",
    "\r",
    "\n",
    "\n\n",
    "\t",
    "\0",
];

/// A change of a text.
#[derive(Clone, Debug)]
enum Damage {
    /// A word is put in the place of another.
    Word(Index, &'static str),
    /// A word is added to a line.
    Add(Index, &'static str),
    /// A line is left out.
    Drop(Index),
    /// A line is copied to another place.
    Copy(Index, Index),
    /// A byte takes another value.
    Byte(Index, u8),
    /// The end is missing.
    Cut(Index),
}

fn damage() -> impl Strategy<Value = Damage> {
    let word = || select(WORDS);
    prop_oneof![
        4 => (any::<Index>(), word()).prop_map(|(i, word)| Damage::Word(i, word)),
        2 => (any::<Index>(), word()).prop_map(|(i, word)| Damage::Add(i, word)),
        2 => any::<Index>().prop_map(Damage::Drop),
        2 => (any::<Index>(), any::<Index>()).prop_map(|(i, j)| Damage::Copy(i, j)),
        1 => (any::<Index>(), any::<u8>()).prop_map(|(i, byte)| Damage::Byte(i, byte)),
        1 => any::<Index>().prop_map(Damage::Cut),
    ]
}

fn damaged(text: &str, damages: &[Damage]) -> Vec<u8> {
    let mut lines: Vec<Vec<String>> =
        text.lines().map(|line| line.split(' ').map(str::to_owned).collect()).collect();
    for damage in damages {
        if lines.is_empty() {
            break;
        }
        match damage {
            Damage::Word(i, word) => {
                let words = lines.iter().map(Vec::len).sum();
                let place = lines.iter_mut().flatten().nth(i.index(words)).unwrap();
                *place = (*word).to_owned();
            }
            Damage::Add(i, word) => i.get_mut(&mut lines).push((*word).to_owned()),
            Damage::Drop(i) => {
                lines.remove(i.index(lines.len()));
            }
            Damage::Copy(i, j) => {
                let line = i.get(&lines).clone();
                lines.insert(j.index(lines.len()), line);
            }
            Damage::Byte(..) | Damage::Cut(_) => {}
        }
    }
    let mut bytes = lines.iter().map(|line| line.join(" ") + "\n").collect::<String>().into_bytes();
    for damage in damages {
        match damage {
            Damage::Byte(i, byte) if !bytes.is_empty() => *i.get_mut(&mut bytes) = *byte,
            Damage::Cut(i) if !bytes.is_empty() => bytes.truncate(i.index(bytes.len())),
            _ => {}
        }
    }
    bytes
}

#[test]
fn undamaged_files_load() {
    let folder = Folder::new("undamaged");
    folder.file("a.mtl", MTL.as_bytes());
    assert!(load_and_build(&folder.file("a.obj", OBJ.as_bytes())).unwrap());
}

#[test]
fn truncated_files_load_or_are_refused() {
    let folder = Folder::new("truncated");
    folder.file("a.mtl", MTL.as_bytes());
    for end in 0..=OBJ.len() {
        load_and_build(&folder.file("a.obj", &OBJ.as_bytes()[..end])).unwrap();
    }
    folder.file("a.obj", OBJ.as_bytes());
    for end in 0..=MTL.len() {
        folder.file("a.mtl", &MTL.as_bytes()[..end]);
        assert!(
            load_and_build(&folder.0.join("a.obj")).unwrap(),
            "a library never keeps geometry from loading"
        );
    }
}

#[test]
fn arbitrary_bytes_load_or_are_refused() {
    let folder = Folder::new("arbitrary");
    let lines = prop::collection::vec(prop::collection::vec(select(WORDS), 0..6), 0..20);
    let text = lines
        .prop_map(|lines| lines.iter().map(|line| line.join(" ") + "\n").collect::<String>().into_bytes());
    let bytes = || prop_oneof![prop::collection::vec(any::<u8>(), 0..200), text.clone()];
    let mut runner = proptest::test_runner::TestRunner::new(config(500));
    let result = runner.run(&(bytes(), bytes()), |(obj, mtl)| {
        folder.file("a.mtl", &mtl);
        load_and_build(&folder.file("a.obj", &obj))?;
        // As it is, the library is hardly ever named.
        prop_assert!(load_and_build(&folder.file("a.obj", OBJ.as_bytes()))?);
        Ok(())
    });
    result.unwrap();
}

#[test]
fn damaged_files_load_or_are_refused() {
    let folder = Folder::new("damaged");
    let damages = || prop::collection::vec(damage(), 0..4);
    let mut runner = proptest::test_runner::TestRunner::new(config(2_500));
    let (loaded, refused) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
    let result = runner.run(&(damages(), damages()), |(obj, mtl)| {
        folder.file("a.mtl", &damaged(MTL, &mtl));
        let count =
            if load_and_build(&folder.file("a.obj", &damaged(OBJ, &obj)))? { &loaded } else { &refused };
        count.set(count.get() + 1);
        Ok(())
    });
    result.unwrap();
    // Else nothing was tested.
    assert!(loaded.get() > 200 && refused.get() > 200, "{} loaded, {} refused", loaded.get(), refused.get());
}
