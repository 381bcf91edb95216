//! Memory in large pages.

/// What the smallest large page holds, in bytes: less memory than that gains nothing.
const LARGE_PAGE: usize = 2 << 20;

/// A vector with room for so many elements, in large pages of memory where the system has them for the asking.
///
/// A hierarchy is read here and there, and where it takes many megabytes nearly every step of a ray asks for a page whose
/// place the processor does not have at hand. Pages of 2 MiB instead of 4 KiB make that rare. Linux gives them where
/// `/sys/kernel/mm/transparent_hugepage/enabled` says `madvise` or `always`; elsewhere, and where it is small, this is a
/// plain vector. What it holds is the same in any case.
///
/// The memory is asked for before it is first written: fill it in place, without growing it.
///
/// ```
/// let mut squares = rayset_simd::large_page_vec(1 << 20);
/// squares.extend((0..1_u64 << 20).map(|i| i * i));
/// assert_eq!(squares[1000], 1_000_000);
/// ```
#[must_use]
pub fn large_page_vec<T>(capacity: usize) -> Vec<T> {
    let vec: Vec<T> = Vec::with_capacity(capacity);
    let bytes = capacity * size_of::<T>();
    if bytes >= LARGE_PAGE {
        advise(vec.as_ptr().cast(), bytes);
    }
    vec
}

#[cfg(target_os = "linux")]
fn advise(start: *const u8, len: usize) {
    /// The largest that a small page is on any machine: advice is given from the start of one on.
    const SMALL_PAGE: usize = 64 << 10;
    let before = start.addr() % SMALL_PAGE;
    let first = start.wrapping_sub(before).cast_mut();
    let len = (before + len).next_multiple_of(SMALL_PAGE);
    // SAFETY: this advice changes neither what memory holds nor who may read and write it, only how large the pages are
    // that it will lie in, so that it may be given for any addresses, whoever uses them. Where it cannot be followed it
    // is refused, and nothing is lost.
    unsafe { libc::madvise(first.cast(), len, libc::MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn advise(_: *const u8, _: usize) {}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::fs;

    use super::*;

    /// Whether the memory at an address is to lie in large pages, as the system sees it.
    fn is_advised(address: usize) -> bool {
        let maps = fs::read_to_string("/proc/self/smaps").unwrap();
        let mut is_inside = false;
        for line in maps.lines() {
            let range = line.split(' ').next().and_then(|range| range.split_once('-'));
            if let Some((start, end)) = range
                && let (Ok(start), Ok(end)) =
                    (usize::from_str_radix(start, 16), usize::from_str_radix(end, 16))
            {
                is_inside = (start..end).contains(&address);
            } else if is_inside && let Some(flags) = line.strip_prefix("VmFlags:") {
                return flags.split_whitespace().any(|flag| flag == "hg");
            }
        }
        false
    }

    #[test]
    fn much_memory_lies_in_large_pages_where_the_system_has_them() {
        let mut vec = large_page_vec(3 * LARGE_PAGE);
        vec.resize(3 * LARGE_PAGE, 7_u8);
        assert!(vec.iter().all(|&byte| byte == 7));
        if fs::exists("/sys/kernel/mm/transparent_hugepage/enabled").unwrap() {
            assert!(is_advised(vec.as_ptr().addr() + LARGE_PAGE));
        }
    }

    #[test]
    fn nothing_and_nothing_sized_is_no_trouble() {
        assert_eq!(large_page_vec::<u64>(0).capacity(), 0);
        let mut units = large_page_vec(1 << 40);
        units.push(());
        assert_eq!(units.len(), 1);
    }
}
