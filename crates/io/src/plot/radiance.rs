//! Plots of radiance over the direction: what is measured, and curves beside it, at several places.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{COLORS, GRID, INK, Linear, PlotError, Point, SIZE, bold, encode_png, fail, register_font, svg_of, text};

/// One place: the radiance over the cosine.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Headline.
    pub title: String,
    /// The measurement over the cosine.
    pub measured: Vec<Point>,
    /// One curve per name of the plot.
    pub curves: Vec<Vec<(f64, f64)>>,
    /// Texts for its column of the table, one per line.
    pub facts: Vec<String>,
}

/// All that a plot of radiance shows: up to two rows of three panels.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiancePlot {
    /// Headline.
    pub title: String,
    /// Line below it.
    pub subtitle: String,
    /// What the vertical axis is.
    pub quantity: String,
    /// Names of the curves.
    pub names: Vec<String>,
    /// Heads of the lines of facts.
    pub heads: Vec<String>,
    /// Rows of panels with their names.
    pub rows: Vec<(String, Vec<Panel>)>,
}

/// Returns the plot as SVG.
///
/// *Errors*: nothing to show.
pub fn svg(plot: &RadiancePlot) -> Result<String, PlotError> {
    svg_of(|root| draw(&root, plot))
}

/// Returns the plot as PNG.
///
/// *Errors*: nothing to show.
pub fn png(plot: &RadiancePlot) -> Result<Vec<u8>, PlotError> {
    register_font();
    let mut pixels = vec![0u8; (SIZE.0 * SIZE.1 * 3) as usize];
    draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), plot)?;
    encode_png(&pixels, SIZE)
}

/// Height of the headlines.
const HEAD: i32 = 136;

fn draw<B: DrawingBackend>(root: &DrawingArea<B, Shift>, plot: &RadiancePlot) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    if plot.rows.iter().all(|(_, panels)| panels.is_empty()) {
        return Err(PlotError("nothing was measured".into()));
    }
    root.fill(&WHITE).map_err(fail)?;
    root.draw(&Text::new(plot.title.clone(), (36, 22), bold(30))).map_err(fail)?;
    root.draw(&Text::new(plot.subtitle.clone(), (36, 62), text(18))).map_err(fail)?;
    legend(root, plot)?;
    let (_, body) = root.split_vertically(HEAD);
    let height = (SIZE.1 as i32 - HEAD) / plot.rows.len() as i32;
    let mut rest = body;
    for (name, panels) in &plot.rows {
        let (row, below) = rest.split_vertically(height);
        rest = below;
        row.draw(&Text::new(name.clone(), (36, 8), bold(20))).map_err(fail)?;
        let (_, row) = row.split_vertically(34);
        let width = SIZE.0 as i32 / panels.len().max(1) as i32;
        let mut right = row;
        for panel in panels {
            let (area, next) = right.split_horizontally(width);
            right = next;
            self::panel(&area, plot, panel)?;
        }
    }
    root.present().map_err(fail)
}

/// Draws the names of the curves in one line.
fn legend<B: DrawingBackend>(root: &DrawingArea<B, Shift>, plot: &RadiancePlot) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    const Y: i32 = 98;
    root.draw(&Circle::new((46, Y + 8), 4, INK.filled())).map_err(fail)?;
    root.draw(&Text::new("Monte Carlo, exact".to_owned(), (60, Y), text(17))).map_err(fail)?;
    for (i, name) in plot.names.iter().enumerate() {
        let x = 290 + 420 * i as i32;
        let line = vec![(x, Y + 8), (x + 34, Y + 8)];
        root.draw(&PathElement::new(line, COLORS[i % COLORS.len()].stroke_width(3))).map_err(fail)?;
        root.draw(&Text::new(name.clone(), (x + 44, Y), text(17))).map_err(fail)?;
    }
    Ok(())
}

/// Draws one place with its facts.
fn panel<B: DrawingBackend>(area: &DrawingArea<B, Shift>, plot: &RadiancePlot, panel: &Panel) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    let all = || panel.measured.iter().map(|p| p.value).chain(panel.curves.iter().flatten().map(|p| p.1));
    let (least, most) = all().fold((0.0f64, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
    // Leave room for the facts above the curves.
    let room = 0.34 * (most - least);
    let (low, high) = (least - 0.05 * (most - least), most + room);
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(Linear(-1.0..1.0), Linear(low..high))
        .map_err(fail)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(14))
        .axis_desc_style(text(15))
        .x_desc("cosine with the outward normal")
        .y_desc(plot.quantity.clone())
        .draw()
        .map_err(fail)?;
    chart.draw_series([PathElement::new(vec![(-1.0, 0.0), (1.0, 0.0)], INK.stroke_width(1))]).map_err(fail)?;
    for (i, curve) in panel.curves.iter().enumerate() {
        let style = COLORS[i % COLORS.len()].stroke_width(3);
        chart.draw_series(LineSeries::new(curve.iter().copied(), style)).map_err(fail)?;
    }
    for p in &panel.measured {
        let bar = vec![(p.r, p.value - p.std_err), (p.r, p.value + p.std_err)];
        chart.draw_series([PathElement::new(bar, INK.stroke_width(2))]).map_err(fail)?;
        chart.draw_series([Circle::new((p.r, p.value), 3, INK.filled())]).map_err(fail)?;
    }
    // Write the facts into the room above.
    let (width, _) = area.dim_in_pixel();
    area.draw(&Text::new(panel.title.clone(), (92, 20), bold(16))).map_err(fail)?;
    for (k, (head, fact)) in plot.heads.iter().zip(&panel.facts).enumerate() {
        let y = 44 + 20 * k as i32;
        area.draw(&Text::new(head.clone(), (92, y), text(14))).map_err(fail)?;
        let end = text(14).pos(Pos::new(HPos::Right, VPos::Top));
        area.draw(&Text::new(fact.clone(), (width as i32 - 24, y), end)).map_err(fail)?;
    }
    Ok(())
}
