//! What was found, by family of scenes and by kind of ray.

use std::fmt;

use rayset_engine::ByKind;

use super::families::Family;
use super::watch::Tally;

/// Tallies of every family.
#[derive(Debug, Default)]
pub(crate) struct Table {
    rows: [ByKind<Tally>; Family::ALL.len()],
}

impl Table {
    pub(crate) fn add(&mut self, family: Family, tallies: &ByKind<Tally>) {
        self.rows[family as usize] += *tallies;
    }

    /// Of all kinds in all families.
    pub(crate) fn total(&self) -> Tally {
        self.by_kind().total()
    }

    fn by_kind(&self) -> ByKind<Tally> {
        let mut sum = ByKind::default();
        for row in &self.rows {
            sum += *row;
        }
        sum
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let header = ["rays", "accepted", "", "checked", "partitioned", "violations"];
        let [rays, accepted, share, checked, partitioned, violations] = header;
        writeln!(
            f,
            "{:27}{rays:>12}{accepted:>12}{share:>6}{checked:>12}{partitioned:>12}{violations:>12}",
            "scenes"
        )?;
        for family in Family::ALL {
            line(f, family.name(), &self.rows[family as usize].total())?;
        }
        let by_kind = self.by_kind();
        for (kind, tally) in by_kind.iter() {
            line(f, &format!("all: {} rays", kind.name()), tally)?;
        }
        line(f, "all", &by_kind.total())
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
fn line(f: &mut fmt::Formatter<'_>, name: &str, tally: &Tally) -> fmt::Result {
    let Tally { rays, accepted, checked, partitioned, violations } = *tally;
    let share = 100.0 * accepted as f64 / rays.max(1) as f64;
    writeln!(
        f,
        "{name:27}{rays:>12}{accepted:>12}{share:>5.0}%{checked:>12}{partitioned:>12}{violations:>12}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_adds_up_by_family_and_by_kind() {
        let tally = Tally { rays: 4, accepted: 2, checked: 1, partitioned: 1, violations: 1 };
        let mut table = Table::default();
        table.add(Family::Glass, &ByKind { shadow: tally, ..ByKind::default() });
        table.add(Family::Glass, &ByKind { initial: tally, ..ByKind::default() });
        assert_eq!(table.total().rays, 8);
        let text = table.to_string();
        let row = |name: &str| {
            let line = text.lines().find(|line| line.starts_with(name)).unwrap();
            line[27..].split_whitespace().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(row("glass in glass"), ["8", "4", "50%", "2", "2", "2"]);
        assert_eq!(row("all: shadow rays"), ["4", "2", "50%", "1", "1", "1"]);
        assert_eq!(row("meshes"), ["0", "0", "0%", "0", "0", "0"]);
    }

    #[test]
    fn families_stand_in_the_order_of_their_numbers() {
        for (i, family) in Family::ALL.into_iter().enumerate() {
            assert_eq!(family as usize, i);
        }
    }
}
