//! Decimal numbers from bytes, fast: a scene of inline meshes is mostly numbers.

/// Powers of ten that a double holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The number that `bytes` start with, and how many bytes it takes; `None` if they start with none.
///
/// Up to 19 digits are gathered in an integer; if it fits 53 bits and the power of ten is exact (Clinger's fast path),
/// one multiplication or division gives the correctly rounded double. Everything else goes to the standard library.
#[inline]
pub(crate) fn float(bytes: &[u8]) -> Option<(f64, usize)> {
    let mut i = 0;
    let negative = bytes.first() == Some(&b'-');
    if negative || bytes.first() == Some(&b'+') {
        i = 1;
    }
    let start = i;
    let (mut mantissa, mut exponent, mut dropped) = (0u64, 0i32, false);
    while let Some(digit) = digit(bytes, i) {
        if mantissa < 1_000_000_000_000_000_000 {
            mantissa = mantissa * 10 + digit;
        } else {
            exponent = exponent.saturating_add(1);
            dropped = true;
        }
        i += 1;
    }
    let mut digits = i - start;
    if bytes.get(i) == Some(&b'.') {
        i += 1;
        let fraction = i;
        while let Some(digit) = digit(bytes, i) {
            if mantissa < 1_000_000_000_000_000_000 {
                mantissa = mantissa * 10 + digit;
                exponent = exponent.saturating_sub(1);
            } else {
                dropped = true;
            }
            i += 1;
        }
        digits += i - fraction;
    }
    if digits == 0 {
        return None;
    }
    if matches!(bytes.get(i), Some(b'e' | b'E')) {
        let mut j = i + 1;
        let minus = bytes.get(j) == Some(&b'-');
        if minus || bytes.get(j) == Some(&b'+') {
            j += 1;
        }
        let first = j;
        let mut e = 0i32;
        while let Some(digit) = digit(bytes, j) {
            e = e.saturating_mul(10).saturating_add(digit as i32);
            j += 1;
        }
        if j > first {
            exponent = exponent.saturating_add(if minus { -e } else { e });
            i = j;
        }
    }
    let value = if !dropped && mantissa < (1 << 53) && exponent.unsigned_abs() <= 22 {
        let power = POWERS[exponent.unsigned_abs() as usize];
        if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power }
    } else {
        std::str::from_utf8(&bytes[start..i]).ok()?.parse().ok()?
    };
    Some((if negative { -value } else { value }, i))
}

#[inline]
fn digit(bytes: &[u8], i: usize) -> Option<u64> {
    let digit = bytes.get(i)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

/// Whether a number, word or bracket may end before this byte (`None`: end of the file).
#[inline]
pub(crate) fn delimits(byte: Option<&u8>) -> bool {
    matches!(byte, None | Some(b' ' | b'\n' | b'\t' | b'\r' | b'"' | b'[' | b']' | b'#'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_equal_those_of_the_standard_library() {
        let words = [
            "0",
            "-0",
            "1",
            ".5",
            "5.",
            "+3",
            "-12.25",
            "1e3",
            "1E-3",
            "6.02214076e23",
            "3.4028235e38",
            "1e-45",
            "0.1234567890123456789012345",
            "123456789012345678901234567890",
            "9007199254740993",
            "2.2250738585072014e-308",
        ];
        for word in words {
            let (value, used) = float(word.as_bytes()).expect("a number");
            assert_eq!(used, word.len(), "{word}");
            assert_eq!(value.to_bits(), word.parse::<f64>().expect("a number").to_bits(), "{word}");
        }
    }

    #[test]
    fn what_is_no_number_is_refused_and_trailing_text_is_left() {
        for word in ["", "-", ".", "e5", "nan", "inf", "abc"] {
            assert_eq!(float(word.as_bytes()), None, "{word}");
        }
        assert_eq!(float(b"1e+"), Some((1.0, 1)));
        assert_eq!(float(b"2.5]"), Some((2.5, 3)));
    }
}
