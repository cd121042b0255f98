//! The report: one HTML file that needs no network, with pictures, tables and a slider.

use std::fmt::Write;

use moonmilk_io::sheet::Pixels;
use serde_json::json;

use super::bins::AXES;
use super::json::{DEFINITIONS, significance};
use super::measure::{Findings, Measured, error_picture, rms, rms_error, three_digits};
use crate::failure::Failure;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// Longest side of an embedded picture; larger ones are shrunk.
const LARGEST: usize = 1024;

/// Keys and what they do.
const KEYS: [(&str, &str); 9] = [
    ("← →", "move the slider (when the picture has the focus)"),
    ("Space", "hold: the right picture alone"),
    ("n p", "next, previous picture on the right"),
    ("N P", "the same on the left"),
    ("e", "signed errors in place of pictures"),
    ("x", "swap left and right"),
    ("+ - 0", "zoom in, out, all"),
    ("Shift ← →, ↑ ↓", "move within a zoomed picture"),
    ("d", "dark or light"),
];

/// Returns text with everything escaped that HTML would read as its own.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// Returns bytes in base 64 (RFC 4648, with padding).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let b = [0, 1, 2].map(|i| chunk.get(i).copied().unwrap_or(0));
        let word = u32::from_be_bytes([0, b[0], b[1], b[2]]);
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            out.push(if i > chunk.len() { '=' } else { char::from(digit) });
        }
    }
    out
}

fn embedded(p: &Pixels) -> Result<String, Failure> {
    let png = p.shrunk(LARGEST).png().map_err(|e| Failure::Run(e.to_string()))?;
    Ok(format!("data:image/png;base64,{}", base64(&png)))
}

/// A cell: what is shown, and the number that it is sorted by.
fn cell(text: &str, value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        Some(v) => format!("<td data-v=\"{v}\">{text}</td>"),
        None => "<td data-v=\"\">–</td>".into(),
    }
}

fn percent(x: Option<f64>) -> String {
    cell(&x.map_or_else(String::new, |x| format!("{:+.1} %", 100.0 * x).replace('-', "−")), x)
}

fn plain_percent(x: Option<f64>) -> String {
    cell(&x.map_or_else(String::new, |x| format!("{:.1} %", 100.0 * x)), x)
}

fn with_error(mean: f64, error: f64, sign: bool, digits: usize) -> String {
    let number = if sign { format!("{:+.digits$}", 100.0 * mean) } else { format!("{:.digits$}", 100.0 * mean) };
    let number = number.replace('-', "−");
    cell(&format!("{number} <span class=pm>± {:.digits$}</span> %", 100.0 * error), Some(mean))
}

fn head(columns: &[(&str, &str)]) -> String {
    let cells: String = columns
        .iter()
        .map(|(name, title)| format!("<th scope=col title=\"{title}\"><button type=button>{name}</button></th>"))
        .collect();
    format!("<thead><tr>{cells}</tr></thead>")
}

/// Returns the report.
///
/// *Errors*: a picture that cannot be coded.
pub fn page(f: &Findings) -> Result<String, Failure> {
    let mut out = String::new();
    let mut put = |s: &str| out.push_str(s);
    let scene = escape(&f.scene);
    put(&format!(
        "<!doctype html>\n<html lang=en>\n<meta charset=utf-8>\n<meta name=viewport content=\"width=device-width, initial-scale=1\">\n\
         <title>{scene}: which model is good enough?</title>\n<style>\n{STYLE}</style>\n<main>\n"
    ));
    put(&format!(
        "<header><div><h1>{scene}</h1><p class=soft>Which model of subsurface scattering is good enough here, and what does it cost?</p></div>\
         <button type=button id=theme title=\"dark or light (d)\" aria-label=\"dark or light\">◐</button></header>\n"
    ));
    put(&facts(f));
    put(&answer(f));
    put(&viewer(f));
    put("<h2 id=table>All models</h2>\n");
    put(&models_table(f));
    put("<h2>Where the error comes from</h2>\n");
    put(&budget_table(f));
    put("<h2>Model by model</h2>\n<div class=grid>\n");
    put(&format!(
        "<article class=card><h3>{} <small>exact</small></h3><div class=\"pair one\"><img id=picture-0 data-show=0 alt=\"{}, picture\" src=\"{}\"></div>\
         <p>What the others are compared with: {} samples per pixel, noise {:.1} %.</p></article>\n",
        escape(&f.exact.name),
        escape(&f.exact.name),
        embedded(&f.exact.shown)?,
        f.exact.cost.spp,
        100.0 * rms(f.exact.variance.mean)
    ));
    for (i, m) in f.models.iter().enumerate() {
        put(&card(f, i + 1, m)?);
    }
    put("</div>\n");
    if !f.bodies.is_empty() {
        put("<h2>What the camera sees</h2>\n");
        put(&bodies(f));
    }
    put("<h2>What the numbers mean</h2>\n<dl>\n");
    for (name, text) in DEFINITIONS {
        put(&format!("<dt>{name}</dt><dd>{}</dd>\n", escape(text)));
    }
    put(&format!(
        "<dt>worst place</dt><dd>{}</dd>\n<dt>pictures</dt><dd>sRGB at an exposure of {:+.2} stops; error maps are means over 3 x 3 pixels of the signed relative error, blue where too dark, red where too bright, full colour at {:.0} %. FLIP compares the whole pictures, noise included.</dd>\n</dl>\n",
        escape(&significance()),
        f.stops,
        100.0 * f.scale
    ));
    let names: Vec<serde_json::Value> = std::iter::once(&f.exact.name)
        .chain(f.models.iter().map(|m| &m.name))
        .map(|name| json!({"name": name}))
        .collect();
    // A script may hold anything but its own end.
    let data = serde_json::Value::Array(names).to_string().replace('<', "\\u003c");
    put(&format!(
        "<p class=soft><small>moonmilk {}, scene {}.</small></p>\n</main>\n<script type=application/json id=pictures>{data}</script>\n<script>\n{SCRIPT}</script>\n</html>\n",
        env!("CARGO_PKG_VERSION"),
        &f.hash[..f.hash.len().min(16)]
    ));
    Ok(out)
}

fn facts(f: &Findings) -> String {
    let pixels = if f.object_pixels > 0 {
        format!("{} of them translucent", f.object_pixels)
    } else {
        "none of them translucent".into()
    };
    let mut list = vec![
        format!("{} × {} pixels, {pixels}", f.size[0], f.size[1]),
        format!("{} a picture", f.budget),
        format!("against {} ({} samples per pixel)", f.exact.name, f.exact.cost.spp),
    ];
    list.extend(f.settings.iter().map(|(k, v)| format!("{k} {v}")));
    let items: String = list.iter().map(|t| format!("<li>{}</li>", escape(t))).collect();
    format!("<ul class=facts>{items}</ul>\n")
}

/// Returns the short answer, and what holds for all models.
fn answer(f: &Findings) -> String {
    let mut out = String::from("<div class=answer>");
    let by = |key: fn(&Measured) -> f64| f.models.iter().min_by(|a, b| key(a).total_cmp(&key(b)));
    if let (Some(closest), Some(best)) = (by(|m| m.object.bias2.mean), by(|m| m.object.total.mean)) {
        let (name, b) = (escape(&closest.name), &closest.object);
        write!(
            out,
            "<p><strong>{name}</strong> comes closest to the exact picture: off by {:.1} ± {:.1} %, in the mean {:+.1} %, {} times as fast as {} at equal noise.</p>",
            100.0 * rms(b.bias2.mean),
            100.0 * rms_error(&b.bias2),
            100.0 * (b.ratio.mean - 1.0),
            three_digits(closest.speed),
            escape(&f.exact.name)
        )
        .expect("a string takes everything");
        let exact = f.exact.at_equal;
        let text = if exact.is_finite() && exact <= best.object.total.mean {
            format!(
                "With this budget the exact picture itself has the least error in all: relMSE {}, {} {}.",
                three_digits(exact),
                escape(&best.name),
                three_digits(best.object.total.mean)
            )
        } else {
            format!(
                "With this budget, noise included, <strong>{}</strong> has the least error: relMSE {}{}.",
                escape(&best.name),
                three_digits(best.object.total.mean),
                if exact.is_finite() {
                    format!("; the exact picture has {}", three_digits(exact))
                } else {
                    String::new()
                }
            )
        };
        write!(out, "<p>{text}</p>").expect("a string takes everything");
    }
    let left = f.left_out.iter().map(|(name, reason)| format!("{name} is left out: {reason}"));
    let list: String = f.notes.iter().cloned().chain(left).map(|n| format!("<li>{}</li>", escape(&n))).collect();
    if !list.is_empty() {
        write!(out, "<ul class=warn>{list}</ul>").expect("a string takes everything");
    }
    out + "</div>\n"
}

fn viewer(f: &Findings) -> String {
    let keys: String = KEYS
        .iter()
        .map(|(k, what)| {
            let caps: String = k.split(' ').map(|k| format!("<kbd>{k}</kbd> ")).collect();
            format!("<dt>{caps}</dt><dd>{what}</dd>")
        })
        .collect();
    // A tall picture must not fill more than a screen.
    let [w, h] = f.size;
    let width = format!("max-width: min(100%, calc(78vh * {:.5}))", w as f64 / h as f64);
    format!(
        "<h2 style=\"margin-top:0\">Compare</h2>\n<div class=bar><label>left <select id=left></select></label><label>right <select id=right></select></label>\
         <button type=button id=swap title=\"swap (x)\" aria-label=swap>⇄</button><button type=button id=error aria-pressed=false title=\"signed errors (e)\">errors</button>\
         <button type=button id=out title=\"zoom out (-)\" aria-label=\"zoom out\">−</button><button type=button id=in title=\"zoom in (+)\" aria-label=\"zoom in\">+</button>\
         <span class=legend>−{s:.0} %<i></i>+{s:.0} %</span></div>\n\
         <div id=stage class=stage tabindex=0 role=slider aria-label=\"wipes between two pictures\" aria-valuemin=0 aria-valuemax=100 aria-valuenow=50 style=\"aspect-ratio: {w} / {h}; {width}\">\
         <div class=pane><img id=image-right alt=\"\"></div><div class=pane id=pane-left><img id=image-left alt=\"\"></div>\
         <div id=handle class=handle><div class=knob aria-hidden=true>◂▸</div></div><span id=tag-left class=tag></span><span id=tag-right class=tag></span></div>\n\
         <p class=hint>Drag to wipe. Wheel, two fingers or a double click zoom; then drag to move. Errors: blue is too dark, red too bright.</p>\n\
         <details class=keys><summary>Keys</summary><dl>{keys}</dl></details>\n",
        s = 100.0 * f.scale
    )
}

fn models_table(f: &Findings) -> String {
    let columns = [
        ("model", "name"),
        ("energy", "mean over that of the exact picture, minus 1"),
        ("error", "relative root mean square of the bias"),
        ("noise", "relative root mean square of the noise"),
        ("relMSE", "error squared plus noise squared"),
        ("FLIP", "mean of HDR-FLIP over the whole picture"),
        ("speed", "how many times faster than exact at equal noise"),
        ("time", "seconds of rendering"),
        ("CPU", "seconds of processor time"),
        ("samples", "per pixel"),
        ("memory", "peak of the program while it rendered this picture"),
    ];
    let cost = |c: &super::shoot::Cost| {
        let number = |x: Option<f64>, unit: &str, factor: f64| {
            cell(&x.map_or_else(String::new, |x| format!("{:.1} {unit}", x * factor)), x)
        };
        number(Some(c.seconds), "s", 1.0)
            + &number(c.cpu, "s", 1.0)
            + &cell(&c.spp.to_string(), Some(c.spp as f64))
            + &number(c.memory, "MiB", 1.0 / f64::from(1 << 20))
    };
    let rows: String = f
        .models
        .iter()
        .map(|m| {
            let o = &m.object;
            let mark = if m.warnings.is_empty() { "" } else { " <span class=warn title=\"has warnings\">⚠</span>" };
            format!(
                "<tr><th scope=row>{}{mark}</th>{}{}{}{}{}{}{}</tr>\n",
                escape(&m.name),
                with_error(o.ratio.mean - 1.0, o.ratio.std_err, true, 2),
                with_error(rms(o.bias2.mean), rms_error(&o.bias2), false, 2),
                plain_percent(Some(rms(o.variance.mean))),
                cell(&three_digits(o.total.mean), Some(o.total.mean)),
                cell(&format!("{:.3}", m.flip), Some(m.flip)),
                cell(&format!("{}×", three_digits(m.speed)), Some(m.speed)),
                cost(&m.cost)
            )
        })
        .collect();
    let e = &f.exact;
    let exact = format!(
        "<tr class=exact><th scope=row>{} <small>exact</small></th>{}{}{}{}{}{}{}</tr>\n",
        escape(&e.name),
        cell("0", Some(0.0)),
        cell("0", Some(0.0)),
        plain_percent(Some(rms(e.variance.mean))),
        cell(&three_digits(e.variance.mean), Some(e.variance.mean)),
        cell("0", Some(0.0)),
        cell("1×", Some(1.0)),
        cost(&e.cost)
    );
    format!("<div class=scroll><table class=sortable>{}<tbody>\n{rows}{exact}</tbody></table></div>\n", head(&columns))
}

fn budget_table(f: &Findings) -> String {
    let columns = [
        ("model", "name"),
        ("profile: light astray", "L1 distance of R(r) from the exact profile of the scene's media"),
        ("profile: energy", "albedo over the exact albedo, minus 1"),
        ("geometry: energy", "the picture by the exact profile over the exact picture, minus 1"),
        ("remaining: energy", "what both leave of the ratio"),
        ("profile: picture", "root mean square difference from the picture by the exact profile"),
        ("geometry: picture", "the same between that picture and the exact one"),
        ("remaining: square", "bias squared minus both squares; negative where they cancel"),
    ];
    let planar = f.planar();
    let rows: String = f
        .models
        .iter()
        .map(|m| {
            let b = m.budget(planar);
            let square = cell(
                &b.remaining_square.map_or_else(String::new, |x| format!("{x:+.4}").replace('-', "−")),
                b.remaining_square,
            );
            format!(
                "<tr><th scope=row>{}</th>{}{}{}{}{}{}{square}</tr>\n",
                escape(&m.name),
                plain_percent(b.profile_l1),
                percent(b.profile_energy),
                percent(b.geometry_energy),
                percent(b.remaining_energy),
                plain_percent(b.profile_rms),
                plain_percent(b.geometry_rms)
            )
        })
        .collect();
    format!("<div class=scroll><table class=sortable>{}<tbody>\n{rows}</tbody></table></div>\n", head(&columns))
}

fn card(f: &Findings, i: usize, m: &Measured) -> Result<String, Failure> {
    let name = escape(&m.name);
    let error = error_picture(&m.error, f.size[0], f.scale);
    let mut out = format!(
        "<article class=card id=model-{i}><h3>{name}</h3><div class=pair><img id=picture-{i} data-show={i} data-error=0 alt=\"{name}, picture\" src=\"{}\"><img id=error-{i} data-show={i} data-error=1 alt=\"{name}, signed error\" src=\"{}\"></div>\n<p>{}</p>",
        embedded(&m.shown)?,
        embedded(&error)?,
        escape(&m.verdict())
    );
    if !m.warnings.is_empty() {
        let list: String = m.warnings.iter().map(|w| format!("<li>{}</li>", escape(w))).collect();
        write!(out, "<ul class=warn>{list}</ul>").expect("a string takes everything");
    }
    out.push_str("<details><summary>Where it fails here</summary>");
    for (a, (axis, bins)) in AXES.iter().zip(&m.bins).enumerate() {
        let rows: String = bins
            .iter()
            .enumerate()
            .filter_map(|(b, found)| {
                let o = found.as_ref()?;
                let limit = |x: Option<f32>, none: &str| x.map_or_else(|| none.to_owned(), |x| x.to_string());
                let [from, to] = axis.limits(b);
                let range = match (from, to) {
                    (None, to) => format!("below {}", limit(to, "")),
                    (from, None) => format!("above {}", limit(from, "")),
                    (from, to) => format!("{} to {}", limit(from, ""), limit(to, "")),
                };
                let worst = m.worst.is_some_and(|w| (w.axis, w.bin) == (a, b));
                let mark = if worst { " ◂" } else { "" };
                Some(format!(
                    "<tr><th scope=row>{range}{mark}</th><td>{}</td>{}{}</tr>",
                    o.pixels,
                    with_error(o.ratio.mean - 1.0, o.ratio.std_err, true, 1),
                    with_error(rms(o.bias2.mean), rms_error(&o.bias2), false, 1)
                ))
            })
            .collect();
        if !rows.is_empty() {
            write!(
                out,
                "<div class=\"scroll bins\"><table><caption>{}</caption><tr><th></th><th>pixels</th><th>energy</th><th>error</th></tr>{rows}</table></div>",
                axis.what
            )
            .expect("a string takes everything");
        }
    }
    out.push_str("</details>");
    if let Some(i) = m.info {
        write!(
            out,
            "<details><summary>What it is</summary><p>{}. <span class=soft>[{}]</span></p><p class=soft>Valid: {}.</p></details>",
            escape(i.summary),
            escape(i.source),
            escape(i.valid)
        )
        .expect("a string takes everything");
    }
    out.push_str("</article>\n");
    Ok(out)
}

/// Returns a card for each body, so narrow that a phone shows it whole: numbers by channel are rows of three.
fn bodies(f: &Findings) -> String {
    let row = |name: &str, digits: usize, x: [f64; 3]| {
        let cells: String = x.iter().map(|x| format!("<td>{x:.digits$}</td>")).collect();
        format!("<tr><th scope=row>{name}</th>{cells}</tr>\n")
    };
    let cards: String = f
        .bodies
        .iter()
        .map(|b| {
            let rows = [
                row("σ<sub>a</sub>", 3, b.sigma_a),
                row("σ<sub>s</sub>", 3, b.sigma_s),
                row("reduced albedo", 3, [0, 1, 2].map(|c| b.alpha_prime(c))),
                row("thickness, transport mean free paths", 1, b.thickness),
            ];
            format!(
                "<div class=card><h3>{}</h3><p class=soft>{}; {} pixels; g {}, η {}</p>\n<table class=rgb><thead><tr><td></td><th>red</th><th>green</th><th>blue</th></tr></thead><tbody>\n{}</tbody></table></div>\n",
                escape(&b.name),
                escape(&b.place),
                b.pixels,
                b.g as f32,
                b.eta as f32,
                rows.concat()
            )
        })
        .collect();
    format!("<div class=grid id=bodies>\n{cards}</div>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_scenes_stays_text() {
        assert_eq!(escape("<b>&\"'a"), "&lt;b&gt;&amp;&quot;&#39;a");
        assert!(!SCRIPT.contains("</script") && !SCRIPT.contains("http") && !STYLE.contains("http"));
    }

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        let pairs =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("fooba", "Zm9vYmE=")];
        for (plain, coded) in pairs {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
