//! The options of the literal strategy by name, for commands and reports.

use std::fmt;

use super::options::{
    BlockerRule, EndPlaneRule, InheritanceRule, LightRule, MatchRule, MissRule, OriginatingRule, SlabRule,
    Speer1985Options,
};

/// The text names no option of `speer-1985`, or no choice of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownReading {
    message: String,
}

impl fmt::Display for UnknownReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for UnknownReading {}

macro_rules! readings {
    ($($field:ident: $rule:ident { $($variant:ident = $name:literal),+ })+) => {
        impl Speer1985Options {
            /// Every option with the names of its choices; the first is the default.
            pub const CHOICES: &[(&'static str, &'static [&'static str])] =
                &[$((stringify!($field), &[$($name),+])),+];

            /// Every option with the name of the choice taken.
            #[must_use]
            pub fn choices(&self) -> Vec<(&'static str, &'static str)> {
                vec![$((stringify!($field), match self.$field { $($rule::$variant => $name),+ })),+]
            }

            /// Takes a choice by name.
            ///
            /// # Errors
            ///
            /// [`UnknownReading`] if there is no such option or choice; it says which there are.
            pub fn choose(&mut self, option: &str, choice: &str) -> Result<(), UnknownReading> {
                match (option, choice) {
                    $($((stringify!($field), $name) => self.$field = $rule::$variant,)+)+
                    _ => return Err(unknown(option, choice)),
                }
                Ok(())
            }
        }
    };
}

readings! {
    misses: MissRule { Partition = "partition", Cylinder = "cylinder" }
    light_rays: LightRule { Blocked = "blocked", All = "all", None = "none" }
    blocker: BlockerRule { Nearest = "nearest", First = "first" }
    slab: SlabRule { Overlapping = "overlapping", Centre = "centre", Inside = "inside" }
    end_planes: EndPlaneRule { SideOnly = "side-only", Closed = "closed" }
    matching: MatchRule { AnyOrigin = "any-origin", SameObject = "same-object", SameObjectAndSide = "same-object-and-side" }
    inheritance: InheritanceRule { Formative = "formative", Nothing = "nothing" }
    originating: OriginatingRule { Excluded = "excluded", Included = "included" }
}

fn unknown(option: &str, choice: &str) -> UnknownReading {
    let all = Speer1985Options::CHOICES;
    let message = match all.iter().find(|(name, _)| *name == option) {
        Some((_, choices)) => format!("`{option}` is not `{choice}`; it is one of {}", choices.join(", ")),
        None => {
            let names: Vec<_> = all.iter().map(|(name, _)| *name).collect();
            format!("`{option}` is no option of speer-1985; there are {}", names.join(", "))
        }
    };
    UnknownReading { message }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_is_taken_by_its_name_and_the_first_is_the_default() {
        for (option, choices) in Speer1985Options::CHOICES {
            for choice in *choices {
                let mut options = Speer1985Options::default();
                options.choose(option, choice).unwrap();
                assert!(options.choices().contains(&(option, choice)), "{option} = {choice}");
            }
            assert!(Speer1985Options::default().choices().contains(&(option, choices[0])), "{option}");
        }
    }

    #[test]
    fn unknown_names_are_refused_with_those_there_are() {
        let mut options = Speer1985Options::default();
        let error = options.choose("slab", "round").unwrap_err().to_string();
        assert_eq!(error, "`slab` is not `round`; it is one of overlapping, centre, inside");
        assert!(options.choose("colour", "red").unwrap_err().to_string().contains("misses, light_rays"));
    }
}
