//! Scene files that are refused, each with its place and the reason.
#![cfg(feature = "toml")]

use std::fs;
use std::path::Path;

use rayset_scene::{Limits, LoadOptions, load_toml, read_toml};

fn refused_within(text: &str, limits: Limits) -> String {
    let options = LoadOptions { limits, ..LoadOptions::default() };
    match read_toml(text, Path::new("a.toml"), &options) {
        Ok(_) => panic!("loaded: {text}"),
        Err(error) => error.to_string(),
    }
}

fn refused(text: &str) -> String {
    refused_within(text, Limits::default())
}

fn check(cases: &[(&str, &str)]) {
    for (text, expected) in cases {
        assert_eq!(refused(text), *expected, "{text}");
    }
}

const BALL: &str = "[[sphere]]\ncenter = [1, 2, 3]\nradius = 2\n";

#[test]
fn syntax_errors_name_their_line() {
    for (text, place) in [
        ("\n\nambient = = 1", "a.toml:3: "),
        ("ambient = 1\nambient = 2\n", "a.toml:2: "),
        ("[camera]\nfrom = [1, 2, 3\n", "a.toml:2: "),
        ("[camera\nfrom = 1\n", "a.toml:1: "),
        // Not on a line that is not there.
        ("ambient = \"\"\"x\n\n\n", "a.toml:1: "),
        ("ambient = 1\nresolution = \"\\q\"\n", "a.toml:2: "),
        ("ambient = 1\rbackground = 1\r", "a.toml:1: "),
    ] {
        let message = refused(text);
        assert!(message.starts_with(place), "{message}");
        assert!(message.len() > place.len() && !message.contains('\n'), "{message}");
    }
    let empty = "a.toml:1: the scene is empty: it needs a [[sphere]], an [[obj]] or the like";
    check(&[("", empty), ("# Nothing.\n", empty), ("sphere = []\n", empty), ("light = []\n", empty)]);
    let deep = format!("{BALL}object = {}1", "[".repeat(100_000));
    assert_eq!(refused(&deep), "a.toml:4: keys, lists or tables are nested too deeply");
    let dotted = format!("{}a = 1", "a.".repeat(100_000));
    assert_eq!(refused(&dotted), "a.toml:1: keys, lists or tables are nested too deeply");
}

#[test]
fn unknown_keys_are_refused_with_a_suggestion_at_every_level() {
    check(&[
        ("ambeint = 1\n", "a.toml:1: unknown key `ambeint` in the scene: did you mean `ambient`?"),
        ("[[spheres]]\n", "a.toml:1: unknown key `spheres` in the scene: did you mean `sphere`?"),
        (
            "[camera]\nfrom = [0, 0, 1]\nfov = 40\n",
            "a.toml:3: unknown key `fov` in [camera]: it has `from`, `at`, `up`, `angle`",
        ),
        ("[camera]\nangel = 40\n", "a.toml:2: unknown key `angel` in [camera]: did you mean `angle`?"),
        ("[[light]]\n\ncolour = 1\n", "a.toml:3: unknown key `colour` in [[light]]: did you mean `color`?"),
        (
            "[material.a]\nspecullar = 1\n",
            "a.toml:2: unknown key `specullar` in [material.NAME]: did you mean `specular`?",
        ),
        ("[[sphere]]\nraduis = 1\n", "a.toml:2: unknown key `raduis` in [[sphere]]: did you mean `radius`?"),
        (
            "[[sphere]]\ncentre = [0, 0, 0]\n",
            "a.toml:2: unknown key `centre` in [[sphere]]: did you mean `center`?",
        ),
        (
            "[[triangle]]\ncorner = []\n",
            "a.toml:2: unknown key `corner` in [[triangle]]: did you mean `corners`?",
        ),
        ("[[polygon]]\nside = 1\n", "a.toml:2: unknown key `side` in [[polygon]]: did you mean `sides`?"),
        (
            "[[cone]]\nbase-radius = 1\n",
            "a.toml:2: unknown key `base-radius` in [[cone]]: did you mean `base_radius`?",
        ),
        (
            "[[random_spheres]]\ncounts = 1\n",
            "a.toml:2: unknown key `counts` in [[random_spheres]]: did you mean `count`?",
        ),
        ("[[obj]]\nFile = 'a'\n", "a.toml:2: unknown key `File` in [[obj]]: did you mean `file`?"),
        (
            "sphere = [\n{ center = [0, 0, 0],\n radiu = 1 }]\n",
            "a.toml:3: unknown key `radiu` in [[sphere]]: did you mean `radius`?",
        ),
        // The first of the text; what stands in it does no harm to the terminal.
        (
            "[[sphere]]\n\"z\\u001b\\n\" = 1\na = 1\n",
            "a.toml:2: unknown key `z` in [[sphere]]: it has `center`, `radius`, `material`, `object`, `sides`",
        ),
    ]);
}

#[test]
fn values_of_another_type_are_refused() {
    check(&[
        ("sphere = 1\n", "a.toml:1: `sphere` is a list of tables: write [[sphere]]"),
        ("[sphere]\nradius = 1\n", "a.toml:1: `sphere` is a list of tables: write [[sphere]]"),
        ("sphere = [1]\n", "a.toml:1: `sphere` is a number, not a table"),
        ("[[camera]]\n", "a.toml:1: `camera` is a list, not a table"),
        ("[material]\nred = 1\n", "a.toml:2: `material` is a number, not a table"),
        ("[[material]]\n", "a.toml:1: `material` is a list, not a table"),
        ("[[sphere]]\ncenter = 1\n", "a.toml:2: `center` is a number, not a list"),
        ("[[sphere]]\ncenter = [1, 2]\n", "a.toml:2: `center` needs 3 numbers, not 2"),
        ("[[sphere]]\ncenter = [\n 1,\n 2,\n 'x']\n", "a.toml:5: `center` is a string, not a number"),
        (
            "[[sphere]]\ncenter = [0, 0, 0]\nradius = true\n",
            "a.toml:3: `radius` is true or false, not a number",
        ),
        (
            "[[sphere]]\ncenter = [0, 0, 0]\nradius = 2020-01-01\n",
            "a.toml:3: `radius` is a date or time, not a number",
        ),
        ("background = [1, 2, 3, 4, 5]\n", "a.toml:1: `background` needs 3 numbers, not 5"),
        ("resolution = 5\n", "a.toml:1: `resolution` is a number, not a list"),
        ("resolution = [640, 480.0]\n", "a.toml:1: `resolution` is a number, not a whole number"),
        (
            "[[random_spheres]]\ncount = 1\nseparate = 1\n",
            "a.toml:3: `separate` is a number, not true or false",
        ),
        ("[[triangle]]\ncorners = [[0, 0, 0], [1, 0, 0]]\n", "a.toml:2: `corners` needs 3 points, not 2"),
        ("[[triangle]]\ncorners = [0, 1, 2]\n", "a.toml:2: `corners` is a number, not a list"),
    ]);
    assert_eq!(refused(&format!("{BALL}material = 1\n")), "a.toml:4: `material` is a number, not a string");
    assert_eq!(refused(&format!("{BALL}object = {{}}\n")), "a.toml:4: `object` is a table, not a string");
}

#[test]
fn missing_keys_name_the_line_of_their_table() {
    check(&[
        ("\n[camera]\nat = [0, 0, 0]\n", "a.toml:2: [camera] needs `from`"),
        ("\n[camera]\nfrom = [0, 0, 0]\n", "a.toml:2: [camera] needs `at`"),
        ("\n\n[[light]]\nintensity = 1\n", "a.toml:3: [[light]] needs `position` or `towards`"),
        (
            "[[light]]\nposition = [0, 0, 0]\ntowards = [0, 0, 1]\n",
            "a.toml:3: [[light]] has both `position` and `towards`",
        ),
        ("[[sphere]]\nradius = 1\n", "a.toml:1: [[sphere]] needs `center`"),
        ("[[sphere]]\ncenter = [0, 0, 0]\n", "a.toml:1: [[sphere]] needs `radius`"),
        ("[[triangle]]\n", "a.toml:1: [[triangle]] needs `corners`"),
        (
            "[[cone]]\nbase = [0, 0, 0]\nbase_radius = 1\napex = [1, 0, 0]\n",
            "a.toml:1: [[cone]] needs `apex_radius`",
        ),
        ("[[random_spheres]]\n", "a.toml:1: [[random_spheres]] needs `count`"),
        (
            "[[random_spheres]]\ncount = 1\nradius = 1\ncoverage = 0.5\n",
            "a.toml:4: [[random_spheres]] has both `radius` and `coverage`",
        ),
    ]);
    let second = format!("{BALL}\n[[sphere]]\nradius = 1\n");
    assert_eq!(refused(&second), "a.toml:5: [[sphere]] needs `center`");
}

#[test]
fn values_that_make_no_sense_are_refused() {
    check(&[
        ("ambient = nan\n", "a.toml:1: `ambient` is not finite"),
        ("ambient = -0.5\n", "a.toml:1: `ambient` is negative"),
        ("background = [0, inf, 0]\n", "a.toml:1: `background` is not finite"),
        ("ambient = 1e999\n", "a.toml:1: `ambient` is not finite"),
        ("resolution = [0, 480]\n", "a.toml:1: `resolution` is not between 1 and 65536"),
        ("resolution = [-1, 480]\n", "a.toml:1: `resolution` is not between 1 and 65536"),
        ("resolution = [65536, 65536]\n", "a.toml:1: `resolution` has more than 268435456 pixels"),
        ("max_volume_primitives = 0\n", "a.toml:1: `max_volume_primitives` is not between 1 and 4294967295"),
        (
            "\n[camera]\nfrom = [0, 0, 0]\nat = [0, 0, 0]\n",
            "a.toml:2: camera: viewpoint and target coincide or are not finite",
        ),
        (
            "\n[camera]\nfrom = [0, 0, 0]\nat = [0, 2, 0]\n",
            "a.toml:2: camera: the up vector is parallel to the line of sight",
        ),
        (
            "\n[camera]\nfrom = [0, 0, 0]\nat = [0, 0, 2]\nangle = 180\n",
            "a.toml:2: camera: the angle of view is not between 0 and 180 degrees",
        ),
        ("[camera]\nfrom = [0, 0, 1e61]\n", "a.toml:2: `from` exceeds 1e60"),
        ("[[light]]\ntowards = [0, 0, 0]\n", "a.toml:2: `towards` is zero"),
        ("[[light]]\nposition = [0, -inf, 0]\n", "a.toml:2: `position` is not finite"),
        (
            "[[light]]\n\ncolor = 1e300\nintensity = 1e300\n",
            "a.toml:1: `color` times `intensity` is not finite",
        ),
        ("[material.a]\nindex = 0\n", "a.toml:2: `index` is not positive"),
        ("[material.a]\nshininess = -1\n", "a.toml:2: `shininess` is negative"),
        ("[material.a]\ndiffuse = [1, -1, 1]\n", "a.toml:2: `diffuse` is negative"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = -1\n", "a.toml:3: `radius` is not positive"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = 0\n", "a.toml:3: `radius` is not positive"),
        ("[[sphere]]\ncenter = [0, 0, nan]\nradius = 1\n", "a.toml:2: `center` is not finite"),
        ("[[sphere]]\ncenter = [0, 0, 0]\nradius = 1e61\n", "a.toml:3: `radius` exceeds 1e60"),
        ("\n[[sphere]]\ncenter = [0, 0, 1e60]\nradius = 1e60\n", "a.toml:2: a coordinate exceeds 1e60"),
        (
            "[[triangle]]\ncorners = [[0, 0, 0], [1, 1, 1], [2, 2, 2]]\n",
            "a.toml:2: the corners lie on a line",
        ),
        (
            "[[polygon]]\ncorners = [[0, 0, 0], [1, 0, 0]]\n",
            "a.toml:2: a polygon needs 3 to 65536 corners, not 2",
        ),
        ("[[polygon]]\ncorners = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]\n", "a.toml:2: the polygon has no area"),
        (
            "[[polygon]]\ncorners = [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]]\n",
            "a.toml:2: the corners do not lie in a plane, but 2.357e-1 apart: make triangles of them",
        ),
        (
            "\n[[cone]]\nbase = [0, 0, 0]\nbase_radius = 1\napex = [0, 0, 0]\napex_radius = 1\n",
            "a.toml:2: `base` and `apex` are too close together",
        ),
        (
            "\n[[cone]]\nbase = [0, 0, 0]\nbase_radius = 0\napex = [0, 0, 1]\napex_radius = 0\n",
            "a.toml:2: `base_radius` and `apex_radius` are both zero",
        ),
        (
            "[[cone]]\nbase = [0, 0, 0]\nbase_radius = -1\napex = [0, 0, 1]\napex_radius = 0\n",
            "a.toml:3: `base_radius` is negative",
        ),
        ("[[random_spheres]]\ncount = 0\n", "a.toml:2: `count` is not between 1 and 4294967295"),
        (
            "[[random_spheres]]\ncount = 1\nseed = -1\n",
            "a.toml:3: `seed` is not between 0 and 18446744073709551615",
        ),
        (
            "[[random_spheres]]\ncount = 1\nradius = [2, 1]\n",
            "a.toml:3: `radius` has its greater number first",
        ),
        ("[[random_spheres]]\ncount = 1\ncoverage = 1\n", "a.toml:3: `coverage` is not below 1"),
    ]);
    assert_eq!(
        refused(&format!("{BALL}sides = \"fornt\"\n")),
        "a.toml:4: `sides` cannot be `fornt`: did you mean `front`?"
    );
    assert_eq!(
        refused(&format!("{BALL}sides = \"x\"\n")),
        "a.toml:4: `sides` cannot be `x`: it is `front`, `back` or `both`"
    );
}

#[test]
fn unknown_materials_are_refused_with_a_suggestion() {
    assert_eq!(refused(&format!("{BALL}material = 'red'\n")), "a.toml:4: no material `red`: there is none");
    let text = format!("{BALL}material = 'glas'\n[material.glass]\n[material.red]\n");
    assert_eq!(refused(&text), "a.toml:4: no material `glas`: did you mean `glass`?");
    let text = format!("{BALL}material = 'wood'\n[material.glass]\n[material.red]\n");
    assert_eq!(refused(&text), "a.toml:4: no material `wood`: there is `glass`, `red`");
}

#[test]
fn object_has_one_material() {
    let ball = |name: &str| format!("{BALL}object = 'x'\nmaterial = '{name}'\n");
    let text = format!("{}{}[material.a]\n[material.b]\n", ball("a"), ball("b"));
    assert_eq!(refused(&text), "a.toml:10: object `x` has another material already, and may have one only");
}

#[test]
fn what_asks_for_too_much_is_refused_before_it_is_made() {
    let random = |count: u32| format!("[[random_spheres]]\ncount = {count}\nseparate = false\n");
    assert_eq!(refused(&random(u32::MAX)), "a.toml:1: more than 268435456 primitives");
    assert_eq!(
        refused(&random(200_000_000)),
        "a.toml:1: the scene would take more than 17179869184 bytes of memory"
    );
    let few = Limits { faces: 10, corners: 4, ..Limits::default() };
    assert_eq!(refused_within(&(BALL.to_owned() + &random(10)), few), "a.toml:4: more than 10 primitives");
    assert_eq!(refused_within(&BALL.repeat(11), few), "a.toml:31: more than 10 primitives");
    let polygon = "[[polygon]]\ncorners = [[0, 0, 0], [1, 0, 0], [2, 1, 0], [1, 2, 0], [0, 1, 0]]\n";
    assert_eq!(refused_within(polygon, few), "a.toml:2: a polygon needs 3 to 4 corners, not 5");
    assert_eq!(
        refused(&"[[random_spheres]]\ncount = 9000\ncoverage = 0.1\n".repeat(2)),
        "a.toml:4: at most 16384 random spheres of a file can be kept apart: set `separate = false` for more"
    );
    assert_eq!(
        refused(&"# comment\n".repeat(500_000)),
        "a.toml:1: a scene file may have 4194304 bytes: put large geometry in a file of its own"
    );
}

#[test]
fn fitted_camera_may_be_out_of_range() {
    let far = "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1e60\n";
    assert_eq!(refused(far), "a.toml:1: camera: the viewpoint is too far away");
}

#[test]
fn files_that_cannot_be_read_are_refused() {
    let folder = std::env::temp_dir().join(format!("rayset-scene-toml-files-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let refused = |name: &str| {
        let error = load_toml(&folder.join(name), &LoadOptions::default()).unwrap_err();
        let source = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        (error.to_string().replace(&format!("{}/", folder.display()), ""), source)
    };
    assert_eq!(refused("none.toml").0, "cannot read `none.toml`");
    fs::create_dir_all(folder.join("folder.toml")).unwrap();
    assert_eq!(
        refused("folder.toml"),
        ("cannot read `folder.toml`".to_owned(), "it is no regular file".to_owned())
    );
    fs::write(folder.join("bytes.toml"), b"ambient = 1\n# \xff\n").unwrap();
    assert_eq!(refused("bytes.toml").0, "bytes.toml:2: this is not UTF-8");
    fs::write(folder.join("long.toml"), vec![b'\n'; (4 << 20) + 1]).unwrap();
    assert!(refused("long.toml").0.starts_with("long.toml:1: a scene file may have"));
    fs::remove_dir_all(&folder).unwrap();
}
