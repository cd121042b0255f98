//! The header: format, elements and their properties, and how numbers lie in the data.

use super::Error;

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Scalar> {
        Some(match name {
            "char" | "int8" => Scalar::I8,
            "uchar" | "uint8" => Scalar::U8,
            "short" | "int16" => Scalar::I16,
            "ushort" | "uint16" => Scalar::U16,
            "int" | "int32" => Scalar::I32,
            "uint" | "uint32" => Scalar::U32,
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// The number at the start of `bytes`, which must be long enough.
    #[inline]
    pub(super) fn read(self, bytes: &[u8], big: bool) -> f64 {
        macro_rules! number {
            ($type:ty, $n:literal) => {{
                let raw: [u8; $n] = bytes[..$n].try_into().expect("the slice has this length");
                f64::from(if big { <$type>::from_be_bytes(raw) } else { <$type>::from_le_bytes(raw) })
            }};
        }
        match self {
            Scalar::I8 => f64::from(bytes[0] as i8),
            Scalar::U8 => f64::from(bytes[0]),
            Scalar::I16 => number!(i16, 2),
            Scalar::U16 => number!(u16, 2),
            Scalar::I32 => number!(i32, 4),
            Scalar::U32 => number!(u32, 4),
            Scalar::F32 => number!(f32, 4),
            Scalar::F64 => number!(f64, 8),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    pub(super) fn truncated(&self, index: u64) -> Error {
        Error::Truncated { element: self.name.clone(), index, count: self.count }
    }

    pub(super) fn fault(&self, index: u64, reason: impl Into<String>) -> Error {
        Error::Value { element: self.name.clone(), index, reason: reason.into() }
    }

    /// Bytes of one element in a binary file, if all have the same number.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties.iter().map(|p| if let Kind::Scalar(s) = p.kind { Some(s.size()) } else { None }).sum()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    Little,
    Big,
}

/// Longest header that is read [bytes].
const MAX_HEADER: usize = 1 << 20;

pub(super) fn header(bytes: &[u8]) -> Result<(Format, Vec<Element>, usize), Error> {
    let fault = |line: usize, reason: &str| Error::Header { line, reason: reason.into() };
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    let (mut at, mut number) = (0, 0);
    loop {
        number += 1;
        let rest = &bytes[at..bytes.len().min(MAX_HEADER)];
        let Some(length) = rest.iter().position(|&b| b == b'\n') else {
            return Err(if number == 1 { Error::NotPly } else { fault(number, "the file ends without `end_header`") });
        };
        let line = String::from_utf8_lossy(&rest[..length]).trim().to_owned();
        at += length + 1;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            _ if number == 1 => {
                if line != "ply" {
                    return Err(Error::NotPly);
                }
            }
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _] => {
                format = Some(match *name {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => {
                        return Err(fault(
                            number,
                            &format!("`{name}` is no format (ascii, binary_little_endian, binary_big_endian)"),
                        ));
                    }
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| fault(number, &format!("`{count}` is no number of elements")))?;
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", count, item, name] => {
                let (Some(count), Some(item)) = (Scalar::parse(count), Scalar::parse(item)) else {
                    return Err(fault(number, "unknown type of number"));
                };
                if matches!(count, Scalar::F32 | Scalar::F64) {
                    return Err(fault(number, "the length of a list is an integer"));
                }
                let Some(element) = elements.last_mut() else {
                    return Err(fault(number, "a property before the first element"));
                };
                element.properties.push(Property { name: (*name).to_owned(), kind: Kind::List { count, item } });
            }
            ["property", kind, name] => {
                let Some(kind) = Scalar::parse(kind) else {
                    return Err(fault(number, &format!("`{kind}` is no type of number")));
                };
                let Some(element) = elements.last_mut() else {
                    return Err(fault(number, "a property before the first element"));
                };
                element.properties.push(Property { name: (*name).to_owned(), kind: Kind::Scalar(kind) });
            }
            ["end_header"] => break,
            _ => return Err(fault(number, &format!("`{line}` is not understood"))),
        }
    }
    Ok((format.ok_or_else(|| fault(number, "no `format` line"))?, elements, at))
}
