//! Ratio and coherence over the number of spheres, for the paper and for ours.

use plotters::prelude::*;

use super::Column;
use super::results::{StrategyRow, Table1};
use crate::Spread;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Okabe and Ito's colours, which colour-blind readers tell apart.
const ORANGE: RGBColor = RGBColor(230, 159, 0);
const VERMILION: RGBColor = RGBColor(213, 94, 0);
/// Of the columns in turn: times and coherence, and work.
const OURS: [(RGBColor, RGBColor); 3] = [
    (RGBColor(0, 158, 115), RGBColor(86, 180, 233)),
    (RGBColor(204, 121, 167), RGBColor(0, 114, 178)),
    (RGBColor(0, 0, 0), RGBColor(150, 140, 0)),
];
const SIZE: (u32, u32) = (900, 520);

/// A line of the plot: label, colour, points, and the quartiles of each point if it has any.
struct Curve {
    label: String,
    color: RGBColor,
    points: Vec<(f64, f64)>,
    quartiles: Vec<(f64, f64)>,
}

/// A figure of a row and its spread over runs, if it has them.
type Value<'f> = &'f dyn Fn(&StrategyRow) -> Option<(f64, Option<Spread>)>;

impl Curve {
    fn of(column: Column<'_>, label: String, color: RGBColor, value: Value<'_>) -> Self {
        let (mut points, mut quartiles) = (Vec::new(), Vec::new());
        for (row, measured) in column.spheres() {
            if let Some((y, spread)) = value(measured) {
                points.push((f64::from(row.spheres.unwrap_or_default()), y));
                quartiles.extend(spread.map(|spread| (spread.lower_quartile, spread.upper_quartile)));
            }
        }
        Self { label, color, points, quartiles }
    }
}

/// The plot as an SVG document.
pub(super) fn svg(table: &Table1) -> Result<String, Failure> {
    let of_paper = |label: &str, color, value: &dyn Fn(&crate::PaperRow) -> f64| {
        let points = table.paper.iter().map(|row| (f64::from(row.spheres), value(row))).collect();
        Curve { label: label.to_owned(), color, points, quartiles: Vec::new() }
    };
    let mut ratios = vec![
        of_paper("paper, printed", ORANGE, &|row| row.ratio_printed),
        of_paper("paper, from its times", VERMILION, &|row| row.ratio_recomputed),
    ];
    let mut coherence = vec![of_paper("paper", ORANGE, &|row| row.percent_coherent)];
    for (column, (color, other)) in table.columns().into_iter().zip(OURS.into_iter().cycle()) {
        let name = column.name;
        let of_ours = |label: String, color, value: Value| Curve::of(column, label, color, value);
        ratios.push(of_ours(format!("{name}, times"), color, &|row| {
            Some((row.ratio_time, Some(row.ratio_time_spread)))
        }));
        if column.preset.is_some() {
            let fitted = |row: &StrategyRow| row.fitted.map(|fitted| (fitted.ratio, Some(fitted.spread)));
            ratios.push(of_ours(format!("{name}, fitted cost"), other, &fitted));
        } else {
            ratios.push(of_ours(format!("{name}, work"), other, &|row| Some((row.ratio_work, None))));
        }
        let percent = |row: &StrategyRow| Some((row.percent_coherent, Some(row.percent_coherent_spread)));
        coherence.push(of_ours(name.to_owned(), color, &percent));
    }
    let mut document = String::new();
    {
        let area = SVGBackend::with_string(&mut document, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let (left, right) = area.split_horizontally(SIZE.0 / 2);
        panel(
            &left,
            "time or work of speer-1985 over standard",
            &ratios,
            Some(1.0),
            SeriesLabelPosition::UpperRight,
        )?;
        panel(
            &right,
            "coherent rays, percent of rays cast",
            &coherence,
            None,
            SeriesLabelPosition::LowerRight,
        )?;
        area.present()?;
    }
    Ok(document)
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    title: &str,
    curves: &[Curve],
    reference: Option<f64>,
    legend: SeriesLabelPosition,
) -> Result<(), Failure> {
    let values = curves.iter().flat_map(|curve| {
        let ends = curve.quartiles.iter().flat_map(|&(low, high)| [low, high]);
        curve.points.iter().map(|point| point.1).chain(ends)
    });
    // Ratios fall with n: above the right ends of their curves there is room for the legend.
    let room = if reference.is_some() { 1.45 } else { 1.08 };
    let top = values.fold(reference.unwrap_or(100.0), f64::max) * room;
    let xs = || curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.0));
    let (least, greatest) = (xs().fold(1.0, f64::min), xs().fold(2.0, f64::max));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 15))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(44)
        .build_cartesian_2d((least * 0.9..greatest * 1.1).log_scale().base(2.0), 0.0..top)?;
    chart
        .configure_mesh()
        .x_desc("spheres")
        .x_labels(4)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| if top > 10.0 { format!("{y:.0}") } else { format!("{y:.1}") })
        .light_line_style(WHITE)
        .draw()?;
    if let Some(reference) = reference {
        let ends = [(least * 0.9, reference), (greatest * 1.1, reference)];
        chart.draw_series(LineSeries::new(ends, BLACK.stroke_width(1)))?;
    }
    for (i, curve) in curves.iter().enumerate() {
        let color = curve.color;
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), color.stroke_width(2)))?
            .label(&curve.label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        // Shapes differ too, for readers without colours.
        let points = curve.points.iter().copied();
        match i % 4 {
            0 => drop(chart.draw_series(points.map(|point| Circle::new(point, 4, color.filled())))?),
            1 => drop(chart.draw_series(points.map(|point| TriangleMarker::new(point, 6, color.filled())))?),
            2 => drop(chart.draw_series(points.map(|point| Cross::new(point, 5, color.stroke_width(2))))?),
            _ => drop(chart.draw_series(points.map(|point| Circle::new(point, 4, color.stroke_width(2))))?),
        }
        let bars = curve.points.iter().zip(&curve.quartiles);
        chart.draw_series(
            bars.map(|(&(x, _), &(low, high))| {
                PathElement::new([(x, low), (x, high)], color.stroke_width(1))
            }),
        )?;
    }
    chart
        .configure_series_labels()
        .position(legend)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    Ok(())
}
