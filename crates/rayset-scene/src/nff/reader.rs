//! The entities of NFF text.

use std::io::BufRead;
use std::path::Path;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Cone, Polygon, Sides, Sphere, Triangle};

use super::view::{self, View};
use super::words::{Words, excerpt};
use crate::warnings::Warnings;
use crate::{
    Color, Light, LoadOptions, LoadedScene, MAX_COORDINATE, Material, MaterialId, Part, Patch, SceneBuilder,
    SceneError,
};

/// Ambient light: as bright as a light that lights nothing but shadows, a little.
const AMBIENT: f64 = 0.1;

/// The memory of an object with one primitive, roughly: parts, columns, a volume and a name.
const OBJECT_BYTES: u64 = 1024;

/// The memory of a vertex, with its normal, while it is read and after.
const VERTEX_BYTES: u64 = 160;

/// Reads a whole file.
pub(super) struct Reader<'a, R> {
    words: Words<'a, R>,
    options: &'a LoadOptions,
    warnings: Warnings,
    builder: SceneBuilder,
    view: Option<View>,
    /// Position and colour, if the file gives one.
    lights: Vec<(DVec3, Option<Color>)>,
    /// The current fill, and its id once something has it.
    fill: Option<(Material, Option<MaterialId>)>,
    /// How many spheres, cones and polygons there are in the file.
    counts: [u64; 3],
    n_objects: u64,
    memory: u64,
}

/// The kinds of primitives that are counted apart, and what their objects are called.
const NAMES: [&str; 3] = ["sphere", "cone", "polygon"];
const SPHERE: usize = 0;
const CONE: usize = 1;
const POLYGON: usize = 2;

impl<'a, R: BufRead> Reader<'a, R> {
    pub(super) fn new(reader: R, path: &'a Path, options: &'a LoadOptions) -> Self {
        Self {
            words: Words::new(reader, path, options.limits.line_bytes),
            options,
            warnings: Warnings::new(options.limits.warnings),
            builder: SceneBuilder::new(),
            view: None,
            lights: Vec::new(),
            fill: None,
            counts: [0; 3],
            n_objects: 0,
            memory: 0,
        }
    }

    pub(super) fn read(mut self) -> Result<LoadedScene, SceneError> {
        while let Some(word) = self.words.take()? {
            match word {
                b"v" => {
                    if self.view.is_some() {
                        self.warn("`v`: there is one already; the last one counts");
                    }
                    self.view = Some(View::begun_at(self.words.line()));
                }
                b"b" => drop({
                    let color = self.words.color("b")?;
                    self.builder.background(color)
                }),
                b"l" => self.light()?,
                b"f" => self.fill()?,
                b"s" => self.sphere()?,
                b"c" => self.cone()?,
                b"p" => self.polygon()?,
                b"pp" => self.patch()?,
                other => {
                    let keyword = excerpt(other);
                    self.keyword(&keyword)?;
                }
            }
        }
        self.finish()
    }

    fn warn(&mut self, message: impl Into<String>) {
        self.warnings.push(self.words.path(), self.words.line(), message);
    }

    /// A keyword of the view, or none at all.
    fn keyword(&mut self, keyword: &str) -> Result<(), SceneError> {
        // Without a `v` before it the keyword is read all the same, and belongs to one.
        let line = self.words.line();
        let mut begun = self.view.take().unwrap_or_else(|| View::begun_at(line));
        if !begun.read(keyword, &mut self.words, &mut self.warnings)? {
            return Err(self.words.error(format!("`{keyword}` is no entity of NFF")));
        }
        self.view = Some(begun);
        Ok(())
    }

    fn light(&mut self) -> Result<(), SceneError> {
        let position = self.words.point("l")?;
        let color = if self.words.number_follows()? { Some(self.words.color("l")?) } else { None };
        self.claim(OBJECT_BYTES)?;
        self.lights.push((position, color));
        Ok(())
    }

    fn fill(&mut self) -> Result<(), SceneError> {
        let color = self.words.color("f")?;
        let mut coefficient = |name: &str| {
            let number = self.words.number("f")?;
            if number < 0.0 {
                let message = format!("`f`: {name} is negative; taken as 0");
                self.warnings.push(self.words.path(), self.words.line(), message);
            }
            Ok(number.max(0.0))
        };
        let diffuse = coefficient("Kd")?;
        let specular = coefficient("Ks")?;
        let shininess = coefficient("Shine")?;
        let transmittance = coefficient("T")?;
        let index = self.words.number("f")?;
        if transmittance > 0.0 && index <= 0.0 {
            self.warn("`f`: the index of refraction is not positive; taken as 1");
        }
        let material = Material {
            diffuse: diffuse * color,
            specular: Color::splat(specular),
            shininess,
            reflectance: Color::splat(specular),
            transmittance: Color::splat(transmittance),
            index: if index > 0.0 { index } else { 1.0 },
            emission: Color::ZERO,
        };
        if !material.diffuse.is_finite() {
            return Err(self.words.error("`f`: Kd times the colour is not finite"));
        }
        self.fill = Some((material, None));
        Ok(())
    }

    fn sphere(&mut self) -> Result<(), SceneError> {
        let center = self.words.point("s")?;
        let radius = self.words.coordinate("s")?;
        self.counts[SPHERE] += 1;
        if radius.abs() <= 0.0 {
            self.warn("`s` left out: its radius is zero");
            return Ok(());
        }
        let sides = self.sides(radius < 0.0);
        self.add(SPHERE, Part { sides, ..Sphere::new(center, radius.abs()).into() })
    }

    fn cone(&mut self) -> Result<(), SceneError> {
        let (base, base_radius) = (self.words.point("c")?, self.words.coordinate("c")?);
        let (apex, apex_radius) = (self.words.point("c")?, self.words.coordinate("c")?);
        self.counts[CONE] += 1;
        let is_inside_out = base_radius < 0.0 || apex_radius < 0.0;
        if is_inside_out && (base_radius > 0.0 || apex_radius > 0.0) {
            return Err(self.words.error("`c`: one radius is positive and one negative"));
        }
        let Some(cone) = Cone::new(base, base_radius.abs(), apex, apex_radius.abs()) else {
            self.warn("`c` left out: its ends coincide or both radii are zero");
            return Ok(());
        };
        let sides = self.sides(is_inside_out);
        self.add(CONE, Part { sides, ..cone.into() })
    }

    fn polygon(&mut self) -> Result<(), SceneError> {
        let n_vertices = self.corners("p")?;
        let mut vertices = Vec::new();
        for _ in 0..n_vertices {
            vertices.push(self.words.point("p")?);
        }
        self.counts[POLYGON] += 1;
        let sides = self.sides(false);
        match shape(vertices) {
            Some(Shape::Triangle(triangle)) => self.add(POLYGON, Part { sides, ..triangle.into() }),
            Some(Shape::Polygon(polygon)) => self.add(POLYGON, Part { sides, ..polygon.into() }),
            None => {
                self.warn("`p` left out: it has no area");
                Ok(())
            }
        }
    }

    fn patch(&mut self) -> Result<(), SceneError> {
        let n_vertices = self.corners("pp")?;
        let (mut vertices, mut normals) = (Vec::new(), Vec::new());
        for _ in 0..n_vertices {
            vertices.push(self.words.point("pp")?);
            normals.push(self.words.point("pp")?);
        }
        self.counts[POLYGON] += 1;
        let sides = self.sides(false);
        match shape(vertices) {
            Some(Shape::Triangle(triangle)) => {
                let normals = Some([normals[0], normals[1], normals[2]]);
                self.add(POLYGON, Part { sides, normals, ..triangle.into() })
            }
            Some(Shape::Polygon(polygon)) => {
                let (name, material) = self.next_object(POLYGON)?;
                self.builder.add_patches(name, material, [Patch { polygon, sides, normals }]);
                Ok(())
            }
            None => {
                self.warn("`pp` left out: it has no area");
                Ok(())
            }
        }
    }

    /// Takes the number of vertices.
    fn corners(&mut self, entity: &str) -> Result<u64, SceneError> {
        let count = self.words.count(entity)?;
        if count < 3 {
            return Err(self.words.error(format!("`{entity}`: {count} vertices are no polygon")));
        }
        let limit = self.options.limits.corners;
        if count > u64::from(limit) {
            return Err(self.words.error(format!("`{entity}`: {count} vertices are more than {limit}")));
        }
        self.claim(count * VERTEX_BYTES)?;
        Ok(count)
    }

    /// From where the next primitive is hit.
    fn sides(&self, is_inside_out: bool) -> Sides {
        let is_transmissive = self.fill.as_ref().is_some_and(|(material, _)| material.is_transmissive());
        match is_inside_out {
            _ if is_transmissive || self.options.two_sided => Sides::Both,
            true => Sides::Back,
            false => Sides::Front,
        }
    }

    fn add(&mut self, kind: usize, part: Part) -> Result<(), SceneError> {
        if part.primitive.extent() > MAX_COORDINATE {
            return Err(self.words.error(format!("the {} reaches beyond {MAX_COORDINATE:e}", NAMES[kind])));
        }
        let (name, material) = self.next_object(kind)?;
        self.builder.add_object(name, material, [part]);
        Ok(())
    }

    /// Name and material of the next object, of which there must not be too many.
    fn next_object(&mut self, kind: usize) -> Result<(String, MaterialId), SceneError> {
        self.n_objects += 1;
        let limit = self.options.limits.faces;
        if self.n_objects > limit {
            return Err(self.words.error(format!("there are more than {limit} primitives")));
        }
        self.claim(OBJECT_BYTES)?;
        if self.fill.is_none() {
            self.warn("there is no `f` yet: matt grey is used");
        }
        let (material, id) = self.fill.get_or_insert_with(|| (Material::default(), None));
        let material = *id.get_or_insert_with(|| self.builder.add_material(*material));
        Ok((format!("{} {}", NAMES[kind], self.counts[kind]), material))
    }

    /// Counts memory that something will take.
    fn claim(&mut self, bytes: u64) -> Result<(), SceneError> {
        self.memory += bytes;
        let limit = self.options.limits.memory_bytes;
        if self.memory > limit {
            return Err(self.words.error(format!("the scene takes more than {limit} bytes of memory")));
        }
        Ok(())
    }

    fn finish(mut self) -> Result<LoadedScene, SceneError> {
        let path = self.words.path();
        if self.n_objects == 0 {
            return Err(SceneError::Empty { path: path.into() });
        }
        #[expect(clippy::cast_precision_loss, reason = "nobody has 2^53 lights")]
        let intensity = 1.0 / (self.lights.len() as f64).sqrt();
        for &(position, color) in &self.lights {
            self.builder.add_light(Light::point(position, color.unwrap_or(Color::splat(intensity))));
        }
        let mut warn = |message: &str| self.warnings.push(path, 0, message);
        if self.lights.is_empty() {
            warn("there is no `l`: only ambient light is left");
        }
        let camera = match &self.view {
            Some(view) => view.camera(path)?,
            None => {
                warn("there is no `v`: the camera is one that sees everything");
                view::fitted(&self.builder.bounds())?
            }
        };
        self.builder.camera(camera).ambient(Color::splat(AMBIENT));
        self.builder.max_volume_primitives(self.options.max_volume_primitives);
        Ok(LoadedScene {
            scene: self.builder.build()?,
            resolution: self.view.and_then(|view| view.resolution),
            warnings: self.warnings.into_vec(path),
        })
    }
}

/// What a polygon of a file becomes.
enum Shape {
    Triangle(Triangle),
    Polygon(Polygon),
}

/// A triangle of three vertices, a polygon of more; `None` without area.
fn shape(vertices: Vec<DVec3>) -> Option<Shape> {
    let polygon = Polygon::new(vertices)?;
    match *polygon.vertices() {
        [a, b, c] => Some(Shape::Triangle(Triangle::new(a, b, c))),
        _ => Some(Shape::Polygon(polygon)),
    }
}
