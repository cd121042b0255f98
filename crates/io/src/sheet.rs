//! A contact sheet: small pictures with labels, laid out on one PNG.

use plotters::prelude::*;
use plotters::style::FontStyle;

use crate::plot::{FONT, PlotError, encode_png, register_font};

/// Longest side of a picture on the sheet \[pixels\]; larger ones are shrunk.
const LARGEST: usize = 320;
/// Longest side below which pictures are enlarged by a whole factor.
const SMALLEST: usize = 160;
const MARGIN: i32 = 24;
const GAP: i32 = 18;
/// Space between a row and the labels of the next.
const ROW: i32 = 22;
const TITLE: i32 = 26;
const LABEL: i32 = 17;
const SMALL: i32 = 13;
const PAPER: RGBColor = RGBColor(250, 249, 246);
const INK: RGBColor = RGBColor(34, 34, 40);
const GREY: RGBColor = RGBColor(104, 104, 112);

/// An 8-bit picture for screens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Width.
    pub width: usize,
    /// Height.
    pub height: usize,
    /// sRGB codes, rows from the top.
    pub rgb: Vec<[u8; 3]>,
}

impl Pixels {
    /// Returns the PNG file.
    ///
    /// *Errors*: a side of more than 2^32 pixels.
    pub fn png(&self) -> Result<Vec<u8>, PlotError> {
        encode_png(self.rgb.as_flattened(), (self.width as u32, self.height as u32))
    }

    /// Returns the picture with each pixel as a square of k x k.
    fn enlarged(&self, k: usize) -> Self {
        let (width, height) = (k * self.width, k * self.height);
        let rgb = (0..width * height).map(|i| self.rgb[i / width / k * self.width + i % width / k]).collect();
        Self { width, height, rgb }
    }

    /// Returns the picture in a size that fits a sheet.
    fn fitted(&self) -> Self {
        match self.width.max(self.height) {
            n if n > SMALLEST => self.shrunk(LARGEST),
            n => self.enlarged((2 * SMALLEST / n.max(1)).clamp(1, 16)),
        }
    }

    /// Returns the picture shrunk by the smallest whole factor that makes no side longer than `longest`, means over squares (of codes: for looking).
    pub fn shrunk(&self, longest: usize) -> Self {
        let k = self.width.max(self.height).div_ceil(longest.max(1)).max(1);
        if k == 1 {
            return self.clone();
        }
        let (width, height) = (self.width.div_ceil(k), self.height.div_ceil(k));
        let mean = |x: usize, y: usize| {
            let (mut sum, mut n) = ([0u32; 3], 0u32);
            for v in y * k..((y + 1) * k).min(self.height) {
                for u in x * k..((x + 1) * k).min(self.width) {
                    let p = self.rgb[v * self.width + u];
                    sum.iter_mut().zip(p).for_each(|(s, c)| *s += u32::from(c));
                    n += 1;
                }
            }
            sum.map(|s| ((s + n / 2) / n) as u8)
        };
        let rgb = (0..width * height).map(|i| mean(i % width, i / width)).collect();
        Self { width, height, rgb }
    }
}

/// A cell of the sheet: pictures side by side under a label.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Label.
    pub label: String,
    /// A line below it.
    pub note: String,
    /// The pictures, all of one size.
    pub pictures: Vec<Pixels>,
}

/// Returns the sheet as a PNG file: a title, a line below it, a legend of signed errors up to `scale`, and the cells in `columns` columns.
///
/// *Errors*: no cells.
pub fn png(title: &str, subtitle: &str, scale: f32, columns: usize, cells: &[Cell]) -> Result<Vec<u8>, PlotError> {
    let most = cells.iter().map(|c| c.pictures.len()).max().unwrap_or(0);
    let Some(first) = cells.iter().flat_map(|c| &c.pictures).next().map(Pixels::fitted) else {
        return Err(PlotError("there are no pictures".into()));
    };
    register_font();
    // Labels need some width, however narrow the pictures are.
    let cell_width = (most as i32 * (first.width as i32 + 4)).max(230);
    let cell_height = first.height as i32 + LABEL + SMALL + 14;
    let columns = columns.clamp(1, cells.len());
    let rows = cells.len().div_ceil(columns) as i32;
    let head = MARGIN + TITLE + LABEL + 34;
    let width = (2 * MARGIN + columns as i32 * (cell_width + GAP) - GAP).max(760);
    let height = head + rows * (cell_height + ROW) + MARGIN;
    let mut pixels = vec![0u8; (width * height * 3) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut pixels, (width as u32, height as u32)).into_drawing_area();
        let fail = |e: &dyn std::fmt::Display| PlotError(e.to_string());
        let write = |text: &str, at: (i32, i32), size: i32, bold: bool, color: RGBColor| {
            let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
            let style = TextStyle::from((FONT, size, style).into_font()).color(&color);
            root.draw(&Text::new(text.to_owned(), at, style)).map_err(|e| fail(&e))
        };
        root.fill(&PAPER).map_err(|e| fail(&e))?;
        write(title, (MARGIN, MARGIN - 4), TITLE, true, INK)?;
        write(subtitle, (MARGIN, MARGIN + TITLE + 6), LABEL - 2, false, GREY)?;
        // Legend of the error maps.
        let (bar, top) = (240, MARGIN + 2);
        let left = width - MARGIN - bar;
        for x in 0..bar {
            let c = crate::false_color::blue_red(2.0 * x as f32 / (bar - 1) as f32 - 1.0).map(|v| (255.0 * v) as u8);
            let color = RGBColor(c[0], c[1], c[2]);
            root.draw(&PathElement::new(vec![(left + x, top), (left + x, top + 10)], color)).map_err(|e| fail(&e))?;
        }
        let percent = 100.0 * scale;
        write(&format!("-{percent:.0} %, too dark"), (left, top + 14), SMALL, false, GREY)?;
        write(&format!("too bright, +{percent:.0} %"), (left + bar - 108, top + 14), SMALL, false, GREY)?;
        for (i, cell) in cells.iter().enumerate() {
            let x = MARGIN + (i % columns) as i32 * (cell_width + GAP);
            let y = head + (i / columns) as i32 * (cell_height + ROW);
            write(&cell.label, (x, y), LABEL, true, INK)?;
            write(&cell.note, (x, y + LABEL + 4), SMALL, false, GREY)?;
        }
        root.present().map_err(|e| fail(&e))?;
    }
    for (i, cell) in cells.iter().enumerate() {
        let x = MARGIN + (i % columns) as i32 * (cell_width + GAP);
        let y = head + (i / columns) as i32 * (cell_height + ROW) + LABEL + SMALL + 12;
        for (k, p) in cell.pictures.iter().enumerate() {
            let p = p.fitted();
            let x = x as usize + k * (p.width + 4);
            for (row, line) in p.rgb.chunks_exact(p.width).enumerate().take(first.height) {
                let at = ((y as usize + row) * width as usize + x) * 3;
                let bytes = line.as_flattened();
                pixels[at..at + bytes.len()].copy_from_slice(bytes);
            }
        }
    }
    encode_png(&pixels, (width as u32, height as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Encoding, load_texture};

    fn plain(width: usize, height: usize, c: u8) -> Pixels {
        Pixels { width, height, rgb: vec![[c, 2 * c, 3 * c]; width * height] }
    }

    #[test]
    fn shrinking_takes_means_and_keeps_what_is_small() {
        let mut p = plain(5, 4, 10);
        p.rgb[0] = [110, 20, 30];
        let q = p.shrunk(3);
        assert_eq!((q.width, q.height, q.rgb[0], q.rgb[5]), (3, 2, [35, 20, 30], [10, 20, 30]));
        assert_eq!(p.shrunk(5), p);
    }

    #[test]
    fn a_sheet_holds_all_its_pictures() {
        let cell =
            |c: u8| Cell { label: format!("model {c}"), note: "+1 %".into(), pictures: vec![plain(40, 30, c); 2] };
        let cells: Vec<Cell> = (1..=5).map(|k| cell(16 * k)).collect();
        let bytes = png("Title", "subtitle", 0.2, 3, &cells).unwrap();
        let picture = load_texture(&bytes, "sheet.png", Encoding::Linear).unwrap();
        let green = picture.channel("G").unwrap();
        let count = |c: u8| green.iter().filter(|&&g| (g * 255.0 - f32::from(2 * c)).abs() < 0.5).count();
        assert!((1..=5).all(|k| count(16 * k) >= 2 * 320 * 240), "each picture is there");
        assert!(png("Title", "", 0.2, 3, &[]).is_err());
    }
}
