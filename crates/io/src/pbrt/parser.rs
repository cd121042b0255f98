//! From tokens to directives with parameter lists, across included files.
//!
//! As in pbrt, the end of an included file is no token: a parameter list at its end goes on with the quoted words that
//! follow the `Include` (a habit of some exporters).

use super::builder::Builder;
use super::context::Context;
use super::lexer::{Cursor, Kind, LexError, Spot, unescape};
use super::params::{Param, Type, Values, did_you_mean};
use super::suggest::nearest;

/// Deepest nesting of included files.
const MAX_INCLUDES: usize = 32;

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
}

/// Reads all directives of `main` into `builder`.
pub(crate) fn parse(cx: &mut Context, builder: &mut Builder, main: Cursor, start: Spot) -> Result<()> {
    let mut parser = Parser { frames: vec![Frame { cursor: main, import: false }], peeked: None, last: start };
    while let Some((kind, spot)) = parser.next(cx)? {
        if cx.hopeless() {
            return Err(Stop);
        }
        match kind {
            Kind::EndOfImport => builder.end_import(cx, spot),
            Kind::Word => parser.directive(cx, builder, spot)?,
            Kind::String { .. } | Kind::Open | Kind::Close => {
                cx.error_help(
                    spot,
                    "a directive is expected here",
                    "a directive starts with a capital letter and has no quotes, e.g. `Shape`",
                );
                return Err(Stop);
            }
        }
    }
    builder.end_of_files(cx, parser.last);
    Ok(())
}

impl Parser {
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

    /// Reads the parameters that follow.
    fn params(&mut self, cx: &mut Context) -> Result<Vec<Param>> {
        let mut out = Vec::new();
        while let Some((kind @ Kind::String { .. }, spot)) = self.peek(cx)? {
            self.peeked = None;
            let declaration = string_of(cx, kind, spot)?;
            let mut words = declaration.split([' ', '\t']).filter(|w| !w.is_empty());
            let (Some(type_name), Some(name)) = (words.next(), words.next()) else {
                cx.error_help(spot, "a parameter needs a type and a name", "e.g. \"float fov\"");
                return Err(Stop);
            };
            // The places of both words, unless escapes hide them.
            let within = |word: &str| match kind {
                Kind::String { escaped: false } => {
                    let start = spot.start + (word.as_ptr() as usize - declaration.as_ptr() as usize);
                    Spot { start, end: (start + word.len()).min(spot.end), ..spot }
                }
                _ => spot,
            };
            let (type_spot, name_spot) = (within(type_name), within(name));
            let ty = match Type::parse(type_name) {
                Ok(ty) => Some(ty),
                Err(old) => {
                    let help = match old {
                        Some((_, advice)) => advice.to_owned(),
                        None => did_you_mean(type_name, &Type::ALL.map(Type::name), "types"),
                    };
                    cx.error_help(type_spot, format!("`{type_name}` is no type of parameters"), help);
                    old.map(|(ty, _)| ty)
                }
            };
            let (values, value) = self.values(cx, ty, name)?;
            if let (Some(ty), Some(values)) = (ty, values) {
                out.push(Param { ty, name: name.to_owned(), values, spot: name_spot, type_spot, value });
            }
            if cx.hopeless() {
                return Err(Stop);
            }
        }
        Ok(out)
    }

    /// Reads one value or a list of values of a type; `None` values after an error that was recorded.
    fn values(&mut self, cx: &mut Context, ty: Option<Type>, name: &str) -> Result<(Option<Values>, Spot)> {
        let (kind, spot) = self.required(cx, "a value")?;
        if kind == Kind::Close {
            cx.error(spot, format!("a value of `{name}` is expected here"));
            return Err(Stop);
        }
        let Some(ty) = ty else {
            // The type was wrong: skip the values.
            if kind == Kind::Open {
                while self.required(cx, "`]`")?.0 != Kind::Close {}
            }
            return Ok((None, spot));
        };
        if kind == Kind::Open {
            return self.list(cx, ty, name, spot);
        }
        // A single value without brackets.
        let values = match (ty, kind) {
            (Type::String | Type::Texture | Type::Spectrum, Kind::String { .. }) => {
                Some(Values::Strings(vec![string_of(cx, kind, spot)?]))
            }
            (Type::Bool, _) => bool_of(cx, kind, spot).map(|b| Values::Bools(vec![b])),
            (Type::String | Type::Texture, _) => {
                cx.error(spot, format!("`{name}` expects a string in quotes here"));
                None
            }
            (_, Kind::String { .. }) => {
                cx.error(spot, format!("`{name}` expects a number here, without quotes"));
                None
            }
            _ => {
                let bytes = &cx.source(spot.source).bytes[spot.start..spot.end];
                let parsed =
                    super::number::float(bytes).filter(|&(_, used)| used == bytes.len()).map(|(value, _)| value);
                let values = match ty {
                    Type::Integer => parsed.and_then(to_i32).map(|n| Values::Ints(vec![n])),
                    _ => parsed.and_then(to_f32).map(|x| Values::Floats(vec![x])),
                };
                match values {
                    Some(values) => Some(values),
                    None => {
                        // A word where a value should be is most likely the next directive.
                        cx.error(spot, if ty == Type::Integer { EXPECT_INTEGER } else { EXPECT_NUMBER });
                        return Err(Stop);
                    }
                }
            }
        };
        Ok((values, spot))
    }

    fn list(&mut self, cx: &mut Context, ty: Type, name: &str, open: Spot) -> Result<(Option<Values>, Spot)> {
        let strings = match ty {
            Type::String | Type::Texture => true,
            Type::Spectrum => matches!(self.peek(cx)?, Some((Kind::String { .. }, _))),
            Type::Bool => {
                let mut values = Vec::new();
                loop {
                    let (kind, spot) = self.required(cx, "`]`")?;
                    if kind == Kind::Close {
                        return Ok((Some(Values::Bools(values)), open));
                    }
                    match bool_of(cx, kind, spot) {
                        Some(value) => values.push(value),
                        None => return Err(Stop),
                    }
                }
            }
            _ => false,
        };
        if strings {
            let mut values = Vec::new();
            let mut first = open;
            loop {
                let (kind, spot) = self.required(cx, "`]`")?;
                match kind {
                    Kind::Close => return Ok((Some(Values::Strings(values)), first)),
                    Kind::String { .. } => {
                        if values.is_empty() {
                            first = spot;
                        }
                        values.push(string_of(cx, kind, spot)?);
                    }
                    _ => {
                        cx.error(spot, format!("`{name}` expects a string in quotes here"));
                        return Err(Stop);
                    }
                }
            }
        }
        // Numbers: leave the tokens aside and read straight off the bytes.
        let mut floats: Vec<f32> = Vec::new();
        let mut ints: Vec<i32> = Vec::new();
        if let Some((kind, spot)) = self.peeked.take() {
            // Only after `spectrum`, whose first token decided what this list is.
            match kind {
                Kind::Close => return Ok((Some(Values::Floats(floats)), open)),
                _ => {
                    let bytes = &cx.source(spot.source).bytes[spot.start..spot.end];
                    match super::number::float(bytes)
                        .filter(|&(_, used)| used == bytes.len())
                        .and_then(|(v, _)| to_f32(v))
                    {
                        Some(value) => floats.push(value),
                        None => {
                            cx.error(spot, EXPECT_NUMBER);
                            return Err(Stop);
                        }
                    }
                }
            }
        }
        let Some(frame) = self.frames.last_mut() else {
            return Err(Stop);
        };
        let result = match ty {
            Type::Integer => frame.cursor.numbers(&mut ints, to_i32, EXPECT_INTEGER),
            _ => frame.cursor.numbers(&mut floats, to_f32, EXPECT_NUMBER),
        };
        match result {
            Ok(()) if ty == Type::Integer => Ok((Some(Values::Ints(ints)), open)),
            Ok(()) => Ok((Some(Values::Floats(floats)), open)),
            Err(error) => Err(lex_error(cx, error)),
        }
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
            return Err(Stop);
        }
        if import && !builder.may_import(cx, at) {
            return Ok(());
        }
        match cx.open(path, path, Some(at)) {
            Some((source, id)) => {
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

const EXPECT_NUMBER: &str = "a number is expected here";
const EXPECT_INTEGER: &str = "a 32-bit integer is expected here";

fn to_f32(value: f64) -> Option<f32> {
    let value = value as f32;
    value.is_finite().then_some(value)
}

fn to_i32(value: f64) -> Option<i32> {
    (value.fract() == 0.0 && value >= f64::from(i32::MIN) && value <= f64::from(i32::MAX)).then_some(value as i32)
}

fn lex_error(cx: &mut Context, (spot, message): LexError) -> Stop {
    let word = cx.text(spot).into_owned();
    if message == EXPECT_NUMBER && matches!(word.as_str(), "nan" | "NaN" | "inf" | "-inf" | "-nan" | "Infinity") {
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

fn bool_of(cx: &mut Context, kind: Kind, spot: Spot) -> Option<bool> {
    let text = cx.text(spot).into_owned();
    match (kind, text.as_str()) {
        (Kind::Word, "true") => Some(true),
        (Kind::Word, "false") => Some(false),
        (Kind::String { .. }, "true" | "false") => {
            cx.error_help(spot, "a bool has no quotes", format!("pbrt-v3 syntax: write {text} without quotes"));
            None
        }
        _ => {
            cx.error_help(spot, "a bool is expected here", "accepted: true, false");
            None
        }
    }
}
