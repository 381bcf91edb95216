//! The tables of a scene file and their keys; `docs/scene-files.md` describes each.

/// A kind of table.
#[derive(Debug)]
pub(super) struct Section {
    /// How messages and the document call it.
    pub(super) title: &'static str,
    /// All its keys.
    pub(super) keys: &'static [&'static str],
}

pub(super) static SCENE: Section = Section {
    title: "the scene",
    keys: &[
        "resolution",
        "background",
        "ambient",
        "max_volume_primitives",
        "camera",
        "light",
        "material",
        "sphere",
        "triangle",
        "polygon",
        "cone",
        "random_spheres",
        "obj",
    ],
};

pub(super) static CAMERA: Section = Section { title: "[camera]", keys: &["from", "at", "up", "angle"] };

pub(super) static LIGHT: Section =
    Section { title: "[[light]]", keys: &["position", "towards", "color", "intensity"] };

pub(super) static MATERIAL: Section = Section {
    title: "[material.NAME]",
    keys: &["diffuse", "specular", "shininess", "reflectance", "transmittance", "index", "emission"],
};

pub(super) static SPHERE: Section =
    Section { title: "[[sphere]]", keys: &["center", "radius", "material", "object", "sides"] };

pub(super) static TRIANGLE: Section =
    Section { title: "[[triangle]]", keys: &["corners", "normals", "material", "object", "sides"] };

pub(super) static POLYGON: Section =
    Section { title: "[[polygon]]", keys: &["corners", "material", "object", "sides"] };

pub(super) static CONE: Section = Section {
    title: "[[cone]]",
    keys: &["base", "base_radius", "apex", "apex_radius", "material", "object", "sides"],
};

pub(super) static RANDOM_SPHERES: Section = Section {
    title: "[[random_spheres]]",
    keys: &["count", "seed", "radius", "coverage", "separate", "reflectance", "transmittance"],
};

pub(super) static OBJ: Section =
    Section { title: "[[obj]]", keys: &["file", "scale", "rotate", "translate", "material", "materials"] };

#[cfg(feature = "obj")]
pub(super) static ROTATE: Section = Section { title: "rotate", keys: &["axis", "degrees"] };

#[cfg(all(test, feature = "obj"))]
mod tests {
    use super::*;

    const DOCUMENT: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/scene-files.md"));

    const SECTIONS: [&Section; 11] = [
        &SCENE,
        &CAMERA,
        &LIGHT,
        &MATERIAL,
        &SPHERE,
        &TRIANGLE,
        &POLYGON,
        &CONE,
        &RANDOM_SPHERES,
        &OBJ,
        &ROTATE,
    ];

    #[test]
    fn document_describes_every_key_in_its_order_and_no_other() {
        for section in SECTIONS {
            let heading = match section.title {
                "the scene" => "\n## The scene\n".to_owned(),
                "rotate" => "\n### `rotate`\n".to_owned(),
                title => format!("\n## `{title}`\n"),
            };
            let (_, chapter) = DOCUMENT.split_once(&heading).expect(&heading);
            let chapter = &chapter[..chapter.find("\n#").unwrap_or(chapter.len())];
            let rows = chapter.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
            assert_eq!(rows.collect::<Vec<_>>(), section.keys, "{}", section.title);
        }
    }
}
