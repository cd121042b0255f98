//! From tokens to directives with parameter lists, across included files.
//!
//! As in pbrt, the end of an included file is no token: a parameter list at its end goes on with the quoted words that
//! follow the `Include` (a habit of some exporters).

mod values;

use super::builder::Builder;
use super::context::Context;
use super::lexer::{Cursor, Kind, LexError, Spot, unescape};
use super::suggest::nearest;

/// Deepest nesting of included files.
const MAX_INCLUDES: usize = 32;

/// Largest number of inclusions, and of the bytes that they add up to: files that include others twice each double the
/// work at every level.
const MAX_INCLUSIONS: (usize, usize) = (2_000_000, 16 << 30);

/// Names of all directives.
pub(crate) const DIRECTIVES: [&str; 40] = [
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
];

/// Reading cannot go on; the reason has been recorded.
pub(crate) struct Stop;

type Result<T> = std::result::Result<T, Stop>;

struct Frame {
    cursor: Cursor,
    import: bool,
}

pub(crate) struct Parser {
    frames: Vec<Frame>,
    peeked: Option<(Kind, Spot)>,
    /// The last token, for "the file ends".
    last: Spot,
    /// Number of inclusions so far, and their bytes.
    included: (usize, usize),
    /// Nothing after this fault is worth reading.
    given_up: bool,
}

/// Reads all directives of `main` into `builder`.
pub(crate) fn parse(cx: &mut Context, builder: &mut Builder, main: Cursor, start: Spot) -> Result<()> {
    let mut parser = Parser {
        frames: vec![Frame { cursor: main, import: false }],
        peeked: None,
        last: start,
        included: (0, 0),
        given_up: false,
    };
    let mut sound = true;
    loop {
        match parser.next(cx).and_then(|token| parser.read(cx, builder, token)) {
            Ok(true) => {}
            Ok(false) => break,
            Err(Stop) if parser.given_up || cx.hopeless() => return Err(Stop),
            // Go on at the next directive: a file with one fault often has more.
            Err(Stop) => {
                sound = false;
                parser.skip_to_directive(cx);
            }
        }
    }
    if sound {
        builder.end_of_files(cx, parser.last);
        Ok(())
    } else {
        Err(Stop)
    }
}

impl Parser {
    /// Reads what a token begins; returns whether there may be more.
    fn read(&mut self, cx: &mut Context, builder: &mut Builder, token: Option<(Kind, Spot)>) -> Result<bool> {
        if cx.hopeless() {
            return Err(Stop);
        }
        match token {
            None => return Ok(false),
            Some((Kind::EndOfImport, spot)) => builder.end_import(cx, spot),
            Some((Kind::Word, spot)) => self.directive(cx, builder, spot)?,
            Some((_, spot)) => {
                cx.error_help(
                    spot,
                    "a directive is expected here",
                    "a directive starts with a capital letter and has no quotes, e.g. `Shape`",
                );
                return Err(Stop);
            }
        }
        Ok(true)
    }

    /// Drops tokens up to the next directive, or the end of an imported file; faults among them are not told.
    fn skip_to_directive(&mut self, cx: &mut Context) {
        let told = cx.problems.len();
        loop {
            match self.peek(cx) {
                Ok(None | Some((Kind::EndOfImport, _))) => break,
                Ok(Some((Kind::Word, at))) if DIRECTIVES.contains(&&*cx.text(at)) => break,
                Ok(Some(_)) => self.peeked = None,
                Err(Stop) => cx.problems.truncate(told),
            }
        }
    }

    fn next(&mut self, cx: &mut Context) -> Result<Option<(Kind, Spot)>> {
        if let Some(token) = self.peeked.take() {
            return Ok(Some(token));
        }
        while let Some(frame) = self.frames.last_mut() {
            match frame.cursor.next() {
                Ok(Some(token)) => {
                    self.last = token.1;
                    return Ok(Some(token));
                }
                Ok(None) => {
                    let import = frame.import;
                    self.frames.pop();
                    if import {
                        return Ok(Some((Kind::EndOfImport, self.last)));
                    }
                }
                Err(error) => return Err(lex_error(cx, error)),
            }
        }
        Ok(None)
    }

    fn peek(&mut self, cx: &mut Context) -> Result<Option<(Kind, Spot)>> {
        if self.peeked.is_none() {
            self.peeked = self.next(cx)?;
        }
        Ok(self.peeked)
    }

    fn required(&mut self, cx: &mut Context, what: &str) -> Result<(Kind, Spot)> {
        match self.next(cx)? {
            Some((Kind::EndOfImport, spot)) => {
                cx.error(spot, format!("the file ends after this word where {what} is expected"));
                Err(Stop)
            }
            Some(token) => Ok(token),
            None => {
                cx.error(self.last, format!("the file ends after this word where {what} is expected"));
                Err(Stop)
            }
        }
    }

    fn string(&mut self, cx: &mut Context, what: &str) -> Result<(String, Spot)> {
        match self.required(cx, what)? {
            (kind @ Kind::String { .. }, spot) => Ok((string_of(cx, kind, spot)?, spot)),
            (_, spot) => {
                cx.error(spot, format!("{what} in quotes is expected here"));
                Err(Stop)
            }
        }
    }

    fn number(&mut self, cx: &mut Context, directive: &str) -> Result<f64> {
        let (kind, spot) = self.required(cx, "a number")?;
        let bytes = &cx.source(spot.source).bytes[spot.start..spot.end];
        match super::number::float(bytes) {
            Some((value, used)) if kind == Kind::Word && used == bytes.len() && value.is_finite() => Ok(value),
            _ => {
                // If numbers are missing, this is the next directive: read on there.
                if kind == Kind::Word && DIRECTIVES.contains(&&*cx.text(spot)) {
                    self.peeked = Some((kind, spot));
                }
                cx.error(spot, format!("{directive} expects a number here"));
                Err(Stop)
            }
        }
    }

    fn numbers<const N: usize>(&mut self, cx: &mut Context, directive: &str) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for x in &mut out {
            *x = self.number(cx, directive)?;
        }
        Ok(out)
    }

    fn matrix(&mut self, cx: &mut Context, directive: &str) -> Result<[f64; 16]> {
        let (kind, spot) = self.required(cx, "`[`")?;
        if kind != Kind::Open {
            cx.error(spot, format!("{directive} expects `[` and 16 numbers here"));
            return Err(Stop);
        }
        let values = self.numbers::<16>(cx, directive)?;
        let (kind, spot) = self.required(cx, "`]`")?;
        if kind != Kind::Close {
            cx.error(spot, format!("{directive} takes 16 numbers; `]` is expected here"));
            return Err(Stop);
        }
        Ok(values)
    }

    fn directive(&mut self, cx: &mut Context, builder: &mut Builder, spot: Spot) -> Result<()> {
        let word = cx.text(spot).into_owned();
        match word.as_str() {
            "Identity" => builder.identity(),
            "Translate" => builder.translate(self.numbers(cx, &word)?),
            "Scale" => builder.scale(self.numbers(cx, &word)?),
            "Rotate" => {
                let values = self.numbers(cx, &word)?;
                builder.rotate(cx, spot, values);
            }
            "LookAt" => {
                let values = self.numbers(cx, &word)?;
                builder.look_at(cx, spot, values);
            }
            "Transform" => builder.set_transform(self.matrix(cx, &word)?),
            "ConcatTransform" => builder.concat_transform(self.matrix(cx, &word)?),
            "TransformTimes" => {
                let values = self.numbers(cx, &word)?;
                builder.transform_times(cx, spot, values);
            }
            "CoordinateSystem" => builder.coordinate_system(self.string(cx, "a name")?.0),
            "CoordSysTransform" => {
                let (name, at) = self.string(cx, "a name")?;
                builder.coord_sys_transform(cx, at, &name);
            }
            "ActiveTransform" => {
                let (_, at) = self.required(cx, "StartTime, EndTime or All")?;
                let which = cx.text(at).into_owned();
                match which.as_str() {
                    "StartTime" => builder.active_transform(true, false),
                    "EndTime" => builder.active_transform(false, true),
                    "All" => builder.active_transform(true, true),
                    _ => cx.error_help(at, format!("`{which}` is no transform"), "accepted: StartTime, EndTime, All"),
                }
            }
            "ReverseOrientation" => builder.reverse_orientation(cx, spot),
            "ColorSpace" => {
                let (name, at) = self.string(cx, "a name")?;
                builder.color_space(cx, at, &name);
            }
            "AttributeBegin" => builder.attribute_begin(cx, spot),
            "AttributeEnd" => builder.attribute_end(cx, spot),
            "TransformBegin" => {
                cx.warn_once(
                    spot,
                    "TransformBegin and TransformEnd are deprecated; they do what AttributeBegin and AttributeEnd do",
                );
                builder.attribute_begin(cx, spot);
            }
            "TransformEnd" => builder.attribute_end(cx, spot),
            "WorldBegin" => builder.world_begin(cx, spot),
            "ObjectBegin" => {
                let (name, at) = self.string(cx, "a name")?;
                builder.object_begin(cx, spot, at, name);
            }
            "ObjectEnd" => builder.object_end(cx, spot),
            "ObjectInstance" => {
                let (name, at) = self.string(cx, "a name")?;
                builder.object_instance(cx, at, name);
            }
            "NamedMaterial" => {
                let (name, at) = self.string(cx, "a name")?;
                builder.named_material(cx, at, name);
            }
            "MediumInterface" => {
                let inside = self.string(cx, "a medium's name")?;
                let outside = match self.peek(cx)? {
                    Some((Kind::String { .. }, _)) => self.string(cx, "a medium's name")?,
                    _ => inside.clone(),
                };
                builder.medium_interface(inside, outside);
            }
            "Option" => {
                let (name, at) = self.string(cx, "a name")?;
                let (_, value) = self.required(cx, "a value")?;
                builder.option(cx, at, &name, value);
            }
            "Include" | "Import" => {
                let (path, at) = self.string(cx, "a file name")?;
                self.include(cx, builder, &path, at, word == "Import")?;
            }
            "Texture" => {
                let (name, at) = self.string(cx, "a name")?;
                let kind = self.string(cx, "float or spectrum")?;
                let class = self.string(cx, "a class of textures")?;
                let params = self.params(cx)?;
                builder.texture(cx, (name, at), kind, class, params);
            }
            "Attribute" | "Accelerator" | "AreaLightSource" | "Camera" | "Film" | "Integrator" | "LightSource"
            | "MakeNamedMaterial" | "MakeNamedMedium" | "Material" | "PixelFilter" | "Sampler" | "Shape" => {
                let (name, at) = self.string(cx, "a name")?;
                let params = self.params(cx)?;
                builder.entity(cx, &word, spot, name, at, params);
            }
            _ => self.unknown(cx, &word, spot)?,
        }
        Ok(())
    }

    /// Reports an unknown directive and skips what belongs to it.
    fn unknown(&mut self, cx: &mut Context, word: &str, spot: Spot) -> Result<()> {
        let (message, help) = match word {
            "WorldEnd" => (
                "`WorldEnd` is pbrt-v3 syntax".to_owned(),
                "remove it: in pbrt-v4 the world ends with the file".to_owned(),
            ),
            "SurfaceIntegrator" | "VolumeIntegrator" => {
                (format!("`{word}` is pbrt-v1 syntax"), "write `Integrator`".to_owned())
            }
            "Renderer" | "SearchPath" | "Volume" => {
                (format!("`{word}` is syntax of old pbrt versions"), "pbrt-v4 has no such directive".to_owned())
            }
            _ => {
                let help = match nearest(word, DIRECTIVES) {
                    Some(name) => format!("did you mean `{name}`?"),
                    None => "directives: ".to_owned() + &DIRECTIVES.join(", "),
                };
                (format!("`{word}` is no directive"), help)
            }
        };
        cx.error_unless_lenient(spot, message, help);
        // Skip to the next word that is a directive.
        loop {
            match self.peek(cx)? {
                None | Some((Kind::EndOfImport, _)) => return Ok(()),
                Some((Kind::Word, at)) if DIRECTIVES.contains(&&*cx.text(at)) => return Ok(()),
                Some(_) => self.peeked = None,
            }
        }
    }

    fn include(&mut self, cx: &mut Context, builder: &mut Builder, path: &str, at: Spot, import: bool) -> Result<()> {
        if self.frames.len() > MAX_INCLUDES {
            cx.error_help(
                at,
                format!("files include each other more than {MAX_INCLUDES} levels deep"),
                "does this file include itself?",
            );
            self.given_up = true;
            return Err(Stop);
        }
        if import && !builder.may_import(cx, at) {
            return Ok(());
        }
        match cx.open(path, path, Some(at)) {
            Some((source, id)) => {
                self.included.0 += 1;
                self.included.1 = self.included.1.saturating_add(source.bytes.len());
                if self.included.0 > MAX_INCLUSIONS.0 || self.included.1 > MAX_INCLUSIONS.1 {
                    cx.error(
                        at,
                        "files are included too often: more than two million times, or more than 16 GiB in all",
                    );
                    self.given_up = true;
                    return Err(Stop);
                }
                if import {
                    builder.begin_import();
                }
                self.frames.push(Frame { cursor: Cursor::new(source, id), import });
            }
            None => cx.include_missing = true,
        }
        Ok(())
    }
}

fn lex_error(cx: &mut Context, (spot, message): LexError) -> Stop {
    let word = cx.text(spot).into_owned();
    if message == values::EXPECT_NUMBER && matches!(word.as_str(), "nan" | "NaN" | "inf" | "-inf" | "-nan" | "Infinity")
    {
        cx.error_help(spot, message, "the file holds a number that is not finite: the exporter is at fault");
    } else {
        cx.error(spot, message);
    }
    Stop
}

fn string_of(cx: &mut Context, kind: Kind, spot: Spot) -> Result<String> {
    let text = cx.text(spot).into_owned();
    if kind != (Kind::String { escaped: true }) {
        return Ok(text);
    }
    match unescape(&text) {
        Some(text) => Ok(text),
        None => {
            cx.error_help(
                spot,
                "unknown escape after `\\`",
                "accepted: \\b \\f \\n \\r \\t \\\\ \\' \\\"; write paths with `/`",
            );
            Err(Stop)
        }
    }
}
