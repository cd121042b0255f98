//! Parameter lists: declarations and typed values.

use super::super::context::Context;
use super::super::lexer::{Kind, Spot};
use super::super::number;
use super::super::params::{Param, Type, Values, did_you_mean};
use super::{Parser, Result, Stop, lex_error, string_of};

pub(super) const EXPECT_NUMBER: &str = "a number is expected here";
const EXPECT_INTEGER: &str = "a 32-bit integer is expected here";

fn to_f32(value: f64) -> Option<f32> {
    let value = value as f32;
    value.is_finite().then_some(value)
}

fn to_i32(value: f64) -> Option<i32> {
    (value.fract() == 0.0 && value >= f64::from(i32::MIN) && value <= f64::from(i32::MAX)).then_some(value as i32)
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

impl Parser {
    /// Reads the parameters that follow.
    pub(super) fn params(&mut self, cx: &mut Context) -> Result<Vec<Param>> {
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
                let name = name.to_owned();
                let color_space = Default::default();
                out.push(Param { ty, name, values, spot: name_spot, type_spot, value, color_space });
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
                let parsed = number::float(bytes).filter(|&(_, used)| used == bytes.len()).map(|(value, _)| value);
                let values = match ty {
                    Type::Integer => parsed.and_then(to_i32).map(|n| Values::Ints(vec![n])),
                    _ => parsed.and_then(to_f32).map(|x| Values::Floats(vec![x])),
                };
                match values {
                    Some(values) => Some(values),
                    None => {
                        // A word where a value should be is most likely the next directive: read on there.
                        if super::DIRECTIVES.contains(&&*cx.text(spot)) {
                            self.peeked = Some((kind, spot));
                        }
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
                    match number::float(bytes).filter(|&(_, used)| used == bytes.len()).and_then(|(v, _)| to_f32(v)) {
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
}
