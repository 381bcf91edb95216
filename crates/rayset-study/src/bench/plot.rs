//! Time a ray of whole frames, over the number of spheres and for the other scenes.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::versus::OURS;
use super::{Bench, BenchRow};
use crate::StudyError;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Okabe and Ito's colours, which colour-blind readers tell apart; the lightest is left out.
const COLORS: [[u8; 3]; 7] =
    [[0, 0, 0], [230, 159, 0], [0, 158, 115], [0, 114, 178], [213, 94, 0], [204, 121, 167], [86, 180, 233]];
const SIZE: (u32, u32) = (1100, 560);

/// The nanoseconds a ray of one contender, by place on the axis.
struct Curve {
    name: String,
    /// Of the line and of the points: ours are broad and full, those of other libraries thin and hollow.
    styles: [ShapeStyle; 2],
    /// x, and the median with its quartiles.
    points: Vec<(f64, [f64; 3])>,
}

impl Bench {
    /// The plot as an SVG document: frames of the first view of every scene.
    ///
    /// # Errors
    ///
    /// [`StudyError::Draw`] if it cannot be drawn.
    pub fn svg(&self) -> Result<String, StudyError> {
        self.draw().map_err(|source| StudyError::Draw { figure: "the bench".to_owned(), source })
    }

    fn draw(&self) -> Result<String, Failure> {
        let view = self.rows.first().map(|row| row.view.as_str()).unwrap_or_default();
        let rows: Vec<_> = self.rows.iter().filter(|row| row.view == view).collect();
        let (spheres, others): (Vec<&BenchRow>, Vec<&BenchRow>) =
            rows.into_iter().partition(|row| row.spheres.is_some());
        let sources = self.sources();
        let by_number = |row: &BenchRow, _: usize| f64::from(row.spheres.unwrap_or_default());
        #[expect(clippy::cast_precision_loss, reason = "few scenes")]
        let by_place = |_: &BenchRow, place: usize| place as f64;
        let mut document = String::new();
        {
            let area = SVGBackend::with_string(&mut document, SIZE).into_drawing_area();
            area.fill(&WHITE)?;
            let (left, right) = area.split_horizontally(SIZE.0 * 11 / 20);
            if !spheres.is_empty() {
                let curves = curves(&sources, &spheres, &by_number);
                let greatest = spheres.iter().map(|row| by_number(row, 0)).fold(2.0, f64::max);
                let mut chart = chart(&left, &format!("random spheres, {view}")).build_cartesian_2d(
                    (0.7..greatest * 1.4).log_scale().base(2.0),
                    range(&curves).log_scale(),
                )?;
                chart
                    .configure_mesh()
                    .x_desc("spheres")
                    .y_desc("nanoseconds a ray")
                    .x_label_formatter(&|x| format!("{x:.0}"))
                    .y_label_formatter(&|y| format!("{y:.0}"))
                    .light_line_style(WHITE)
                    .draw()?;
                for curve in &curves {
                    let [stroke, marker] = curve.styles;
                    let line = curve.points.iter().map(|&(x, [_, median, _])| (x, median));
                    chart
                        .draw_series(LineSeries::new(line.clone(), stroke))?
                        .label(curve.name.as_str())
                        .legend(move |(x, y)| {
                            EmptyElement::at((x, y))
                                + PathElement::new([(0, 0), (18, 0)], stroke)
                                + Circle::new((9, 0), 3, marker)
                        });
                    chart.draw_series(line.map(|point| Circle::new(point, 3, marker)))?;
                    chart.draw_series(curve.points.iter().map(|&(x, [low, _, high])| {
                        PathElement::new([(x, low), (x, high)], stroke.stroke_width(1))
                    }))?;
                }
                legend(&mut chart)?;
            }
            if !others.is_empty() {
                let curves = curves(&sources, &others, &by_place);
                let end = by_place(others[0], others.len()) - 0.5;
                let mut chart = chart(&right, &format!("other scenes, {view}"))
                    .build_cartesian_2d(-0.5..end, range(&curves).log_scale())?;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "the place of a scene"
                )]
                let scene = |x: &f64| {
                    let is_place = *x > -0.5 && (x - x.round()).abs() < 0.01;
                    let row = others.get(x.round().max(0.0) as usize).filter(|_| is_place);
                    row.map_or_else(String::new, |row| row.scene.clone())
                };
                chart
                    .configure_mesh()
                    .x_labels(2 * others.len() + 1)
                    .x_label_formatter(&scene)
                    .y_label_formatter(&|y| format!("{y:.0}"))
                    .light_line_style(WHITE)
                    .draw()?;
                for curve in &curves {
                    let marker = curve.styles[1];
                    let points = curve.points.iter().map(|&(x, [_, median, _])| (x, median));
                    chart
                        .draw_series(points.map(|point| Circle::new(point, 4, marker)))?
                        .label(curve.name.as_str())
                        .legend(move |(x, y)| Circle::new((x + 9, y), 4, marker));
                }
                // The colours are those of the other chart, if there is one.
                if spheres.is_empty() {
                    legend(&mut chart)?;
                }
            }
            area.present()?;
        }
        Ok(document)
    }
}

/// Whose times a curve shows.
#[derive(Clone, Copy, Debug)]
enum Source<'b> {
    /// A contender's.
    One(&'b str),
    /// Those of a library's fastest mode for each list, which have no spread.
    Best(&'b str),
}

impl Source<'_> {
    fn name(&self) -> String {
        match self {
            Self::One(name) => (*name).to_owned(),
            Self::Best(family) => format!("{family}: best mode"),
        }
    }

    /// Milliseconds of a frame: lower quartile, median, upper quartile.
    fn frame(&self, row: &BenchRow) -> Option<[f64; 3]> {
        match self {
            Self::One(name) => {
                let frame = row.contender(name)?.frame;
                Some([frame.lower_quartile, frame.median, frame.upper_quartile])
            }
            Self::Best(family) => row.frame(|pass| row.best(family, pass)).map(|best| [best; 3]),
        }
    }
}

impl Bench {
    /// Every contender of ours, and of others each library.
    fn sources(&self) -> Vec<Source<'_>> {
        let (mut ours, mut families): (Vec<&str>, Vec<&str>) = Default::default();
        for contender in self.rows.iter().flat_map(|row| &row.contenders) {
            let (list, name) = match contender.family.as_str() {
                OURS => (&mut ours, contender.name.as_str()),
                family => (&mut families, family),
            };
            if !list.contains(&name) {
                list.push(name);
            }
        }
        ours.into_iter().map(Source::One).chain(families.into_iter().map(Source::Best)).collect()
    }
}

/// The curves that have points, in the order of the sources.
#[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
fn curves(sources: &[Source<'_>], rows: &[&BenchRow], place: &dyn Fn(&BenchRow, usize) -> f64) -> Vec<Curve> {
    let n_ours = sources.iter().filter(|source| matches!(source, Source::One(_))).count();
    let curve = |(number, source): (usize, &Source<'_>)| {
        let points = rows.iter().enumerate().filter_map(|(i, row)| {
            let times = source.frame(row)?;
            Some((place(row, i), times.map(|time| time * 1e6 / row.rays() as f64)))
        });
        let styles = match source {
            Source::One(_) => [color(number).stroke_width(2), color(number).filled()],
            Source::Best(_) => [color(number - n_ours).stroke_width(1); 2],
        };
        Curve { name: source.name(), styles, points: points.collect() }
    };
    sources.iter().enumerate().map(curve).collect()
}

/// From the least to the greatest time, with some room.
fn range(curves: &[Curve]) -> std::ops::Range<f64> {
    let times = || curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1[1]));
    times().fold(1e9, f64::min).min(10.0) * 0.8..times().fold(0.0, f64::max).max(20.0) * 1.5
}

fn color(number: usize) -> RGBColor {
    let [red, green, blue] = COLORS[number % COLORS.len()];
    RGBColor(red, green, blue)
}

fn chart<'a, 'b>(
    area: &'a DrawingArea<SVGBackend<'b>, Shift>,
    title: &str,
) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut builder = ChartBuilder::on(area);
    builder.caption(title, ("sans-serif", 15)).margin(12).x_label_area_size(36).y_label_area_size(54);
    builder
}

fn legend<'a, 'b: 'a, X, Y>(
    chart: &mut ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, Y>>,
) -> Result<(), Failure>
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    Ok(())
}
