//! The part of Embree 3's interface that is used, as its headers have it (version 3.13, one level of instances).

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ops::Range;

/// An opaque handle.
pub(crate) type Handle = *mut c_void;

pub(crate) const TRIANGLE: c_int = 0;
pub(crate) const SPHERE_POINT: c_int = 50;
pub(crate) const INDEX: c_int = 0;
pub(crate) const VERTEX: c_int = 1;
pub(crate) const UINT3: c_int = 0x5003;
pub(crate) const FLOAT3: c_int = 0x9003;
pub(crate) const FLOAT4: c_int = 0x9004;
pub(crate) const SCENE_ROBUST: c_int = 1 << 2;
pub(crate) const COHERENT: c_int = 1;
pub(crate) const INVALID: c_uint = c_uint::MAX;

/// `RTCIntersectContext`.
#[repr(C)]
pub(crate) struct Context {
    pub(crate) flags: c_int,
    pub(crate) filter: *const c_void,
    pub(crate) instance: c_uint,
}

/// `RTCRayHitN` without its alignment, which [`Aligned16`] and [`Aligned64`] add: it begins with an `RTCRayN`.
#[repr(C)]
#[derive(Clone, Copy)]
pub(crate) struct RayHit<const N: usize> {
    pub(crate) origin: [[f32; N]; 3],
    pub(crate) start: [f32; N],
    pub(crate) direction: [[f32; N]; 3],
    pub(crate) time: [f32; N],
    pub(crate) end: [f32; N],
    pub(crate) mask: [c_uint; N],
    pub(crate) id: [c_uint; N],
    pub(crate) flags: [c_uint; N],
    pub(crate) normal: [[f32; N]; 3],
    pub(crate) u: [f32; N],
    pub(crate) v: [f32; N],
    pub(crate) primitive: [c_uint; N],
    pub(crate) geometry: [c_uint; N],
    pub(crate) instance: [c_uint; N],
}

#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub(crate) struct Aligned16<T>(pub(crate) T);

#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(crate) struct Aligned64<T>(pub(crate) T);

pub(crate) type RayHit1 = Aligned16<RayHit<1>>;
pub(crate) type RayHit8 = Aligned64<RayHit<8>>;
pub(crate) type RayHit16 = Aligned64<RayHit<16>>;

pub(crate) type MemoryMonitor = extern "C" fn(*mut c_void, isize, bool) -> bool;

unsafe extern "C" {
    pub(crate) fn rtcNewDevice(config: *const c_char) -> Handle;
    pub(crate) fn rtcReleaseDevice(device: Handle);
    pub(crate) fn rtcGetDeviceError(device: Handle) -> c_int;
    pub(crate) fn rtcSetDeviceMemoryMonitorFunction(
        device: Handle,
        monitor: MemoryMonitor,
        user: *mut c_void,
    );
    pub(crate) fn rtcNewScene(device: Handle) -> Handle;
    pub(crate) fn rtcReleaseScene(scene: Handle);
    pub(crate) fn rtcSetSceneFlags(scene: Handle, flags: c_int);
    pub(crate) fn rtcCommitScene(scene: Handle);
    pub(crate) fn rtcAttachGeometry(scene: Handle, geometry: Handle) -> c_uint;
    pub(crate) fn rtcNewGeometry(device: Handle, kind: c_int) -> Handle;
    pub(crate) fn rtcReleaseGeometry(geometry: Handle);
    pub(crate) fn rtcCommitGeometry(geometry: Handle);
    pub(crate) fn rtcSetNewGeometryBuffer(
        geometry: Handle,
        kind: c_int,
        slot: c_uint,
        format: c_int,
        stride: usize,
        count: usize,
    ) -> *mut c_void;
    pub(crate) fn rtcIntersect1(scene: Handle, context: *mut Context, rays: *mut RayHit1);
    pub(crate) fn rtcIntersect8(valid: *const i32, scene: Handle, context: *mut Context, rays: *mut RayHit8);
    pub(crate) fn rtcIntersect16(
        valid: *const i32,
        scene: Handle,
        context: *mut Context,
        rays: *mut RayHit16,
    );
    pub(crate) fn rtcOccluded1(scene: Handle, context: *mut Context, rays: *mut RayHit1);
    pub(crate) fn rtcOccluded8(valid: *const i32, scene: Handle, context: *mut Context, rays: *mut RayHit8);
    pub(crate) fn rtcOccluded16(valid: *const i32, scene: Handle, context: *mut Context, rays: *mut RayHit16);
}

/// Rays in double precision, as columns of one length.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub(crate) origins: [&'a [f64]; 3],
    pub(crate) directions: [&'a [f64]; 3],
    pub(crate) spans: [&'a [f64]; 2],
    /// No span starts before this.
    pub(crate) floor: f64,
}

/// Answers as columns: the distances of the hits, and the numbers of geometry and primitive.
#[derive(Default)]
pub(crate) struct Hits {
    ends: Vec<f32>,
    geometries: Vec<c_uint>,
    primitives: Vec<c_uint>,
}

impl Hits {
    /// Makes room for the answers of some rays.
    pub(crate) fn resize(&mut self, n: usize) {
        self.ends.resize(n, 0.0);
        self.geometries.resize(n, INVALID);
        self.primitives.resize(n, INVALID);
    }

    /// An answer, as [`Packet::answer`] gives it.
    pub(crate) fn get(&self, i: usize) -> (f32, c_uint, c_uint) {
        (self.ends[i], self.geometries[i], self.primitives[i])
    }
}

/// Narrows the values of a column from `first` on, as many as there are lanes, or as are left.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "peers decide in single precision")]
fn narrow<const N: usize>(lanes: &mut [f32; N], column: &[f64], first: usize, floor: f64) {
    let larger = |value: f64| if value > floor { value } else { floor };
    let rest = &column[first..];
    // A loop of a known length is one of vectors.
    if let Some(values) = rest.first_chunk::<N>() {
        for (lane, &value) in lanes.iter_mut().zip(values) {
            *lane = larger(value) as f32;
        }
    } else {
        for (lane, &value) in lanes.iter_mut().zip(rest) {
            *lane = larger(value) as f32;
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
#[expect(clippy::cast_possible_truncation, reason = "peers decide in single precision")]
fn narrow_four([a, b, c, d]: [f64; 4]) -> [f32; 4] {
    [a as f32, b as f32, c as f32, d as f32]
}

/// Copies lanes into a column, as many as it holds.
#[inline(always)]
fn read<const N: usize, T: Copy>(rest: &mut [T], lanes: &[T; N]) {
    if let Some(values) = rest.first_chunk_mut::<N>() {
        *values = *lanes;
    } else {
        let n = rest.len();
        rest.copy_from_slice(&lanes[..n]);
    }
}

impl<const N: usize> RayHit<N> {
    #[inline(always)]
    fn fill(&mut self, rays: &Columns<'_>, first: usize) {
        if N == 1 {
            self.fill_one(rays, first);
            return;
        }
        for k in 0..3 {
            narrow(&mut self.origin[k], rays.origins[k], first, f64::NEG_INFINITY);
            narrow(&mut self.direction[k], rays.directions[k], first, f64::NEG_INFINITY);
        }
        narrow(&mut self.start, rays.spans[0], first, rays.floor);
        narrow(&mut self.end, rays.spans[1], first, f64::NEG_INFINITY);
        // What else Embree reads, it does not write.
        self.geometry = [INVALID; N];
    }

    /// Three stores of four numbers: Embree reads four at a time, and would wait long for stores of single numbers.
    #[inline(always)]
    fn fill_one(&mut self, rays: &Columns<'_>, i: usize) {
        let Columns { origins: [ox, oy, oz], directions: [dx, dy, dz], spans: [starts, ends], floor } = *rays;
        let start = if starts[i] > floor { starts[i] } else { floor };
        let rows = [[ox[i], oy[i], oz[i], start], [dx[i], dy[i], dz[i], 0.0], [ends[i], 0.0, 0.0, 0.0]];
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{
                _mm_castps_si128, _mm_castsi128_ps, _mm_cvtpd_ps, _mm_movelh_ps, _mm_or_si128, _mm_set_epi32,
                _mm_set_pd, _mm_storeu_ps,
            };
            const { assert!(std::mem::offset_of!(RayHit<1>, mask) == 36) };
            let out = std::ptr::from_mut(self).cast::<f32>();
            // SAFETY: every such processor has these instructions; with one lane, the rows are the first twelve numbers
            // of the struct, which has no gaps.
            unsafe {
                let [origin, direction, mut end] = rows.map(|[a, b, c, d]| {
                    _mm_movelh_ps(_mm_cvtpd_ps(_mm_set_pd(b, a)), _mm_cvtpd_ps(_mm_set_pd(d, c)))
                });
                // The mask has all bits.
                end = _mm_castsi128_ps(_mm_or_si128(_mm_castps_si128(end), _mm_set_epi32(0, 0, -1, 0)));
                _mm_storeu_ps(out, origin);
                _mm_storeu_ps(out.add(4), direction);
                _mm_storeu_ps(out.add(8), end);
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let [[x, y, z, start], [dx, dy, dz, _], [end, ..]] = rows.map(narrow_four);
            [self.origin[0][0], self.origin[1][0], self.origin[2][0], self.start[0]] = [x, y, z, start];
            [self.direction[0][0], self.direction[1][0], self.direction[2][0]] = [dx, dy, dz];
            self.end[0] = end;
        }
        self.geometry = [INVALID; N];
    }

    #[inline(always)]
    fn read(&self, hits: &mut Hits, range: Range<usize>) {
        read(&mut hits.ends[range.clone()], &self.end);
        read(&mut hits.geometries[range.clone()], &self.geometry);
        read(&mut hits.primitives[range], &self.primitive);
    }

    #[inline(always)]
    fn read_hidden(&self, hidden: &mut [bool]) {
        let mut lanes = [false; N];
        for (lane, end) in lanes.iter_mut().zip(&self.end) {
            *lane = *end < 0.0;
        }
        read(hidden, &lanes);
    }
}

/// Rays of as many lanes as one call answers.
pub(crate) trait Packet: Copy {
    /// How many.
    const LANES: usize;
    /// A packet without rays.
    const EMPTY: Self;
    /// Its lanes.
    fn set(&mut self, lane: usize, origin: [f32; 3], direction: [f32; 3], span: [f32; 2]);
    /// The end of a lane's span: the distance of the hit, or minus infinity where a light is hidden; then the numbers
    /// of geometry and primitive.
    fn answer(&self, lane: usize) -> (f32, c_uint, c_uint);
    /// Takes rays of columns from `first` on, as many as there are lanes, or as are left.
    fn fill(&mut self, rays: &Columns<'_>, first: usize);
    /// Writes what its rays hit into a range of the answers, as many as it holds.
    fn read(&self, hits: &mut Hits, range: Range<usize>);
    /// Writes whether anything is between, as often as there is room.
    fn read_hidden(&self, hidden: &mut [bool]);
    /// # Safety
    ///
    /// The scene is committed and alive, and `valid` is 0 or -1 in every lane.
    unsafe fn intersect(&mut self, valid: &Aligned64<[i32; 16]>, scene: Handle, context: &mut Context);
    /// # Safety
    ///
    /// That of [`Packet::intersect`].
    unsafe fn occluded(&mut self, valid: &Aligned64<[i32; 16]>, scene: Handle, context: &mut Context);
}

macro_rules! packet {
    ($kind:ty, $wrap:ident, $lanes:literal, $intersect:expr, $occluded:expr) => {
        impl Packet for $kind {
            const LANES: usize = $lanes;
            const EMPTY: Self = $wrap(RayHit {
                origin: [[0.0; $lanes]; 3],
                start: [0.0; $lanes],
                direction: [[0.0; $lanes]; 3],
                time: [0.0; $lanes],
                end: [0.0; $lanes],
                mask: [c_uint::MAX; $lanes],
                id: [0; $lanes],
                flags: [0; $lanes],
                normal: [[0.0; $lanes]; 3],
                u: [0.0; $lanes],
                v: [0.0; $lanes],
                primitive: [INVALID; $lanes],
                geometry: [INVALID; $lanes],
                instance: [INVALID; $lanes],
            });

            fn set(&mut self, lane: usize, origin: [f32; 3], direction: [f32; 3], span: [f32; 2]) {
                for k in 0..3 {
                    self.0.origin[k][lane] = origin[k];
                    self.0.direction[k][lane] = direction[k];
                }
                [self.0.start[lane], self.0.end[lane]] = span;
            }

            fn answer(&self, lane: usize) -> (f32, c_uint, c_uint) {
                (self.0.end[lane], self.0.geometry[lane], self.0.primitive[lane])
            }

            #[inline(always)]
            fn fill(&mut self, rays: &Columns<'_>, first: usize) {
                self.0.fill(rays, first);
            }

            #[inline(always)]
            fn read(&self, hits: &mut Hits, range: Range<usize>) {
                self.0.read(hits, range);
            }

            #[inline(always)]
            fn read_hidden(&self, hidden: &mut [bool]) {
                self.0.read_hidden(hidden);
            }

            #[inline(always)]
            unsafe fn intersect(
                &mut self,
                valid: &Aligned64<[i32; 16]>,
                scene: Handle,
                context: &mut Context,
            ) {
                // SAFETY: the caller's promise; the packet has the layout and alignment that the call wants.
                unsafe { $intersect(valid.0.as_ptr(), scene, context, self) }
            }

            #[inline(always)]
            unsafe fn occluded(
                &mut self,
                valid: &Aligned64<[i32; 16]>,
                scene: Handle,
                context: &mut Context,
            ) {
                // SAFETY: as above; a packet of rays and hits begins with its rays.
                unsafe { $occluded(valid.0.as_ptr(), scene, context, self) }
            }
        }
    };
}

packet!(RayHit1, Aligned16, 1, |_: *const i32, s, c, r| rtcIntersect1(s, c, r), |_: *const i32, s, c, r| {
    rtcOccluded1(s, c, r)
});
packet!(RayHit8, Aligned64, 8, rtcIntersect8, rtcOccluded8);
packet!(RayHit16, Aligned64, 16, rtcIntersect16, rtcOccluded16);

#[cfg(test)]
mod tests {
    use std::mem::{align_of, offset_of, size_of};

    use super::*;

    #[test]
    fn packets_have_the_layout_of_the_headers() {
        assert_eq!((size_of::<RayHit1>(), align_of::<RayHit1>()), (80, 16));
        assert_eq!((size_of::<RayHit8>(), align_of::<RayHit8>()), (640, 64));
        assert_eq!((size_of::<RayHit16>(), align_of::<RayHit16>()), (1280, 64));
        assert_eq!(offset_of!(RayHit<16>, normal), 768);
        assert_eq!(size_of::<Context>(), 24);
    }
}
