//! Polygons as columns, their edges in lanes or their rays.

use std::ops::Range;

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Simd};

use super::{index_of, padded, push_all};
use crate::{AxesOrder, Probe, ShearedLanes, Side, polygon};

/// Polygons, their vertices one after the other.
#[derive(Clone, Debug)]
pub(super) struct PolygonColumns {
    /// x, y, z of all vertices; each polygon's first vertex stands once more after its last.
    vertices: [Vec<f64>; 3],
    /// Where each polygon's vertices start, and one past the end of the last.
    starts: Vec<u32>,
    normals: Vec<DVec3>,
    /// The boxes of the parts of long polygons, and where those of each polygon start.
    boxes: [Vec<f64>; 6],
    box_starts: Vec<u32>,
}

impl Default for PolygonColumns {
    fn default() -> Self {
        Self {
            vertices: padded(),
            starts: vec![0],
            normals: Vec::new(),
            boxes: padded(),
            box_starts: Vec::new(),
        }
    }
}

impl PolygonColumns {
    pub(super) fn push(&mut self, vertices: &[DVec3], normal: DVec3) {
        for vertex in vertices.iter().chain(&vertices[..1]) {
            push_all(&mut self.vertices, vertex.to_array());
        }
        self.box_starts.push(index_of(self.boxes[0].len() - MAX_LANES));
        for planes in polygon::boxes_of(vertices) {
            push_all(&mut self.boxes, planes);
        }
        self.starts.push(index_of(self.vertices[0].len() - MAX_LANES));
        self.normals.push(normal);
    }

    #[inline]
    pub(super) fn len(&self) -> usize {
        self.normals.len()
    }

    #[inline]
    pub(super) fn normal(&self, i: usize) -> DVec3 {
        self.normals[i]
    }

    /// The vertices of a polygon, each once.
    pub(super) fn corners(&self, i: usize) -> impl ExactSizeIterator<Item = DVec3> {
        let [x, y, z] = &self.vertices;
        let range = self.starts[i] as usize..self.starts[i + 1] as usize - 1;
        range.map(|v| DVec3::new(x[v], y[v], z[v]))
    }

    /// The columns of coordinates, and where those of a polygon stand.
    pub(super) fn coordinates(&self, i: usize) -> (&[Vec<f64>], Range<usize>) {
        (&self.vertices, self.starts[i] as usize..self.starts[i + 1] as usize)
    }

    pub(super) fn bytes(&self) -> usize {
        let columns = self.vertices.iter().chain(&self.boxes);
        columns.map(|column| size_of_val(&column[..])).sum::<usize>()
            + size_of_val(&self.starts[..])
            + size_of_val(&self.box_starts[..])
            + size_of_val(&self.normals[..])
    }

    /// Where a ray meets a polygon, edges in lanes: the side it hits, and `t`.
    #[inline(always)]
    pub(super) fn intersect<S: Simd>(&self, probe: &Probe<S>, i: usize) -> Option<(Side, f64)> {
        let (vertices, count) = self.vertices_of(i);
        polygon::intersect(probe, &vertices, count)
    }

    /// See [`super::PrimitiveColumns::polygon_by_rays`].
    #[inline(always)]
    pub(super) fn intersect_by_rays<S: Simd>(
        &self,
        simd: S,
        i: usize,
        (rays, order): (&ShearedLanes<S>, &AxesOrder<S>),
        sides: (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let (of, count) = self.vertices_of(i);
        polygon::intersect_by_rays(simd, rays, &CornerColumns { of, order }, count, sides)
    }

    /// The vertices of a polygon, and how many they are.
    #[inline(always)]
    fn vertices_of(&self, i: usize) -> (VertexColumns<'_>, usize) {
        let (start, next) = (self.starts[i] as usize, self.starts[i + 1] as usize);
        let first_box = self.box_starts[i] as usize;
        let (columns, boxes) = (&self.vertices, &self.boxes);
        (VertexColumns { columns, start, boxes, first_box }, next - start - 1)
    }
}

/// The vertices of a polygon.
struct VertexColumns<'a> {
    columns: &'a [Vec<f64>; 3],
    start: usize,
    boxes: &'a [Vec<f64>; 6],
    first_box: usize,
}

impl<S: Simd> polygon::Vertices<S> for VertexColumns<'_> {
    #[inline(always)]
    fn load(&self, simd: S, i: usize) -> [S::F64; 3] {
        let ([x, y, z], i) = (self.columns, self.start + i);
        [simd.load_f64(&x[i..]), simd.load_f64(&y[i..]), simd.load_f64(&z[i..])]
    }

    #[inline(always)]
    fn may_cross(&self, probe: &Probe<S>, ray: &ShearedLanes<S>, first: usize) -> u32 {
        let (simd, [_, y, z]) = (probe.simd, probe.shear.axes);
        let plane = |k: usize| &self.boxes[k][self.first_box + first..];
        let low = [simd.load_f64(plane(y)), simd.load_f64(plane(z))];
        let high = [simd.load_f64(plane(3 + y)), simd.load_f64(plane(3 + z))];
        polygon::may_cross(simd, ray, [low, high]).bits()
    }
}

/// The corners of a polygon, for rays that want their coordinates in some order.
struct CornerColumns<'a, S: Simd> {
    of: VertexColumns<'a>,
    order: &'a AxesOrder<S>,
}

impl<S: Simd> polygon::Corners<S> for CornerColumns<'_, S> {
    #[inline(always)]
    fn vertex(&self, simd: S, i: usize) -> [S::F64; 3] {
        let ([x, y, z], i) = (self.of.columns, self.of.start + i);
        self.order.splat(simd, [x[i], y[i], z[i]])
    }

    #[inline(always)]
    fn part(&self, simd: S, part: usize) -> [[S::F64; 2]; 2] {
        let (planes, i) = (self.of.boxes, self.of.first_box + part);
        let [_, low_y, low_z] = self.order.splat(simd, [planes[0][i], planes[1][i], planes[2][i]]);
        let [_, high_y, high_z] = self.order.splat(simd, [planes[3][i], planes[4][i], planes[5][i]]);
        [[low_y, low_z], [high_y, high_z]]
    }
}
