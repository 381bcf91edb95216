//! Reads tables and values, each with its place in the text.

use std::ops::RangeInclusive;

use rayset_geometry::glam::DVec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::keys::Section;
use crate::{Color, MAX_COORDINATE, SceneError};

/// Bytes of a name that is compared with others to find what was meant; the comparison is quadratic in them.
const MAX_SUGGESTION: usize = 64;

/// What is wrong with a file.
#[derive(Debug)]
pub(super) enum Fault {
    /// Something in its own text.
    Here {
        /// The offset in bytes from the beginning of the text.
        at: usize,
        /// What is wrong.
        message: String,
    },
    /// Something that knows its place by itself.
    Elsewhere(SceneError),
}

impl Fault {
    pub(super) fn new(at: usize, message: impl Into<String>) -> Self {
        Self::Here { at, message: message.into() }
    }
}

/// A table, all keys of which are known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'t> {
    table: &'t DeTable<'t>,
    section: &'static Section,
    at: usize,
}

impl<'t> Fields<'t> {
    /// Refuses keys that the section does not have.
    pub(super) fn new(table: &'t DeTable<'t>, at: usize, section: &'static Section) -> Result<Self, Fault> {
        // The first of the text, rather than of the alphabet.
        let unknown = table
            .keys()
            .filter(|key| !section.keys.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        match unknown {
            None => Ok(Self { table, section, at }),
            Some(key) => {
                let name = key.get_ref().as_ref();
                let hint = match suggestion(name, section.keys.iter().copied()) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => format!("it has `{}`", section.keys.join("`, `")),
                };
                let message = format!("unknown key `{}` in {}: {hint}", excerpt(name), section.title);
                Err(Fault::new(key.span().start, message))
            }
        }
    }

    /// Where the table begins.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// The value of a key, if there is one.
    pub(super) fn get(&self, key: &'static str) -> Option<Field<'t>> {
        debug_assert!(self.section.keys.contains(&key), "{} has no `{key}`", self.section.title);
        let (name, value) = self.table.get_key_value(key)?;
        Some(Field { key, key_at: name.span().start, value })
    }

    /// The value of a key that must be there.
    pub(super) fn required(&self, key: &'static str) -> Result<Field<'t>, Fault> {
        self.get(key).ok_or_else(|| Fault::new(self.at, format!("{} needs `{key}`", self.section.title)))
    }

    /// The value of a key as something, or a default.
    pub(super) fn or<T>(
        &self,
        key: &'static str,
        default: T,
        read: impl FnOnce(Field<'t>) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        self.get(key).map_or(Ok(default), read)
    }

    /// The one of two keys that is there; both is an error.
    pub(super) fn either(&self, one: &'static str, other: &'static str) -> Result<Option<Field<'t>>, Fault> {
        match (self.get(one), self.get(other)) {
            (Some(a), Some(b)) => {
                let at = a.key_at.max(b.key_at);
                Err(Fault::new(at, format!("{} has both `{one}` and `{other}`", self.section.title)))
            }
            (a, b) => Ok(a.or(b)),
        }
    }

    /// The tables of a list of them, `[[key]]`; none if the key is not there.
    pub(super) fn tables(
        &self,
        key: &'static str,
        section: &'static Section,
    ) -> Result<Vec<Fields<'t>>, Fault> {
        let Some(field) = self.get(key) else { return Ok(Vec::new()) };
        let DeValue::Array(array) = field.value.get_ref() else {
            return Err(field.fault(format!("`{key}` is a list of tables: write [[{key}]]")));
        };
        let tables = array.iter().map(|value| Field { value, ..field }.table(section));
        tables.collect()
    }
}

/// A value, and the key to name when it is refused.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field<'t> {
    key: &'static str,
    key_at: usize,
    value: &'t Spanned<DeValue<'t>>,
}

impl<'t> Field<'t> {
    /// The key.
    pub(super) fn key(&self) -> &'static str {
        self.key
    }

    /// Where the value begins.
    pub(super) fn at(&self) -> usize {
        self.value.span().start
    }

    pub(super) fn fault(&self, message: impl Into<String>) -> Fault {
        Fault::new(self.at(), message)
    }

    fn not_a(&self, expected: &str) -> Fault {
        let found = match self.value.get_ref() {
            DeValue::String(_) => "a string",
            DeValue::Integer(_) | DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.fault(format!("`{}` is {found}, not {expected}", self.key))
    }

    /// A finite number.
    pub(super) fn number(self) -> Result<f64, Fault> {
        let value = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().unwrap_or(f64::NAN),
            DeValue::Integer(integer) if integer.radix() == 10 => {
                integer.as_str().parse().unwrap_or(f64::NAN)
            }
            #[expect(clippy::cast_precision_loss, reason = "rounded as a decimal number would be")]
            DeValue::Integer(integer) => {
                i64::from_str_radix(integer.as_str(), integer.radix()).map_or(f64::NAN, |value| value as f64)
            }
            _ => return Err(self.not_a("a number")),
        };
        if value.is_finite() { Ok(value) } else { Err(self.fault(format!("`{}` is not finite", self.key))) }
    }

    /// A number that is not negative.
    pub(super) fn not_negative(self) -> Result<f64, Fault> {
        match self.number()? {
            value if value >= 0.0 => Ok(value),
            _ => Err(self.fault(format!("`{}` is negative", self.key))),
        }
    }

    /// A number greater than zero.
    pub(super) fn positive(self) -> Result<f64, Fault> {
        match self.number()? {
            value if value > 0.0 => Ok(value),
            _ => Err(self.fault(format!("`{}` is not positive", self.key))),
        }
    }

    /// A number that is not negative, nor greater than a coordinate may be.
    pub(super) fn length(self) -> Result<f64, Fault> {
        match self.not_negative()? {
            value if value <= MAX_COORDINATE => Ok(value),
            _ => Err(self.fault(format!("`{}` exceeds {MAX_COORDINATE:e}", self.key))),
        }
    }

    /// A whole number within a range.
    pub(super) fn integer(self, range: RangeInclusive<u64>) -> Result<u64, Fault> {
        let DeValue::Integer(integer) = self.value.get_ref() else {
            return Err(self.not_a("a whole number"));
        };
        match u64::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(value) if range.contains(&value) => Ok(value),
            _ => Err(self.fault(format!(
                "`{}` is not between {} and {}",
                self.key,
                range.start(),
                range.end()
            ))),
        }
    }

    /// [`Field::integer`] of 32 bits.
    pub(super) fn integer_32(self, range: RangeInclusive<u32>) -> Result<u32, Fault> {
        let value = self.integer(u64::from(*range.start())..=u64::from(*range.end()))?;
        Ok(u32::try_from(value).expect("the range has 32 bits"))
    }

    /// `true` or `false`.
    pub(super) fn boolean(self) -> Result<bool, Fault> {
        self.value.get_ref().as_bool().ok_or_else(|| self.not_a("true or false"))
    }

    /// A string.
    pub(super) fn string(self) -> Result<&'t str, Fault> {
        self.value.get_ref().as_str().ok_or_else(|| self.not_a("a string"))
    }

    /// The values of a list, of any length.
    pub(super) fn list(self) -> Result<impl ExactSizeIterator<Item = Field<'t>> + Clone, Fault> {
        let array = self.value.get_ref().as_array().ok_or_else(|| self.not_a("a list"))?;
        Ok(array.iter().map(move |value| Field { value, ..self }))
    }

    /// Whether the value is a list.
    pub(super) fn is_list(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// The values of a list of known length.
    pub(super) fn list_of<const N: usize>(self, what: &str) -> Result<[Field<'t>; N], Fault> {
        let list: Vec<_> = self.list()?.take(N + 1).collect();
        let n_found = self.list()?.len();
        list.try_into().map_err(|_| self.fault(format!("`{}` needs {N} {what}, not {n_found}", self.key)))
    }

    /// Three finite numbers.
    pub(super) fn vector(self) -> Result<DVec3, Fault> {
        let [x, y, z] = self.list_of("numbers")?;
        Ok(DVec3::new(x.number()?, y.number()?, z.number()?))
    }

    /// A point that a scene may hold.
    pub(super) fn point(self) -> Result<DVec3, Fault> {
        let point = self.vector()?;
        if point.abs().max_element() <= MAX_COORDINATE {
            Ok(point)
        } else {
            Err(self.fault(format!("`{}` exceeds {MAX_COORDINATE:e}", self.key)))
        }
    }

    /// A list of points that a scene may hold.
    pub(super) fn points<const N: usize>(self) -> Result<[DVec3; N], Fault> {
        let fields = self.list_of::<N>("points")?;
        let mut points = [DVec3::ZERO; N];
        for (point, field) in points.iter_mut().zip(fields) {
            *point = field.point()?;
        }
        Ok(points)
    }

    /// A grey, or red, green and blue; none negative.
    pub(super) fn color(self) -> Result<Color, Fault> {
        if !self.is_list() {
            return self.not_negative().map(Color::splat);
        }
        let [r, g, b] = self.list_of("numbers")?;
        Ok(Color::new(r.not_negative()?, g.not_negative()?, b.not_negative()?))
    }

    /// A table of known keys.
    pub(super) fn table(self, section: &'static Section) -> Result<Fields<'t>, Fault> {
        match self.value.get_ref() {
            DeValue::Table(table) => Fields::new(table, self.at(), section),
            _ => Err(self.not_a("a table")),
        }
    }

    /// A table of any keys, each with its name and the place of that, in the order of the text.
    pub(super) fn entries(self, key: &'static str) -> Result<Vec<(&'t str, usize, Field<'t>)>, Fault> {
        let table = self.value.get_ref().as_table().ok_or_else(|| self.not_a("a table"))?;
        let mut entries: Vec<_> = table
            .iter()
            .map(|(name, value)| {
                let at = name.span().start;
                (name.get_ref().as_ref(), at, Field { key, key_at: at, value })
            })
            .collect();
        entries.sort_by_key(|(_, at, _)| *at);
        Ok(entries)
    }
}

/// The known name that an unknown one is most likely meant to be.
pub(super) fn suggestion<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > MAX_SUGGESTION {
        return None;
    }
    let name = name.to_lowercase();
    let likeness = |known: &str| strsim::jaro_winkler(&name, &known.to_lowercase());
    known
        .into_iter()
        .filter(|known| known.len() <= MAX_SUGGESTION)
        .map(|known| (likeness(known), known))
        .filter(|(likeness, _)| *likeness >= 0.8)
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, known)| known)
}

/// The beginning of a word of a file, fit for a message.
pub(super) fn excerpt(word: &str) -> String {
    word.chars().filter(|c| !c.is_control()).take(40).collect()
}
