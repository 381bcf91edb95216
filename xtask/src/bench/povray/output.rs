//! What POV-Ray prints, and the picture it writes.

/// What POV-Ray's statistics say of one render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Printed {
    /// Its own time for tracing, by the clock, to the millisecond.
    pub(super) seconds: f64,
    /// How many threads traced.
    pub(super) threads: u64,
    /// All rays but those towards lights.
    pub(super) rays: u64,
    /// Rays reflected, without those of total reflection.
    pub(super) reflected: u64,
    /// Rays refracted, or let through unbent.
    pub(super) refracted: u64,
    /// Rays towards lights, with those that go on behind a transmissive surface: "shadow ray tests".
    pub(super) shadow_tests: u64,
}

impl Printed {
    /// Reads the statistics at the end of what POV-Ray writes to its error stream.
    ///
    /// # Errors
    ///
    /// What is missing.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        // Only what follows counts: the options before use the same words.
        let (_, text) = text.split_once("Render Statistics").ok_or("POV-Ray printed no statistics")?;
        let (_, times) =
            text.split_once("Trace Time:").ok_or("POV-Ray printed no `Trace Time:`".to_owned())?;
        let seconds = times.split_once('(').and_then(|(_, rest)| rest.split_once(" seconds)"));
        let seconds = seconds.and_then(|(number, _)| number.parse().ok());
        let count = |name: &str| number_after(text, name);
        let required = |name: &str| count(name).ok_or_else(|| format!("POV-Ray printed no `{name}`"));
        Ok(Self {
            seconds: seconds.ok_or("POV-Ray printed a trace time without seconds")?,
            threads: number_after(times, "using").ok_or("POV-Ray printed no number of threads")?,
            rays: required("Rays:")?,
            // Lines of what there was none of are left out.
            reflected: count("Reflected Rays:").unwrap_or(0),
            refracted: count("Refracted Rays:").unwrap_or(0) + count("Transmitted Rays:").unwrap_or(0),
            shadow_tests: count("Shadow Ray Tests:").unwrap_or(0),
        })
    }
}

/// The number after a name that begins a line.
fn number_after(text: &str, name: &str) -> Option<u64> {
    let mut lines = text.lines().filter_map(|line| line.trim_start().strip_prefix(name));
    lines.next()?.split_whitespace().next()?.parse().ok()
}

/// A picture of 8 bits a colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Reads a binary PPM.
    pub(super) fn from_ppm(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(b"P6")?;
        let mut header = [0_u32; 3];
        for number in &mut header {
            *number = next_number(&mut rest)?;
        }
        let [width, height, 255] = header else { return None };
        // One blank ends the header.
        let samples = rest.get(1..)?;
        let (pixels, []) = samples.as_chunks::<3>() else { return None };
        let pixels = pixels.to_vec();
        (pixels.len() as u64 == u64::from(width) * u64::from(height)).then_some(Self {
            width,
            height,
            pixels,
        })
    }

    /// How far the colours of two pictures of one size lie apart, from 0 to 255.
    pub(super) fn difference(&self, other: &Self) -> Difference {
        assert_eq!((self.width, self.height), (other.width, other.height), "pictures of one size");
        let pairs = self.pixels.iter().zip(&other.pixels);
        let largest = pairs.map(|(a, b)| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0));
        let pairs = self.pixels.iter().flatten().zip(other.pixels.iter().flatten());
        let sum: u64 = pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        let n = self.pixels.len().max(1) as f64;
        Difference { mean: sum as f64 / (3.0 * n), off: largest.filter(|&off| off > 8).count() as f64 / n }
    }
}

/// How far two pictures lie apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    /// The mean over pixels and colours, of 255.
    pub(super) mean: f64,
    /// The share of pixels with a colour more than 8 of 255 off.
    pub(super) off: f64,
}

/// Takes a number, and the blanks and comments before it.
fn next_number(rest: &mut &[u8]) -> Option<u32> {
    loop {
        *rest = rest.trim_ascii_start();
        if !rest.starts_with(b"#") {
            break;
        }
        let end = rest.iter().position(|byte| *byte == b'\n')?;
        *rest = &rest[end..];
    }
    let end = rest.iter().position(|byte| !byte.is_ascii_digit())?;
    let number = std::str::from_utf8(&rest[..end]).ok()?.parse().ok();
    *rest = &rest[end..];
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = "
Render Options
  Quality:  9
==== [Rendering...] ====
Rendered 1024 of 262144 pixels (0%)\rRendered 262144 of 262144 pixels (100%)\r
----------------------------------------------------------------------------
Render Statistics
Image Resolution 512 x 512
----------------------------------------------------------------------------
Pixels:           262144   Samples:               0   Smpls/Pxl: 0.00
Rays:             507198   Saved:                 0   Max Level: 5/5
----------------------------------------------------------------------------
Shadow Ray Tests:            161667   Succeeded:                 58058
Reflected Rays:              147506   Total Internal:             5828
Refracted Rays:               97548
----------------------------------------------------------------------------
Render Time:
  Photon Time:      No photons
  Radiosity Time:   No radiosity
  Trace Time:       0 hours  1 minutes  2 seconds (62.107 seconds)
              using 1 thread(s) with 61.900 CPU-seconds total
POV-Ray finished
";

    #[test]
    fn statistics_are_read_to_the_millisecond() {
        let expected = Printed {
            seconds: 62.107,
            threads: 1,
            rays: 507_198,
            reflected: 147_506,
            refracted: 97_548,
            shadow_tests: 161_667,
        };
        assert_eq!(Printed::parse(PRINTED), Ok(expected));
        let matt: String =
            PRINTED.lines().filter(|line| !line.starts_with("Ref")).map(|line| format!("{line}\n")).collect();
        assert_eq!(Printed::parse(&matt), Ok(Printed { reflected: 0, refracted: 0, ..expected }));
    }

    #[test]
    fn output_without_a_time_is_an_error() {
        assert!(Printed::parse("Fatal error in parser").unwrap_err().contains("no statistics"));
        let cut = PRINTED.split("Trace Time").next().unwrap();
        assert!(Printed::parse(cut).unwrap_err().contains("Trace Time"));
    }

    #[test]
    fn ppm_is_read_with_its_comments() {
        let picture = Picture::from_ppm(b"P6\n# by \"x\"\n2 1 255\n\x00\x0a\xff #\n").unwrap();
        assert_eq!(picture, Picture { width: 2, height: 1, pixels: vec![[0, 10, 255], [b' ', b'#', b'\n']] });
        assert_eq!(Picture::from_ppm(b"P6 2 1 255\n\x00\x00\x00"), None, "too short");
        assert_eq!(Picture::from_ppm(b"P6 1 1 65535\n\x00\x00\x00\x00\x00\x00"), None, "two bytes a colour");
    }

    #[test]
    fn differences_count_pixels_and_mean_colours() {
        let picture = |pixels: &[[u8; 3]]| Picture { width: 2, height: 1, pixels: pixels.to_vec() };
        let difference = picture(&[[0, 0, 0], [9, 0, 0]]).difference(&picture(&[[8, 0, 0], [0, 0, 1]]));
        assert_eq!(difference, Difference { mean: 3.0, off: 0.5 });
    }
}
