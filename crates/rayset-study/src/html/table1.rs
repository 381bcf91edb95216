//! Table 1: the paper as printed, recomputed, and ours.

use maud::{Markup, PreEscaped, Render, html};
use rayset_engine::{Backend, StrategyKind};
use rayset_scene::{RandomSpheres, SphereSize};

use super::draw::{Curve, Lines, Point};
use super::provenance::{cutoff, made, numbers};
use super::{ReportPlan, Section, Step};
use crate::study::{OtherRow, OtherScenes};
use crate::table1::{Recorded, RecordedExact, RecordedRow, RecordedStrategy};
use crate::{PaperRow, Spread, StudyError, Table1};

/// A line of the table.
#[derive(Clone)]
struct Entry {
    /// Whose figures.
    source: String,
    /// Number of the source: its colour and shape.
    style: usize,
    /// Times of `standard` and of the strategy, with their unit.
    times: [String; 2],
    percent: Option<Spread>,
    ratio: Option<Spread>,
    work: Option<f64>,
    wrong: Option<(u64, u64)>,
}

pub(super) fn section(plan: &ReportPlan, step: Step<'_>) -> Result<Section, StudyError> {
    let (table, is_new) = recorded(plan, step)?;
    let scenes = OtherScenes {
        spheres: table.ours.iter().filter_map(|row| row.spheres).collect(),
        seeds: table.options.seeds.iter().copied().take(plan.other_seeds).collect(),
        resolution: table.options.resolution,
        max_depth: table.options.max_depth,
        cutoff: table.options.cutoff,
        backend: table.options.backend.parse::<Backend>().unwrap_or(Backend::Scalar),
        repetitions: plan.other_repetitions,
    };
    let is_in_table = |kind: &StrategyKind| {
        let has = |row: &RecordedRow| {
            row.strategies.contains_key(kind.name()) || row.exact.contains_key(kind.name())
        };
        table.ours.iter().any(|row| row.spheres.is_some() && has(row))
    };
    let mut others = Vec::new();
    for kind in StrategyKind::ALL.iter().filter(|kind| !is_in_table(kind)) {
        let path = plan.study.join("table1-others.jsonl");
        let part = format!("Table 1, {}", kind.name());
        others.push((kind.name(), scenes.rows(*kind, &path, &|done, all| step(&part, done, all))?));
    }
    let groups = groups(&table, &others, &scenes);
    let mesh = |row: &RecordedRow| {
        let name = html! { (row.scene) br; small { "n = " (row.volumes) } };
        (name, [of_readings(row), of_exact(row)].concat())
    };
    let meshes: Vec<_> = table.ours.iter().filter(|row| row.spheres.is_none()).map(mesh).collect();
    let is_earlier =
        table.ours.iter().flat_map(|row| row.exact.values()).any(|it| it.percent_coherent.is_none());
    let body = html! {
        p {
            "The paper's table, and the same experiment on scenes of random spheres. "
            "The paper says neither its resolution nor its scenes, so its times compare with ours by their ratio only; and its printed ratios do not follow from its own times, so the recomputed ones stand beside them."
        }
        @for preset in &table.presets {
            p {
                code { (preset.name) } " is the setting that came nearest to the paper's percentages among those tried, and no claim about what the authors did: "
                (preset.differences) "; it counts " (preset.counting) "."
            }
        }
        @if is_new { p.note { "No results of Table 1 were recorded: its quick form was run for this report." } }
        @if is_earlier {
            p.note { "An earlier version recorded these results, without the coherence of exact strategies; " code { "cargo xtask repro-table1" } " records it." }
        }
        (as_table("table1-caption", "n", &groups, "Table 1. n is the number of spheres. Coherence and work are of all seeds together, ratios of times are medians; in brackets quartiles, over seeds or over all pairs of runs."))
        (figures(&groups)?)
        @if !meshes.is_empty() {
            (as_table("table2-caption", "scene", &meshes, "Meshes, in the same columns. n is the number of bounding volumes; the paper has no such rows."))
        }
        (provenance(plan, &table, &scenes, &others))
    };
    Ok(Section { id: "table1", title: "Table 1", body })
}

/// What is recorded, or else the quick form, which is recorded too.
fn recorded(plan: &ReportPlan, step: Step<'_>) -> Result<(Recorded, bool), StudyError> {
    if let Some(table) = Recorded::read(&plan.table1)? {
        return Ok((table, false));
    }
    let (mut done, all) = (0, plan.missing_table1.n_steps());
    let table = Table1::run(&plan.missing_table1, &mut |_| {
        step("Table 1", done, all);
        done += 1;
    })?;
    table.write(&plan.table1)?;
    let read = Recorded::read(&plan.table1)?;
    read.map(|table| (table, true)).ok_or_else(|| StudyError::Read {
        path: plan.table1.join("table1.json"),
        source: "it was written just now, and is gone".into(),
    })
}

/// The lines of the table, by number of spheres.
fn groups(
    table: &Recorded,
    others: &[(&str, Vec<OtherRow>)],
    scenes: &OtherScenes,
) -> Vec<(u32, Vec<Entry>)> {
    let spheres = table.ours.iter().filter_map(|row| Some((row.spheres?, row)));
    spheres
        .enumerate()
        .map(|(i, (n, row))| {
            let mut entries = Vec::new();
            if let Some(paper) = table.paper.iter().find(|paper| paper.spheres == n) {
                entries.extend(of_paper(paper));
            }
            entries.extend(of_readings(row));
            for preset in &table.presets {
                if let Some(row) = preset.rows.iter().find(|row| row.spheres == Some(n))
                    && let (Some(standard), Some(measured)) =
                        (row.strategies.get("standard"), row.strategies.get(&preset.name))
                {
                    entries.push(of_ours(&preset.name, row, standard, measured));
                }
            }
            entries.extend(of_exact(row));
            for (name, rows) in others.iter().filter(|(name, _)| *name != "standard") {
                entries.extend(rows.get(i).map(|measured| of_others(name, scenes, measured)));
            }
            for (style, entry) in entries.iter_mut().enumerate() {
                entry.style = style;
            }
            (n, entries)
        })
        .collect()
}

/// The readings of a row.
fn of_readings(row: &RecordedRow) -> Vec<Entry> {
    let Some(standard) = row.strategies.get("standard") else { return Vec::new() };
    let readings = row.strategies.iter().filter(|(name, _)| *name != "standard");
    readings.map(|(name, measured)| of_ours(name, row, standard, measured)).collect()
}

/// The exact strategies of a row, which took their turns with the readings.
fn of_exact(row: &RecordedRow) -> Vec<Entry> {
    let Some(standard) = row.strategies.get("standard") else { return Vec::new() };
    let entry = |(name, measured): (&String, &RecordedExact)| Entry {
        source: name.clone(),
        style: 0,
        times: [standard.seconds, measured.seconds].map(milliseconds),
        percent: measured
            .percent_coherent
            .zip(measured.percent_coherent_spread)
            .map(|(percent, spread)| pooled(percent, spread)),
        ratio: Some(measured.ratio_time),
        work: Some(measured.ratio_work),
        wrong: Some((measured.wrong_pixels, row.pixels())),
    };
    row.exact.iter().map(entry).collect()
}

fn exactly(value: f64) -> Spread {
    Spread::of(&[value])
}

/// A value of all seeds together in the place of their median.
fn pooled(value: f64, spread: Spread) -> Spread {
    Spread { median: value, ..spread }
}

fn of_paper(paper: &PaperRow) -> [Entry; 2] {
    let hours = [paper.hours_standard, paper.hours_coherent].map(|hours| format!("{hours} h"));
    let entry = |source: &str, times: [String; 2], percent, ratio| Entry {
        source: source.to_owned(),
        style: 0,
        times,
        percent,
        ratio: Some(exactly(ratio)),
        work: None,
        wrong: None,
    };
    [
        entry("paper, as printed", hours, Some(exactly(paper.percent_coherent)), paper.ratio_printed),
        entry("paper, from its own times", [String::new(), String::new()], None, paper.ratio_recomputed),
    ]
}

fn of_ours(name: &str, row: &RecordedRow, standard: &RecordedStrategy, measured: &RecordedStrategy) -> Entry {
    Entry {
        source: name.to_owned(),
        style: 0,
        times: [standard, measured].map(|measured| milliseconds(measured.seconds)),
        percent: Some(pooled(measured.percent_coherent, measured.percent_coherent_spread)),
        ratio: Some(measured.ratio_time_spread),
        work: Some(measured.ratio_work),
        wrong: Some((measured.wrong_pixels, row.pixels())),
    }
}

fn of_others(name: &str, scenes: &OtherScenes, measured: &OtherRow) -> Entry {
    let side = u64::from(scenes.resolution);
    Entry {
        source: name.to_owned(),
        style: 0,
        times: [measured.seconds_standard, measured.seconds].map(milliseconds),
        percent: Some(pooled(measured.percent_coherent, measured.percent_coherent_spread)),
        ratio: Some(measured.ratio_time),
        work: Some(measured.ratio_work),
        wrong: Some((measured.wrong_pixels, side * side * scenes.seeds.len() as u64)),
    }
}

fn milliseconds(seconds: f64) -> String {
    format!("{:.1} ms", 1e3 * seconds)
}

/// A value with its quartiles, where they are apart.
fn spread(value: Option<&Spread>, digits: usize) -> Markup {
    html! {
        @if let Some(spread) = value {
            span.value { (format!("{:.digits$}", spread.median)) }
            @if spread.lower_quartile < spread.upper_quartile {
                " " small { (format!("({:.digits$} to {:.digits$})", spread.lower_quartile, spread.upper_quartile)) }
            }
        }
    }
}

fn as_table(id: &str, head: &str, groups: &[(impl Render, Vec<Entry>)], caption: &str) -> Markup {
    html! {
        div.scroll role="region" aria-labelledby=(id) tabindex="0" {
            table {
                caption id=(id) { (caption) }
                thead {
                    tr {
                        th scope="col" { (head) }
                        th.text scope="col" { "source" }
                        th scope="col" { "coherent rays, %" }
                        th scope="col" { "ratio of times" }
                        th scope="col" { "ratio of work" }
                        th scope="col" { "wrong pixels" }
                        th scope="col" { "time, " code { "standard" } }
                        th scope="col" { "time, strategy" }
                    }
                }
                @for (group, entries) in groups {
                    tbody {
                        @for (i, entry) in entries.iter().enumerate() {
                            tr.of-paper[entry.source.starts_with("paper")] {
                                @if i == 0 { th.n scope="rowgroup" rowspan=(entries.len()) { (group) } }
                                th.source scope="row" { (entry.source) }
                                td { (spread(entry.percent.as_ref(), 1)) }
                                td { (spread(entry.ratio.as_ref(), 3)) }
                                td { @if let Some(work) = entry.work { (format!("{work:.3}")) } }
                                td { @if let Some((wrong, of)) = entry.wrong { (wrong) " " small { "of " (of) } } }
                                @for time in &entry.times { td { (time) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The table as curves: times, work and coherence.
fn figures(groups: &[(u32, Vec<Entry>)]) -> Result<Markup, StudyError> {
    let curves = |value: &dyn Fn(&Entry) -> Option<Spread>| -> Vec<Curve> {
        let sources = groups.iter().map(|(_, entries)| entries).max_by_key(|entries| entries.len());
        let curve = |source: &Entry| {
            let points = groups.iter().filter_map(|(n, entries)| {
                let spread = value(entries.iter().find(|entry| entry.source == source.source)?)?;
                let quartiles = (spread.lower_quartile < spread.upper_quartile)
                    .then_some((spread.lower_quartile, spread.upper_quartile));
                Some(Point { n: *n, value: spread.median, quartiles })
            });
            Curve { name: source.source.clone(), style: source.style, points: points.collect() }
        };
        sources.into_iter().flatten().map(curve).filter(|curve| !curve.points.is_empty()).collect()
    };
    let times = curves(&|entry| entry.ratio);
    let percents = curves(&|entry| entry.percent);
    let work = curves(&|entry| entry.work.map(exactly));
    let figure =
        |title: &str, upwards, top, grid, reference, curves: &[Curve]| -> Result<Markup, StudyError> {
            let label = format!("{title} over the number of spheres; the numbers are in the table above.");
            let svg = Lines { label, upwards, top, grid, reference, curves }.svg()?;
            Ok(html! { figure { (PreEscaped(svg)) figcaption { (title) } } })
        };
    Ok(html! {
        div.panels {
            (figure("Ratio of times", "time over standard", 1.0, 0.25, Some(1.0), &times)?)
            (figure("Ratio of work", "work over standard", 1.0, 0.25, Some(1.0), &work)?)
            (figure("Coherent rays", "percent of rays cast", 100.0, 20.0, None, &percents)?)
        }
    })
}

fn provenance(
    plan: &ReportPlan,
    table: &Recorded,
    scenes: &OtherScenes,
    others: &[(&str, Vec<OtherRow>)],
) -> Markup {
    let options = &table.options;
    let mut entries = vec![
        ("command", "cargo xtask repro-table1".to_owned()),
        ("scenes", spheres()),
        (
            "image",
            format!(
                "{0} x {0} pixels, one sweep in scanline order, or in the one that an exact strategy prefers",
                options.resolution
            ),
        ),
        ("seeds", numbers(&options.seeds)),
        ("repetitions", format!("{}, the strategies in turn", options.repetitions)),
        ("depth", options.max_depth.to_string()),
        ("cut-off", cutoff(options.cutoff)),
        ("lanes", options.backend.clone()),
    ];
    if let Some(readings) = options.others.get("readings").and_then(serde_json::Value::as_object) {
        let choices = |choices: &serde_json::Value| {
            let each = choices.as_object().into_iter().flatten();
            each.map(|(option, choice)| format!("{option} = {}", choice.as_str().unwrap_or_default()))
                .collect::<Vec<_>>()
                .join(", ")
        };
        for (name, options) in readings {
            entries.push(("reading", format!("{name}: {}", choices(options))));
        }
    }
    let names: Vec<_> = others.iter().map(|(name, _)| *name).filter(|name| *name != "standard").collect();
    if !names.is_empty() {
        entries.push((
            "also",
            format!(
                "{}: by {}, on the same scenes with seeds {}, {} repetitions in turn with standard",
                names.join(", "),
                plan.command,
                numbers(&scenes.seeds),
                scenes.repetitions
            ),
        ));
    }
    entries.push(("version", options.version.clone()));
    made(&entries)
}

/// The scenes in words.
fn spheres() -> String {
    let RandomSpheres { size, separate, reflectance, transmittance, .. } = RandomSpheres::default();
    let size = match size {
        SphereSize::Between(least, greatest) => format!("radii {least} to {greatest}"),
        SphereSize::Coverage(fraction) => format!("covering {fraction} of the view"),
    };
    let separate = if separate { "separate, " } else { "" };
    format!(
        "random spheres, {size}, {separate}reflectance {reflectance}, each fourth of glass with transmittance {transmittance}"
    )
}
