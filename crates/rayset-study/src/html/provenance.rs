//! How a figure was made.

use maud::{Markup, html};

/// A list of names and values beside a figure; nothing of the day or the place, so that equal records give equal bytes.
pub(super) fn made(entries: &[(&str, String)]) -> Markup {
    html! {
        div.made {
            p.made-head { "How this was made" }
            dl {
                @for (name, value) in entries {
                    div {
                        dt { (name) }
                        dd { @if *name == "command" { code { (value) } } @else { (value) } }
                    }
                }
            }
        }
    }
}

/// Numbers as `1, 2, 4`, or `1 to 16` where they follow each other.
pub(super) fn numbers(values: &[u64]) -> String {
    let follow = values.windows(2).all(|pair| pair[1] == pair[0] + 1);
    match values {
        [first, .., last] if follow && values.len() > 2 => format!("{first} to {last}"),
        _ => values.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}

/// A cut-off as text.
pub(super) fn cutoff(value: Option<f64>) -> String {
    value.map_or_else(|| "off".to_owned(), |value| format!("{value:.6}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_a_row_are_shortened() {
        assert_eq!(numbers(&[1, 2, 3, 4]), "1 to 4");
        assert_eq!(numbers(&[1, 2]), "1, 2");
        assert_eq!(numbers(&[1, 2, 4]), "1, 2, 4");
        assert_eq!(numbers(&[]), "");
    }

    #[test]
    fn values_are_escaped() {
        let list = made(&[("scene", "a < b".to_owned())]).into_string();
        assert!(list.contains("<dd>a &lt; b</dd>"), "{list}");
    }
}
