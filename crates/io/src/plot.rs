//! Plots of radial profiles, as SVG or PNG: curves of models, measured points with error bars, ratios, a table.
//!
//! PNG pictures use the embedded DejaVu font; SVG names it first and falls back to any sans-serif. The same data give the same bytes.

pub mod journeys;
pub mod radiance;

use std::ops::Range;
use std::sync::Once;

use image::{ExtendedColorType, ImageEncoder};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A model's curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// What the table says of it, one text per column.
    pub facts: Vec<String>,
    /// (r, R) in the order of r.
    pub points: Vec<(f64, f64)>,
    /// (r, model over measurement) at the measured radii.
    pub ratios: Vec<(f64, f64)>,
}

/// A measured value with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Radius.
    pub r: f64,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub std_err: f64,
}

/// All that a plot of profiles shows.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfilePlot {
    /// Headline.
    pub title: String,
    /// Line below it.
    pub subtitle: String,
    /// Unit of lengths.
    pub unit: String,
    /// Labels of the vertical axes: of the value, and of the value times a power of r.
    pub labels: [String; 2],
    /// That power.
    pub power: i32,
    /// Heads of the table's columns behind the name.
    pub columns: Vec<String>,
    /// Facts of the measurement, for the first line of the table.
    pub facts: Vec<String>,
    /// The measurement.
    pub measured: Vec<Point>,
    /// The models.
    pub curves: Vec<Curve>,
}

/// Why a plot could not be drawn.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the plot could not be drawn: {0}")]
pub struct PlotError(pub(crate) String);

/// Size in pixels.
const SIZE: (u32, u32) = (1400, 1000);
/// Family of all text.
pub(crate) const FONT: &str = "DejaVu Sans";
/// Ratios shown lie between this and its inverse.
const RATIO: f64 = 2.0;
/// Decades of R below its largest value that are shown.
const DECADES: f64 = 7.0;
const INK: RGBColor = RGBColor(40, 40, 46);
const GRID: RGBColor = RGBColor(226, 226, 232);
/// Colours that people with any colour vision tell apart \[Okabe2008\], without yellow.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 94, 60),
];

/// Returns the plot as SVG.
///
/// *Errors*: nothing to show.
pub fn svg(plot: &ProfilePlot) -> Result<String, PlotError> {
    svg_of(|root| draw(&root, plot))
}

/// Returns what is drawn as SVG.
fn svg_of(
    draw: impl for<'a> FnOnce(DrawingArea<SVGBackend<'a>, Shift>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    register_font();
    let mut text = String::new();
    draw(SVGBackend::with_string(&mut text, SIZE).into_drawing_area())?;
    Ok(text.replace("font-family=\"DejaVu Sans\"", "font-family=\"DejaVu Sans, Verdana, sans-serif\""))
}

/// Returns the plot as PNG.
///
/// *Errors*: nothing to show.
pub fn png(plot: &ProfilePlot) -> Result<Vec<u8>, PlotError> {
    register_font();
    let mut pixels = vec![0u8; (SIZE.0 * SIZE.1 * 3) as usize];
    draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), plot)?;
    encode_png(&pixels, SIZE)
}

/// Returns pixels as a PNG file.
pub(crate) fn encode_png(pixels: &[u8], size: (u32, u32)) -> Result<Vec<u8>, PlotError> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(pixels, size.0, size.1, ExtendedColorType::Rgb8)
        .map_err(|e| PlotError(e.to_string()))?;
    Ok(bytes)
}

pub(crate) fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for (style, bytes) in [(FontStyle::Normal, dejavu::sans::regular()), (FontStyle::Bold, dejavu::sans::bold())] {
            plotters::style::register_font(FONT, style, bytes).ok().expect("the embedded font is a font");
        }
    });
}

/// A logarithmic axis with key points at powers of ten.
#[derive(Clone)]
struct Decades(Range<f64>);

impl Ranged for Decades {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let t = (value / self.0.start).ln() / (self.0.end / self.0.start).ln();
        // Far outside of the picture is as good as just outside; plotters cuts at the frame.
        limit.0 + (t.clamp(-4.0, 5.0) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        let (a, b) = (self.0.start.log10(), self.0.end.log10());
        let powers: Vec<f64> = (a.ceil() as i32..=b.floor() as i32).map(|k| 10f64.powi(k)).collect();
        let every = powers.len().div_ceil(hint.max_num_points().clamp(1, 8)).max(1);
        powers.into_iter().step_by(every).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for Decades {
    fn format_ext(&self, value: &f64) -> String {
        power_of_ten(*value)
    }
}

/// Writes a power of ten as people do: .01 to 100 plainly, others with an exponent.
fn power_of_ten(x: f64) -> String {
    let k = x.log10().round() as i32;
    match k {
        -2..=2 => format!("{x}"),
        _ => {
            let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
            let exponent: String =
                k.unsigned_abs().to_string().bytes().map(|b| digits[usize::from(b - b'0')]).collect();
            format!("10{}{exponent}", if k < 0 { "⁻" } else { "" })
        }
    }
}

fn fail<E: std::fmt::Display>(e: E) -> PlotError {
    PlotError(e.to_string())
}

fn text(size: i32) -> TextStyle<'static> {
    TextStyle::from((FONT, size).into_font()).color(&INK)
}

fn bold(size: i32) -> TextStyle<'static> {
    TextStyle::from((FONT, size, FontStyle::Bold).into_font()).color(&INK)
}

fn draw<B: DrawingBackend>(root: &DrawingArea<B, Shift>, plot: &ProfilePlot) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    root.fill(&WHITE).map_err(fail)?;
    root.draw(&Text::new(plot.title.clone(), (36, 22), bold(30))).map_err(fail)?;
    root.draw(&Text::new(plot.subtitle.clone(), (36, 62), text(18))).map_err(fail)?;
    let (_, body) = root.split_vertically(92);
    let (top, bottom) = body.split_vertically(560);
    let (profile, energy) = top.split_horizontally(SIZE.0 as i32 / 2);
    let (ratio, table) = bottom.split_horizontally(SIZE.0 as i32 / 2);

    // Show where there is light to see.
    let seen: Vec<&Point> = plot.measured.iter().filter(|p| p.value > 0.0).collect();
    let (Some(first), Some(last)) = (seen.first(), seen.last()) else {
        return Err(PlotError("nothing was measured".into()));
    };
    let radii = first.r / 1.15..last.r * 1.15;
    let largest = seen.iter().map(|p| p.value).fold(0.0, f64::max);
    let least = seen.iter().map(|p| p.value).fold(f64::MAX, f64::min).max(largest * 10f64.powf(-DECADES));

    panel(&profile, plot, &radii, Decades(least / 2.0..largest * 2.0), &plot.labels[0], |p| Some(p.1))?;
    let weigh = |r: f64, v: f64| r.powi(plot.power) * v;
    let most = seen.iter().map(|p| weigh(p.r, p.value)).fold(0.0, f64::max) * 1.3;
    let energy_axis = Linear(0.0..most);
    panel(&energy, plot, &radii, energy_axis, &plot.labels[1], |p| Some(weigh(p.0, p.1)))?;
    ratios(&ratio, plot, &radii)?;
    facts(&table, plot)?;
    root.present().map_err(fail)
}

/// A linear axis with short numbers.
#[derive(Clone)]
struct Linear(Range<f64>);

impl Ranged for Linear {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let t = (value - self.0.start) / (self.0.end - self.0.start);
        limit.0 + (t.clamp(-4.0, 5.0) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, _hint: H) -> Vec<f64> {
        let step = step_of(self.0.end - self.0.start);
        let (a, b) = ((self.0.start / step).ceil() as i64, (self.0.end / step).floor() as i64);
        (a..=b).map(|k| k as f64 * step).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for Linear {
    fn format_ext(&self, value: &f64) -> String {
        let digits = (-step_of(self.0.end - self.0.start).log10().floor()).max(0.0) as usize;
        format!("{value:.digits$}")
    }
}

/// Returns 1, 2 or 5 times a power of ten such that about five steps make the width.
fn step_of(width: f64) -> f64 {
    let raw = width / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw).unwrap_or(power)
}

/// Draws the curves and the measurement under a transformation of (r, R).
fn panel<B: DrawingBackend, Y>(
    area: &DrawingArea<B, Shift>,
    plot: &ProfilePlot,
    radii: &Range<f64>,
    y: Y,
    label: &str,
    map: impl Fn((f64, f64)) -> Option<f64>,
) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64> + Clone,
{
    let shown = y.range();
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .x_label_area_size(52)
        .y_label_area_size(86)
        .build_cartesian_2d(Decades(radii.clone()), y)
        .map_err(fail)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(16))
        .axis_desc_style(text(18))
        .x_desc(format!("r  [{}]", plot.unit))
        .y_desc(label)
        .draw()
        .map_err(fail)?;
    for (i, curve) in plot.curves.iter().enumerate() {
        // Break the curve where it leaves the panel, so that no line runs along its frame.
        let mut piece = Vec::new();
        let mut pieces = Vec::new();
        for &(r, value) in &curve.points {
            match map((r, value)) {
                Some(v) if radii.contains(&r) && shown.contains(&v) => piece.push((r, v)),
                _ => pieces.push(std::mem::take(&mut piece)),
            }
        }
        pieces.push(piece);
        for p in pieces.into_iter().filter(|p| p.len() > 1) {
            chart.draw_series(LineSeries::new(p, style(i))).map_err(fail)?;
        }
    }
    let bars = plot.measured.iter().filter(|p| p.value > 0.0).filter_map(|p| {
        let at = |v: f64| map((p.r, v)).filter(|v| shown.contains(v));
        Some((p.r, at(p.value)?, at(p.value - p.std_err).unwrap_or(shown.start), at(p.value + p.std_err)?))
    });
    for (r, v, low, high) in bars {
        chart.draw_series([PathElement::new(vec![(r, low), (r, high)], INK.stroke_width(2))]).map_err(fail)?;
        chart.draw_series([Circle::new((r, v), 3, INK.filled())]).map_err(fail)?;
    }
    Ok(())
}

fn style(i: usize) -> ShapeStyle {
    COLORS[i % COLORS.len()].stroke_width(if i < COLORS.len() { 3 } else { 1 })
}

/// Draws models over the measurement, with the measurement's own error as a band.
fn ratios<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    plot: &ProfilePlot,
    radii: &Range<f64>,
) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    let y = Decades(1.0 / RATIO..RATIO);
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .x_label_area_size(52)
        .y_label_area_size(86)
        .build_cartesian_2d(Decades(radii.clone()), y)
        .map_err(fail)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(16))
        .axis_desc_style(text(18))
        .x_desc(format!("r  [{}]", plot.unit))
        .y_desc("model / Monte Carlo")
        .y_labels(1)
        .draw()
        .map_err(fail)?;
    // Guide lines with their numbers inside the panel: this axis has one power of ten alone.
    for v in [0.6, 0.8, 1.0, 1.25, 1.6] {
        let line = if v == 1.0 { INK.stroke_width(1) } else { GRID.stroke_width(1) };
        chart.draw_series([PathElement::new(vec![(radii.start, v), (radii.end, v)], line)]).map_err(fail)?;
        if v != 1.0 {
            let anchor = text(13).pos(Pos::new(HPos::Right, VPos::Center));
            chart.draw_series([Text::new(format!("{v} "), (radii.end, v), anchor)]).map_err(fail)?;
        }
    }
    let error: Vec<(f64, f64)> =
        plot.measured.iter().filter(|p| p.value > 0.0).map(|p| (p.r, (p.std_err / p.value).min(0.49))).collect();
    let band: Vec<(f64, f64)> =
        error.iter().map(|(r, e)| (*r, 1.0 + e)).chain(error.iter().rev().map(|(r, e)| (*r, 1.0 - e))).collect();
    chart.draw_series([Polygon::new(band, INK.mix(0.18))]).map_err(fail)?;
    for (i, curve) in plot.curves.iter().enumerate() {
        let mut piece = Vec::new();
        let mut pieces = Vec::new();
        for &(r, q) in &curve.ratios {
            if (1.0 / RATIO..RATIO).contains(&q) {
                piece.push((r, q));
            } else {
                pieces.push(std::mem::take(&mut piece));
            }
        }
        pieces.push(piece);
        for p in pieces.into_iter().filter(|p| p.len() > 1) {
            chart.draw_series(LineSeries::new(p, style(i))).map_err(fail)?;
        }
    }
    Ok(())
}

/// Draws the legend, which is a table.
fn facts<B: DrawingBackend>(area: &DrawingArea<B, Shift>, plot: &ProfilePlot) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    const LEFT: i32 = 96;
    const COLUMN: i32 = 122;
    let lines = plot.curves.len() as i32 + 2;
    let height = (290 / lines).clamp(13, 26);
    let size = (height * 2 / 3).clamp(10, 17);
    let right = |k: usize| LEFT + 290 + COLUMN * k as i32;
    let y = |line: i32| 24 + line * height;
    let write = |s: &str, at: (i32, i32), style: TextStyle<'static>| {
        area.draw(&Text::new(s.to_owned(), at, style)).map_err(fail)
    };
    let end = |style: TextStyle<'static>| style.pos(Pos::new(HPos::Right, VPos::Top));
    for (k, head) in plot.columns.iter().enumerate() {
        write(head, (right(k), y(0)), end(bold(size)))?;
    }
    area.draw(&Circle::new((LEFT - 22, y(1) + size / 2), 4, INK.filled())).map_err(fail)?;
    write("Monte Carlo", (LEFT, y(1)), bold(size))?;
    for (k, fact) in plot.facts.iter().enumerate() {
        write(fact, (right(k), y(1)), end(bold(size)))?;
    }
    for (i, curve) in plot.curves.iter().enumerate() {
        let line = y(i as i32 + 2);
        let middle = line + size / 2;
        area.draw(&PathElement::new(vec![(LEFT - 38, middle), (LEFT - 8, middle)], style(i))).map_err(fail)?;
        write(&curve.name, (LEFT, line), text(size))?;
        for (k, fact) in curve.facts.iter().enumerate() {
            write(fact, (right(k), line), end(text(size)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_on_axes_are_short() {
        assert_eq!(
            [1e-3, 0.01, 1.0, 100.0, 1e4].map(power_of_ten),
            ["10⁻³", "0.01", "1", "100", "10⁴"].map(String::from)
        );
        assert_eq!([1.0, 3.0, 0.07].map(step_of), [0.2, 1.0, 0.02]);
    }

    #[test]
    fn plots_show_every_curve_and_are_the_same_each_time() {
        let measured =
            (0..20).map(|i| f64::from(i + 1) * 0.1).map(|r| Point { r, value: (-r).exp() / r, std_err: 0.01 / r });
        let curve = |name: &str, f: f64| {
            let points: Vec<(f64, f64)> =
                (1..200).map(|i| f64::from(i) * 0.01).map(|r| (r, f * (-r).exp() / r)).collect();
            let ratios = points.iter().map(|p| (p.0, f)).collect();
            Curve { name: name.into(), facts: vec!["0.5".into(), "1 %".into()], points, ratios }
        };
        let plot = ProfilePlot {
            title: "Milk".into(),
            subtitle: "sigma_a .1".into(),
            unit: "mm".into(),
            labels: ["R".into(), "r R".into()],
            power: 1,
            columns: vec!["albedo".into(), "L1".into()],
            facts: vec!["0.51".into(), String::new()],
            measured: measured.collect(),
            curves: vec![curve("dipole", 1.1), curve("photon-beam", 0.9)],
        };
        let text = svg(&plot).unwrap();
        assert!(text.contains("photon-beam") && text.contains("Milk") && text.matches("<polyline").count() > 5);
        assert_eq!(text, svg(&plot).unwrap());
        let (a, b) = (png(&plot).unwrap(), png(&plot).unwrap());
        assert!(a == b && a.starts_with(b"\x89PNG"));
        assert!(svg(&ProfilePlot { measured: Vec::new(), ..plot }).is_err());
    }
}
