//! Plots of paths: two kinds of them side by side, and how far they get.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{
    COLORS, Decades, GRID, INK, Linear, PlotError, Point, SIZE, bold, encode_png, fail, register_font, svg_of, text,
};

/// A drawn set of paths.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Headline.
    pub title: String,
    /// Line below it.
    pub subtitle: String,
    /// Corners of the paths in the plane of the picture.
    pub paths: Vec<Vec<(f64, f64)>>,
}

/// All that the plot shows.
#[derive(Clone, Debug, PartialEq)]
pub struct JourneysPlot {
    /// Headline.
    pub title: String,
    /// Line below it.
    pub subtitle: String,
    /// Unit of lengths.
    pub unit: String,
    /// The two kinds of paths.
    pub drawings: [Drawing; 2],
    /// Half of the side of the drawings.
    pub reach: f64,
    /// Labels of the axes of the graph.
    pub axes: [String; 2],
    /// The measurement of the first kind over that of the second.
    pub measured: Vec<Point>,
    /// Named curves beside it.
    pub curves: Vec<(String, Vec<(f64, f64)>)>,
}

/// Returns the plot as SVG.
///
/// *Errors*: nothing to show.
pub fn svg(plot: &JourneysPlot) -> Result<String, PlotError> {
    svg_of(|root| draw(&root, plot))
}

/// Returns the plot as PNG.
///
/// *Errors*: nothing to show.
pub fn png(plot: &JourneysPlot) -> Result<Vec<u8>, PlotError> {
    register_font();
    let mut pixels = vec![0u8; (SIZE.0 * SIZE.1 * 3) as usize];
    draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area(), plot)?;
    encode_png(&pixels, SIZE)
}

fn draw<B: DrawingBackend>(root: &DrawingArea<B, Shift>, plot: &JourneysPlot) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    let (Some(first), Some(last)) = (plot.measured.first(), plot.measured.last()) else {
        return Err(PlotError("nothing was measured".into()));
    };
    root.fill(&WHITE).map_err(fail)?;
    root.draw(&Text::new(plot.title.clone(), (36, 22), bold(30))).map_err(fail)?;
    root.draw(&Text::new(plot.subtitle.clone(), (36, 62), text(18))).map_err(fail)?;
    let (_, body) = root.split_vertically(92);
    let (top, bottom) = body.split_vertically(560);
    let (left, right) = top.split_horizontally(SIZE.0 as i32 / 2);
    for (area, drawing) in [left, right].iter().zip(&plot.drawings) {
        paths(area, plot, drawing)?;
    }
    let axis = first.r / 1.2..last.r * 1.2;
    let mut chart = ChartBuilder::on(&bottom)
        .margin(14)
        .margin_right(400)
        .x_label_area_size(52)
        .y_label_area_size(86)
        .build_cartesian_2d(Decades(axis.clone()), Linear(0.0..1.15))
        .map_err(fail)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(16))
        .axis_desc_style(text(18))
        .x_desc(plot.axes[0].clone())
        .y_desc(plot.axes[1].clone())
        .draw()
        .map_err(fail)?;
    for (i, (_, curve)) in plot.curves.iter().enumerate() {
        let shown = curve.iter().copied().filter(|p| axis.contains(&p.0));
        chart.draw_series(LineSeries::new(shown, COLORS[i % COLORS.len()].stroke_width(3))).map_err(fail)?;
    }
    for p in &plot.measured {
        let bar = vec![(p.r, p.value - p.std_err), (p.r, p.value + p.std_err)];
        chart.draw_series([PathElement::new(bar, INK.stroke_width(2))]).map_err(fail)?;
        chart.draw_series([Circle::new((p.r, p.value), 4, INK.filled())]).map_err(fail)?;
    }
    // The names stand in the margin on the right.
    let x = SIZE.0 as i32 - 380;
    bottom.draw(&Circle::new((x + 16, 40), 4, INK.filled())).map_err(fail)?;
    bottom.draw(&Text::new("Monte Carlo".to_owned(), (x + 44, 32), text(17))).map_err(fail)?;
    for (i, (name, _)) in plot.curves.iter().enumerate() {
        let y = 68 + 28 * i as i32;
        let line = vec![(x, y + 8), (x + 32, y + 8)];
        bottom.draw(&PathElement::new(line, COLORS[i % COLORS.len()].stroke_width(3))).map_err(fail)?;
        bottom.draw(&Text::new(name.clone(), (x + 44, y), text(17))).map_err(fail)?;
    }
    root.present().map_err(fail)
}

/// Draws a set of paths in a square about the origin.
fn paths<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    plot: &JourneysPlot,
    drawing: &Drawing,
) -> Result<(), PlotError>
where
    B::ErrorType: 'static,
{
    area.draw(&Text::new(drawing.title.clone(), (100, 6), bold(18))).map_err(fail)?;
    area.draw(&Text::new(drawing.subtitle.clone(), (100, 32), text(15))).map_err(fail)?;
    let (_, area) = area.split_vertically(54);
    let (half, wide) = (plot.reach, plot.reach * 1.3);
    let mut chart = ChartBuilder::on(&area)
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(86)
        .build_cartesian_2d(Linear(-wide..wide), Linear(-half..half))
        .map_err(fail)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(text(14))
        .axis_desc_style(text(16))
        .x_desc(format!("x  [{}]", plot.unit))
        .y_desc(format!("z  [{}]", plot.unit))
        .draw()
        .map_err(fail)?;
    for (i, path) in drawing.paths.iter().enumerate() {
        // Break the path where it leaves the picture.
        let inside = |p: &(f64, f64)| p.0.abs() <= wide && p.1.abs() <= half;
        for piece in path.split(|p| !inside(p)).filter(|p| p.len() > 1) {
            // Wider lines have mitred joins in pictures of pixels: spikes at sharp turns.
            let style = COLORS[i % COLORS.len()].stroke_width(1);
            chart.draw_series(LineSeries::new(piece.iter().copied(), style)).map_err(fail)?;
        }
    }
    chart.draw_series([Circle::new((0.0, 0.0), 5, INK.filled())]).map_err(fail)?;
    Ok(())
}
