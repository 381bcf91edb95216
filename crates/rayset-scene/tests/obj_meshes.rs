//! The meshes of `fixtures/obj` have the counts that their sources state.
#![cfg(feature = "obj")]

use std::path::Path;

use rayset_scene::{LoadOptions, SceneBuilder, load_obj};

#[test]
fn meshes_have_their_counts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/obj");
    for (name, groups, triangles, smooth, materials) in [
        ("cornell/CornellBox-Original.obj", 8, 36, 0, 8),
        ("cornell/CornellBox-Sphere.obj", 8, 2188, 2188, 8),
        ("mori_knob/testObj.obj", 5, 11_970, 11_970, 5),
        ("spot_triangulated.obj", 1, 5856, 0, 0),
    ] {
        let model = load_obj(&folder.join(name), &LoadOptions::default()).unwrap();
        let parts = || model.groups.iter().flat_map(|group| &group.triangles);
        let n_smooth = parts().filter(|part| part.normals.is_some()).count();
        let counts = (model.groups.len(), parts().count(), n_smooth, model.materials.len());
        assert_eq!(counts, (groups, triangles, smooth, materials), "{name}");
        assert_eq!(model.warnings, [], "{name}");
        let mut builder = SceneBuilder::new();
        assert_eq!(model.add_to(&mut builder).len(), groups);
        assert_eq!(builder.build().unwrap().n_primitives(), triangles, "{name}");
    }
}
