//! The part of Embree 3's interface that is used, as its headers have it (version 3.13, one level of instances).

use std::ffi::{c_char, c_int, c_uint, c_void};

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
