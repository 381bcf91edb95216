//! Embree: single rays and packets, with and without its flags for coherent rays and for robustness.

use std::ffi::{CString, c_void};
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};
use std::time::Instant;

use rayset_engine::Backend;
use rayset_study::{Contender, Disagreements, RecordedPart, Worker};

use crate::converted::Converting;
use crate::ffi::{self, Aligned64, Context, Handle, Packet, RayHit1, RayHit8, RayHit16};
use crate::parts::{Parts, Place, Said, judge, rays};

/// Bytes that Embree holds, as it reports them.
static HELD: AtomicIsize = AtomicIsize::new(0);

extern "C" fn monitor(_: *mut c_void, bytes: isize, _: bool) -> bool {
    HELD.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// Embree with some threads, and a committed scene.
pub(crate) struct Embree {
    device: Handle,
    scene: Handle,
    /// Ids by geometry and primitive.
    ids: Vec<Vec<u32>>,
    pub(crate) commit_seconds: f64,
    /// Bytes it holds for the scene, its copies of the geometry among them.
    pub(crate) bytes: isize,
}

// SAFETY: Embree's documentation allows queries of a committed scene from any number of threads, and handles may be
// released from any; nothing else is done with them.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

impl Embree {
    /// Builds a scene of triangles and spheres; Embree may use lanes no wider than ours are.
    pub(crate) fn new(parts: &Parts, robust: bool, threads: usize) -> Result<Self, String> {
        let lanes = match Backend::active() {
            Backend::Avx512 => "frequency_level=simd512",
            Backend::Avx2 => "isa=avx2",
            _ => "isa=sse2",
        };
        let config = CString::new(format!("threads={threads},{lanes}")).expect("no zero inside");
        // SAFETY: the string ends with a zero and outlives the call.
        let device = unsafe { ffi::rtcNewDevice(config.as_ptr()) };
        if device.is_null() {
            return Err("Embree gives no device".to_owned());
        }
        // SAFETY: the device lives, and so does the function.
        unsafe { ffi::rtcSetDeviceMemoryMonitorFunction(device, monitor, std::ptr::null_mut()) };
        let before = HELD.load(Ordering::Relaxed);
        // SAFETY: the device lives.
        let scene = unsafe { ffi::rtcNewScene(device) };
        if robust {
            // SAFETY: the scene lives.
            unsafe { ffi::rtcSetSceneFlags(scene, ffi::SCENE_ROBUST) };
        }
        let mut embree = Self { device, scene, ids: Vec::new(), commit_seconds: 0.0, bytes: 0 };
        if !parts.triangles.is_empty() {
            let corners: Vec<[f32; 3]> = parts.triangles.iter().flat_map(|triangle| triangle.0).collect();
            let count = u32::try_from(corners.len()).map_err(|_| "too many corners".to_owned())?;
            let faces: Vec<[u32; 3]> = (0..count / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let ids = parts.triangles.iter().map(|triangle| triangle.1).collect();
            embree.attach(ffi::TRIANGLE, &corners, ffi::FLOAT3, Some(&faces), ids)?;
        }
        if !parts.spheres.is_empty() {
            let balls: Vec<[f32; 4]> =
                parts.spheres.iter().map(|&([x, y, z], radius, _)| [x, y, z, radius]).collect();
            let ids = parts.spheres.iter().map(|sphere| sphere.2).collect();
            embree.attach(ffi::SPHERE_POINT, &balls, ffi::FLOAT4, None, ids)?;
        }
        let start = Instant::now();
        // SAFETY: the scene lives and nobody else knows it yet.
        unsafe { ffi::rtcCommitScene(scene) };
        embree.commit_seconds = start.elapsed().as_secs_f64();
        embree.bytes = HELD.load(Ordering::Relaxed) - before;
        // SAFETY: the device lives.
        match unsafe { ffi::rtcGetDeviceError(device) } {
            0 => Ok(embree),
            code => Err(format!("Embree reports error {code}")),
        }
    }

    /// Adds primitives of one kind, copied into Embree's own buffers, so that it may read beyond their ends.
    fn attach<const N: usize>(
        &mut self,
        kind: i32,
        vertices: &[[f32; N]],
        format: i32,
        faces: Option<&[[u32; 3]]>,
        ids: Vec<u32>,
    ) -> Result<(), String> {
        // SAFETY: the device lives.
        let geometry = unsafe { ffi::rtcNewGeometry(self.device, kind) };
        // SAFETY: the geometry lives; rows are of plain numbers, without gaps, and of the format's size.
        unsafe { fill(geometry, ffi::VERTEX, format, vertices)? };
        if let Some(faces) = faces {
            // SAFETY: as above.
            unsafe { fill(geometry, ffi::INDEX, ffi::UINT3, faces)? };
        }
        // SAFETY: geometry and scene live; the scene keeps the geometry alive once it is attached.
        let number = unsafe {
            ffi::rtcCommitGeometry(geometry);
            let number = ffi::rtcAttachGeometry(self.scene, geometry);
            ffi::rtcReleaseGeometry(geometry);
            number
        };
        assert_eq!(number as usize, self.ids.len(), "geometries are numbered in order");
        self.ids.push(ids);
        Ok(())
    }
}

/// Copies rows into a new buffer of a geometry.
///
/// # Safety
///
/// The geometry lives, and the format is that of `T`.
unsafe fn fill<T: Copy>(geometry: Handle, kind: i32, format: i32, rows: &[T]) -> Result<(), String> {
    // SAFETY: the caller's promise.
    let buffer = unsafe {
        ffi::rtcSetNewGeometryBuffer(geometry, kind, 0, format, std::mem::size_of::<T>(), rows.len())
    };
    if buffer.is_null() {
        return Err("Embree gives no buffer".to_owned());
    }
    // SAFETY: the buffer is Embree's own and new, of at least as many bytes, and aligned to 16.
    unsafe { std::ptr::copy_nonoverlapping(rows.as_ptr(), buffer.cast::<T>(), rows.len()) };
    Ok(())
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: both live until here, and workers borrow what owns them.
        unsafe {
            ffi::rtcReleaseScene(self.scene);
            ffi::rtcReleaseDevice(self.device);
        }
    }
}

/// A way to ask Embree.
pub(crate) struct Mode {
    name: String,
    embree: Arc<Embree>,
    lanes: usize,
    coherent: bool,
    robust: bool,
    /// Whether rays are converted within the clock.
    converted: bool,
    extent: f64,
}

impl Mode {
    pub(crate) fn extent(&self) -> f64 {
        self.extent
    }

    /// A committed scene that lives as long as this.
    pub(crate) fn scene(&self) -> Handle {
        self.embree.scene
    }

    pub(crate) fn context(&self) -> Context {
        let flags = if self.coherent { ffi::COHERENT } else { 0 };
        Context { flags, filter: std::ptr::null(), instance: ffi::INVALID }
    }

    /// Distance and id of what a packet's answer says is hit.
    pub(crate) fn found(&self, (end, geometry, primitive): (f32, u32, u32)) -> Option<(f32, u32)> {
        self.embree.ids.get(geometry as usize).map(|ids| (end, ids[primitive as usize]))
    }
}

/// All ways to ask a scene that is robust or not.
pub(crate) fn modes(embree: &Arc<Embree>, robust: bool, extent: f64) -> Vec<Mode> {
    // The flag for coherent rays changes nothing for single ones.
    let ready = [(1, false), (8, false), (8, true), (16, false), (16, true)];
    let converted: &[(usize, bool)] = if robust { &[] } else { &[(1, false), (16, false), (16, true)] };
    let ready = ready.iter().map(|mode| (mode, false));
    let all = ready.chain(converted.iter().map(|mode| (mode, true)));
    all.map(|(&(lanes, coherent), converted)| {
        let mut name = format!("embree {lanes}");
        name.push_str(if coherent { " coherent" } else { "" });
        name.push_str(if robust { " robust" } else { "" });
        name.push_str(if converted { ", converted" } else { "" });
        Mode { name, embree: Arc::clone(embree), lanes, coherent, robust, converted, extent }
    })
    .collect()
}

impl Contender for Mode {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        match (self.robust, self.converted) {
            (true, _) => "embree, robust",
            (false, true) => "embree, converted",
            (false, false) => "embree",
        }
    }

    fn is_exact(&self) -> bool {
        false
    }

    fn ready_seconds(&self) -> f64 {
        self.embree.commit_seconds
    }

    fn worker(&self) -> Box<dyn Worker + '_> {
        match self.lanes {
            1 if self.converted => Box::new(Converting::<RayHit1>::new(self)),
            16 if self.converted => Box::new(Converting::<RayHit16>::new(self)),
            1 => Box::new(Asking::<RayHit1>::new(self)),
            8 => Box::new(Asking::<RayHit8>::new(self)),
            _ => Box::new(Asking::<RayHit16>::new(self)),
        }
    }
}

/// A thread's packets.
struct Asking<'e, P> {
    mode: &'e Mode,
    context: Context,
    packets: Vec<P>,
    places: Vec<Place>,
}

impl<'e, P: Packet> Asking<'e, P> {
    fn new(mode: &'e Mode) -> Self {
        Self { mode, context: mode.context(), packets: Vec::new(), places: Vec::new() }
    }

    /// Which lanes of the last packet hold rays.
    fn lanes_of_last(&self) -> Aligned64<[i32; 16]> {
        let rest = self.places.len() - (self.packets.len().max(1) - 1) * P::LANES;
        Aligned64(std::array::from_fn(|lane| if lane < rest { -1 } else { 0 }))
    }
}

impl<P: Packet> Worker for Asking<'_, P> {
    fn load(&mut self, part: &RecordedPart) {
        let rays = rays(part, self.mode.extent);
        self.packets.clear();
        self.places.clear();
        for (i, (ray, place)) in rays.into_iter().enumerate() {
            if i % P::LANES == 0 {
                self.packets.push(P::EMPTY);
            }
            if let Some(packet) = self.packets.last_mut() {
                packet.set(i % P::LANES, ray.origin, ray.direction, ray.span);
            }
            self.places.push(place);
        }
    }

    fn trace(&mut self, part: &RecordedPart) {
        let scene = self.mode.embree.scene;
        let all = Aligned64([-1; 16]);
        let last = self.lanes_of_last();
        let n = self.packets.len();
        let shadow = matches!(part, RecordedPart::Shadow(_));
        for (i, packet) in self.packets.iter_mut().enumerate() {
            let valid = if i + 1 == n { &last } else { &all };
            // SAFETY: the scene was committed and lives as long as the mode that is borrowed; lanes are 0 or -1.
            unsafe {
                if shadow {
                    packet.occluded(valid, scene, &mut self.context);
                } else {
                    packet.intersect(valid, scene, &mut self.context);
                }
            }
        }
    }

    fn compare(&mut self, part: &RecordedPart, disagreements: &mut Disagreements) {
        for (i, place) in self.places.iter().enumerate() {
            let answer = self.packets[i / P::LANES].answer(i % P::LANES);
            let said = match part {
                RecordedPart::Shadow(_) => Said::Blocked(answer.0 < 0.0),
                RecordedPart::Nearest(_) => Said::Nearest(self.mode.found(answer)),
            };
            judge(part, *place, &said, self.mode.extent, disagreements);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_sphere_and_a_triangle() {
        let corner = [[-1.0, -1.0, 5.0], [1.0, -1.0, 5.0], [0.0, 2.0, 5.0]];
        let parts = Parts { triangles: vec![(corner, 7)], spheres: vec![([0.0, 0.0, -3.0], 1.0, 9)] };
        let embree = Embree::new(&parts, true, 1).unwrap();
        assert!(embree.bytes > 0);
        let mut context = Context { flags: 0, filter: std::ptr::null(), instance: ffi::INVALID };
        for (z, expected) in [(1.0, (5.0, 7)), (-1.0, (2.0, 9))] {
            let mut packet = RayHit16::EMPTY;
            packet.set(3, [0.0; 3], [0.0, 0.0, z], [0.0, f32::INFINITY]);
            let valid = Aligned64(std::array::from_fn(|lane| -i32::from(lane == 3)));
            // SAFETY: the scene was committed just now, and lives.
            unsafe { packet.intersect(&valid, embree.scene, &mut context) };
            let (t, geometry, primitive) = packet.answer(3);
            assert_eq!((t, embree.ids[geometry as usize][primitive as usize]), expected);
            assert_eq!(packet.answer(2).1, ffi::INVALID);
        }
    }
}
