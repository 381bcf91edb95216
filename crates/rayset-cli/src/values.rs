//! The values of options.

use std::str::FromStr;

use rayset::engine::{Crop, Layer, Layers, PixelOrder};
use rayset::glam::DVec3;
use rayset::scene::Limits;

/// `WxH`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Resolution(pub(crate) u32, pub(crate) u32);

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        let (width, height) = sides.ok_or("a resolution is two numbers of pixels, as in 640x480")?;
        Ok(Self(width, height))
    }
}

/// A number from 0 to 1, or `off`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cutoff(pub(crate) Option<f64>);

impl FromStr for Cutoff {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            _ if text == "off" => Ok(Self(None)),
            Ok(value) if (0.0..=1.0).contains(&value) => Ok(Self(Some(value))),
            _ => Err("a cut-off is a number from 0 to 1, or `off`".to_owned()),
        }
    }
}

/// `scanline`, `serpentine`, `tiles`, `tiles=N`, `morton` or `morton=N`.
pub(crate) fn order(text: &str) -> Result<PixelOrder, String> {
    let (name, size) = text.split_once('=').unwrap_or((text, "16"));
    match (text, name, size.parse::<u32>()) {
        ("scanline", ..) => Ok(PixelOrder::Scanline),
        ("serpentine", ..) => Ok(PixelOrder::Serpentine),
        (_, "tiles", Ok(size @ 1..=4096)) => Ok(PixelOrder::Tiles(size)),
        (_, "morton", Ok(size @ 1..=4096)) => Ok(PixelOrder::Morton(size)),
        _ => {
            Err("an order is `scanline`, `serpentine`, `tiles=N` or `morton=N`, with N from 1 to 4096"
                .to_owned())
        }
    }
}

/// Four numbers of pixels.
pub(crate) fn crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, width, height]) => Ok(Crop { x, y, width, height }),
        _ => Err("a crop is four numbers of pixels, as in 100,50,64,64".to_owned()),
    }
}

/// Three finite numbers.
pub(crate) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("a point or vector is three numbers, as in 1,2.5,-3".to_owned()),
    }
}

/// Names of layers, or `all`.
pub(crate) fn layers(text: &str) -> Result<Layers, String> {
    if text == "all" {
        return Ok(Layers::ALL);
    }
    let layers: Result<Layers, _> = text.split(',').map(|name| name.trim().parse::<Layer>()).collect();
    layers.map_err(|error| error.to_string())
}

/// `NAME=NUMBER`, for one of [`Limits`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    name: &'static str,
    value: u64,
}

impl Limit {
    const NAMES: [&str; 6] = ["line-bytes", "faces", "corners", "library-bytes", "memory-bytes", "warnings"];

    /// Sets the limit.
    pub(crate) fn apply(self, limits: &mut Limits) {
        let size = usize::try_from(self.value).unwrap_or(usize::MAX);
        match self.name {
            "line-bytes" => limits.line_bytes = size,
            "faces" => limits.faces = self.value,
            "corners" => limits.corners = u32::try_from(self.value).unwrap_or(u32::MAX),
            "library-bytes" => limits.library_bytes = self.value,
            "memory-bytes" => limits.memory_bytes = self.value,
            _ => limits.warnings = size,
        }
    }
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').unwrap_or((text, ""));
        let name = Self::NAMES.into_iter().find(|known| *known == name);
        match (name, value.parse()) {
            (Some(name), Ok(value)) => Ok(Self { name, value }),
            _ => Err(format!("a limit is NAME=NUMBER, and NAME one of {}", Self::NAMES.join(", "))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_and_nonsense_is_not() {
        assert_eq!("640x480".parse(), Ok(Resolution(640, 480)));
        assert_eq!("off".parse(), Ok(Cutoff(None)));
        assert_eq!("0.25".parse(), Ok(Cutoff(Some(0.25))));
        assert_eq!(order("tiles=8"), Ok(PixelOrder::Tiles(8)));
        assert_eq!(order("morton"), Ok(PixelOrder::Morton(16)));
        assert_eq!(crop("1,2,3,4"), Ok(Crop { x: 1, y: 2, width: 3, height: 4 }));
        assert_eq!(vector("-1, 2.5,3e2"), Ok(DVec3::new(-1.0, 2.5, 300.0)));
        assert_eq!(layers("all"), Ok(Layers::ALL));
        assert_eq!(layers("beauty,depth"), Ok(Layers::BEAUTY.with(Layer::Depth)));
        for text in ["", "640", "x480", "640x-1", "640x480x3"] {
            assert!(text.parse::<Resolution>().is_err(), "{text}");
            assert!(crop(text).is_err() && vector(text).is_err() && order(text).is_err(), "{text}");
        }
        assert!("2".parse::<Cutoff>().is_err() && "nan".parse::<Cutoff>().is_err());
        assert!(order("tiles=0").is_err() && order("serpentine=4").is_err());
        assert!(vector("1,2,inf").is_err() && layers("beauty,").is_err());
    }

    #[test]
    fn every_limit_has_a_name() {
        let mut limits = Limits::default();
        for name in Limit::NAMES {
            let before = limits;
            format!("{name}=7").parse::<Limit>().unwrap().apply(&mut limits);
            assert_ne!(before, limits, "{name}");
        }
        assert!("colour=7".parse::<Limit>().is_err() && "faces".parse::<Limit>().is_err());
    }
}
