//! A scene in POV-Ray's language.

use std::fmt::Write;

use rayset_scene::geometry::{Cone, Primitive, Triangle};
use rayset_scene::glam::DVec3;
use rayset_scene::{Camera, Light, Material, MaterialId, ObjectId, PrimitiveId, Scene, VolumeId};

/// Where a tree stops to grow: as in `RenderOptions`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The greatest depth; the initial ray has depth 1, and POV-Ray counts the same.
    pub(super) depth: u32,
    /// The adaptive cut-off.
    pub(super) cutoff: f64,
}

/// The scene as a `.pov` file for a picture as high as it is wide.
///
/// Colours are linear, lights do not fall off, the highlight is Phong's, and surfaces are hit from both sides: POV-Ray
/// knows no other. Triangles of one material that follow one another become a mesh, which is its form for many.
/// One thing it has no word for: light that falls through a transmissive surface, which is a shadow in Whitted's rule,
/// is only dimmed by it.
///
/// # Errors
///
/// What the scene has that no word of the language says.
pub(super) fn pov(scene: &Scene, limits: Limits) -> Result<String, String> {
    let mut text = String::from("#version 3.7;\n");
    let Limits { depth, cutoff } = limits;
    let ambient = color(scene.ambient());
    push(
        &mut text,
        format_args!(
            "global_settings {{ assumed_gamma 1 max_trace_level {depth} adc_bailout {cutoff} ambient_light {ambient} }}"
        ),
    );
    push(&mut text, format_args!("background {{ {} }}", color(scene.background())));
    push(&mut text, format_args!("{}", camera(scene.camera())));
    for light in scene.lights() {
        push(&mut text, format_args!("{}", light_source(light)?));
    }
    for (i, material) in scene.materials().iter().enumerate() {
        push(&mut text, format_args!("#declare M{i} = {}", declared(material)?));
    }
    objects(&mut text, scene)?;
    Ok(text)
}

fn push(text: &mut String, line: std::fmt::Arguments<'_>) {
    writeln!(text, "{line}").expect("a string takes all");
}

/// Enough digits to give back the same number.
fn vector(v: DVec3) -> String {
    format!("<{:?}, {:?}, {:?}>", v.x, v.y, v.z)
}

fn color(c: DVec3) -> String {
    format!("rgb {}", vector(c))
}

/// A picture plane at distance 1, spanned by vectors: so the hand of the coordinates does not matter.
fn camera(camera: &Camera) -> String {
    let forward = (camera.target() - camera.viewpoint()).normalize();
    let height = 2.0 * libm::tan(camera.angle() * (std::f64::consts::PI / 360.0));
    let right = forward.cross(camera.up()).normalize();
    format!(
        "camera {{ perspective location {} right {} up {} direction {} }}",
        vector(camera.viewpoint()),
        vector(height * right),
        vector(height * right.cross(forward)),
        vector(forward)
    )
}

fn light_source(light: &Light) -> Result<String, String> {
    let position = light.position().ok_or("a light is infinitely far away")?;
    Ok(format!("light_source {{ {} {} }}", vector(position), color(light.color())))
}

/// A texture, and for a transmissive surface what is behind it.
fn declared(material: &Material) -> Result<String, String> {
    let Material { diffuse, specular, shininess, reflectance, transmittance, index, emission } = *material;
    let transmit = of_all_colors(transmittance).ok_or("a transmittance has a colour")?;
    let phong = of_all_colors(specular).ok_or("a highlight has a colour")?;
    if !(0.0..1.0).contains(&transmit) {
        return Err(format!("a transmittance of {transmit} is none of a pigment"));
    }
    // A pigment that lets light through answers less of what falls on it.
    let pigment = diffuse / (1.0 - transmit);
    let mut finish = "ambient 1 diffuse 1".to_owned();
    let mut add = |word: &str, c: DVec3| {
        if c.max_element() > 0.0 {
            write!(finish, " {word}").expect("a string takes all");
        }
    };
    add(&format!("phong {phong:?} phong_size {shininess:?}"), specular);
    add(&format!("reflection {{ {} }}", color(reflectance)), reflectance);
    add(&format!("emission {}", color(emission)), emission);
    let transmit = if transmit > 0.0 { format!(" transmit {transmit:?}") } else { String::new() };
    let texture = format!("texture {{ pigment {{ {}{transmit} }} finish {{ {finish} }} }}", color(pigment));
    let interior =
        if material.is_transmissive() { format!(" interior {{ ior {index:?} }}") } else { String::new() };
    Ok(format!("material {{ {texture}{interior} }}"))
}

/// The component of a grey.
fn of_all_colors(c: DVec3) -> Option<f64> {
    (c == DVec3::splat(c.x)).then_some(c.x)
}

/// All primitives in the order of their ids.
fn objects(text: &mut String, scene: &Scene) -> Result<(), String> {
    let n = u32::try_from(scene.n_primitives()).map_err(|_| "too many primitives")?;
    let mut mesh = None;
    for id in (0..n).map(PrimitiveId) {
        let location = scene.location(id);
        let primitive = scene.primitives().primitive(location.kind, location.index);
        let material = material_of(scene, location.volume);
        let next = matches!(primitive, Primitive::Triangle(_)).then_some(material);
        if mesh != next {
            end_mesh(text, mesh);
            if next.is_some() {
                text.push_str("mesh {\n");
            }
            mesh = next;
        }
        let MaterialId(m) = material;
        match &primitive {
            Primitive::Sphere(sphere) => push(
                text,
                format_args!(
                    "sphere {{ {}, {:?} material {{ M{m} }} }}",
                    vector(sphere.center()),
                    sphere.radius()
                ),
            ),
            Primitive::Cone(shape) => push(text, format_args!("{} material {{ M{m} }} }}", cone(shape))),
            Primitive::Polygon(shape) => {
                let first = shape.vertices()[0];
                if scene.surface_at(id, first).shading_normal != shape.normal() {
                    return Err("a polygon has normals of its own".to_owned());
                }
                // The first stands once more after the last.
                let vertices = shape.vertices().iter().chain([&first]);
                let vertices: Vec<_> = vertices.map(|vertex| vector(*vertex)).collect();
                let n = vertices.len();
                push(text, format_args!("polygon {{ {n}, {} material {{ M{m} }} }}", vertices.join(", ")));
            }
            Primitive::Triangle(shape) => push(text, format_args!("{}", triangle(scene, id, shape))),
        }
    }
    end_mesh(text, mesh);
    Ok(())
}

fn material_of(scene: &Scene, volume: VolumeId) -> MaterialId {
    let ObjectId(object) = scene.volume_object(volume);
    scene.objects()[object as usize].material
}

fn end_mesh(text: &mut String, mesh: Option<MaterialId>) {
    if let Some(MaterialId(m)) = mesh {
        push(text, format_args!("material {{ M{m} }} }}"));
    }
}

/// A cone or cylinder without caps, but for its end.
fn cone(cone: &Cone) -> String {
    let (base, apex) = (vector(cone.base()), vector(cone.apex()));
    let (r, s) = (cone.base_radius(), cone.apex_radius());
    // POV-Ray takes a cone that hardly narrows for an error.
    if (r - s).abs() <= 1e-9 * r {
        format!("cylinder {{ {base}, {apex}, {r:?} open")
    } else {
        format!("cone {{ {base}, {r:?}, {apex}, {s:?} open")
    }
}

/// A triangle of a mesh, but smooth where it is shaded by normals of its vertices.
fn triangle(scene: &Scene, id: PrimitiveId, triangle: &Triangle) -> String {
    let vertices = triangle.vertices();
    let normals = vertices.map(|vertex| scene.surface_at(id, vertex).shading_normal);
    if normals.iter().all(|normal| *normal == triangle.normal()) {
        let [a, b, c] = vertices.map(vector);
        return format!("triangle {{ {a}, {b}, {c} }}");
    }
    let [a, b, c] = [0, 1, 2].map(|i| format!("{}, {}", vector(vertices[i]), vector(normals[i])));
    format!("smooth_triangle {{ {a}, {b}, {c} }}")
}

#[cfg(test)]
mod tests {
    use rayset_scene::geometry::{Polygon, Sphere};
    use rayset_scene::{Color, Part, SceneBuilder};

    use super::*;

    const LIMITS: Limits = Limits { depth: 5, cutoff: 1.0 / 256.0 };

    fn builder() -> SceneBuilder {
        let mut builder = SceneBuilder::new();
        builder.camera(Camera::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 90.0).unwrap());
        builder.add_light(Light::point(DVec3::new(1.0, 2.0, 3.0), Color::splat(0.5)));
        builder
    }

    #[test]
    fn camera_spans_the_picture_whatever_the_hand() {
        let text = pov(&builder().build().unwrap(), LIMITS).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[1].contains("max_trace_level 5 adc_bailout 0.00390625"), "{}", lines[1]);
        let camera: Vec<f64> =
            lines[3].split(['<', ',', '>']).filter_map(|word| word.trim().parse().ok()).collect();
        let expected = [0.0, 0.0, 5.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, -1.0];
        assert_eq!(camera.len(), expected.len(), "{}", lines[3]);
        assert!(camera.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{}", lines[3]);
        assert_eq!(lines[4], "light_source { <1.0, 2.0, 3.0> rgb <0.5, 0.5, 0.5> }");
    }

    #[test]
    fn materials_say_what_whitted_says() {
        let mut builder = builder();
        let glass = builder.add_material(Material {
            diffuse: Color::splat(0.25),
            specular: Color::splat(0.5),
            shininess: 30.0,
            reflectance: Color::splat(0.125),
            transmittance: Color::splat(0.75),
            index: 1.5,
            ..Material::default()
        });
        builder.add_object("ball", glass, [Sphere::new(DVec3::X, 2.0)]);
        let text = pov(&builder.build().unwrap(), LIMITS).unwrap();
        // What the transmissive pigment takes away from the diffuse share is given back.
        assert!(text.contains("pigment { rgb <1.0, 1.0, 1.0> transmit 0.75 }"), "{text}");
        assert!(
            text.contains("phong 0.5 phong_size 30.0 reflection { rgb <0.125, 0.125, 0.125> }"),
            "{text}"
        );
        assert!(text.contains("interior { ior 1.5 }"), "{text}");
        assert!(text.contains("sphere { <1.0, 0.0, 0.0>, 2.0 material { M0 } }"), "{text}");
    }

    #[test]
    fn triangles_of_a_material_are_one_mesh() {
        let mut builder = builder();
        let [red, blue] = [DVec3::X, DVec3::Z]
            .map(|diffuse| builder.add_material(Material { diffuse, ..Material::default() }));
        let flat = Triangle::new(DVec3::ZERO, DVec3::X, DVec3::Y);
        builder.add_object("a", red, [flat, flat]);
        builder.add_object("b", red, [flat]);
        let normals = Some([DVec3::Z, DVec3::X, DVec3::Z]);
        builder.add_object("c", blue, [Part { normals, ..flat.into() }]);
        let text = pov(&builder.build().unwrap(), LIMITS).unwrap();
        assert_eq!(text.matches("mesh {\n").count(), 2, "{text}");
        assert_eq!(text.matches("\ntriangle {").count(), 3, "{text}");
        let smooth = "smooth_triangle { <0.0, 0.0, 0.0>, <0.0, 0.0, 1.0>, <1.0, 0.0, 0.0>, <1.0, 0.0, 0.0>,";
        assert!(text.contains(smooth), "{text}");
        assert_eq!(text.matches('{').count(), text.matches('}').count(), "{text}");
    }

    #[test]
    fn cones_are_open_and_polygons_closed() {
        let mut builder = builder();
        let grey = builder.add_material(Material::default());
        builder.add_object("pipe", grey, Cone::new(DVec3::ZERO, 1.0, DVec3::Y, 1.0));
        builder.add_object("cone", grey, Cone::new(DVec3::ZERO, 1.0, DVec3::Y, 0.0));
        let square = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        builder.add_object("square", grey, Polygon::new(square));
        let text = pov(&builder.build().unwrap(), LIMITS).unwrap();
        assert!(text.contains("cylinder { <0.0, 0.0, 0.0>, <0.0, 1.0, 0.0>, 1.0 open material"), "{text}");
        assert!(text.contains("cone { <0.0, 0.0, 0.0>, 1.0, <0.0, 1.0, 0.0>, 0.0 open material"), "{text}");
        assert!(text.contains("polygon { 5, <0.0, 0.0, 0.0>, <1.0,"), "{text}");
        assert!(text.contains("<0.0, 1.0, 0.0>, <0.0, 0.0, 0.0> material"), "{text}");
    }

    #[test]
    fn what_has_no_word_is_refused() {
        let mut builder = builder();
        builder.add_light(Light::directional(DVec3::Y, Color::ONE));
        let error = pov(&builder.build().unwrap(), LIMITS).unwrap_err();
        assert!(error.contains("infinitely far"), "{error}");
    }
}
