//! Tests of the PLY reader.

use moonmilk_core::{Vec2, Vec3};

use super::{Error, read};

const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar quality\nproperty double s\nproperty double t\nelement face 2\nproperty list uchar int vertex_indices\nelement edge 1\nproperty list uchar short ends\nend_header\n";

fn ascii(body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\ncomment made by hand\n{HEADER}{body}").into_bytes()
}

const BODY: &str = "0 0 0 1 0 0\n1 0 0 2 1 0\n1 1 0 3 1 1\n0 1 0 4 0 1\n3 0 1 2\n4 0 1 2 3\n2 5 6\n";

/// The same mesh in binary.
fn binary(big: bool) -> Vec<u8> {
    let mut out =
        format!("ply\nformat binary_{}_endian 1.0\n{HEADER}", if big { "big" } else { "little" }).into_bytes();
    macro_rules! put {
        ($value:expr) => {
            out.extend(if big { $value.to_be_bytes() } else { $value.to_le_bytes() })
        };
    }
    for (i, (x, y)) in [(0.0f64, 0.0f64), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].into_iter().enumerate() {
        put!((x as f32));
        put!((y as f32));
        put!(0.0f32);
        out.push(i as u8 + 1);
        put!(x);
        put!(y);
    }
    for face in [&[0i32, 1, 2][..], &[0, 1, 2, 3]] {
        out.push(face.len() as u8);
        for &v in face {
            put!(v);
        }
    }
    out.push(2);
    put!(5i16);
    put!(6i16);
    out
}

#[test]
fn all_three_formats_give_the_same_mesh() {
    let mesh = read(&ascii(BODY)).expect("a mesh");
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    assert!(mesh.normals.is_empty());
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    assert_eq!(read(&binary(false)).expect("little endian"), mesh);
    assert_eq!(read(&binary(true)).expect("big endian"), mesh);
}

#[test]
fn errors_name_the_element() {
    let text = |bytes: &[u8]| read(bytes).expect_err("an error").to_string();
    assert_eq!(text(&ascii(&BODY.replacen("1 1 0 3", "1 nan 0 3", 1))), "vertex 2: coordinate is NaN");
    assert_eq!(text(&ascii(&BODY.replacen("3 0 1 2", "3 0 1 9", 1))), "face 0: there is no vertex 9 (of 4)");
    assert_eq!(text(&ascii(&BODY.replacen("3 0 1 2", "2 0 1", 1))), "face 0: 2 vertices make no face");
    assert_eq!(text(&ascii("0 0 0 1 0 0\n1 0")), "the file ends within vertex 1 of 4");
    assert_eq!(text(b"obj\n"), "is not a PLY file: its first line is not `ply`");
    assert_eq!(
        text(b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n"),
        "line 3 of the header: `many` is no number of elements"
    );
    assert_eq!(text(b"ply\nformat ascii 1.0\nelement face 0\nend_header\n"), "it has no element `vertex`");
    let short = binary(false);
    assert!(matches!(read(&short[..short.len() - 20]), Err(Error::Truncated { .. })));
}

#[test]
fn promises_of_a_header_reserve_no_memory() {
    for count in ["1000000000", "4294967295", "18446744073709551615"] {
        for format in ["ascii", "binary_little_endian"] {
            let vertex = format!(
                "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0 0"
            );
            assert!(read(vertex.as_bytes()).is_err());
            let face = format!(
                "ply\nformat {format} 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face {count}\nproperty list uint int vertex_index\nend_header\n\u{7f}\u{7f}\u{7f}\u{7f}0 0 0 0"
            );
            assert!(read(face.as_bytes()).is_err());
            let other = format!(
                "ply\nformat {format} 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement nothing {count}\nelement list {count}\nproperty list uchar char a\nend_header\n0"
            );
            assert!(read(other.as_bytes()).is_err());
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let mut state = 0x2545_f491_4f6c_dd1du64;
    let mut roll = |n: usize| {
        // xorshift64 [Marsaglia2003].
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % n.max(1) as u64) as usize
    };
    let seeds = [ascii(BODY), binary(false), binary(true)];
    let mut failed = 0;
    for round in 0..20_000 {
        let mut bytes = seeds[round % 3].clone();
        for _ in 0..1 + roll(3) {
            let at = roll(bytes.len());
            match roll(4) {
                0 => bytes[at] = roll(256) as u8,
                1 => bytes.truncate(at.max(1)),
                2 => drop(bytes.splice(at..at, *b"999999999")),
                _ => bytes[at] = bytes[roll(bytes.len())],
            }
        }
        failed += usize::from(read(&bytes).is_err());
    }
    // The mutations must reach both outcomes, else they test nothing.
    assert!(failed > 2000 && failed < 19_900, "{failed}");
}
