//! Pictures, combinations, and what is refused.

use super::*;
use crate::material::tests::empty_scene;
use moonmilk_core::WavelengthMode;
use moonmilk_core::glam::Mat4;

fn at(u: f32, v: f32) -> TexturePoint {
    TexturePoint { p: Vec3::new(u, v, 0.5), n: Vec3::Z, uv: Vec2::new(u, v) }
}

fn uv() -> TextureMapping {
    TextureMapping::Uv { scale: Vec2::ONE, delta: Vec2::ZERO }
}

fn picture() -> ImageDescription {
    // Two by two: top row 0, .25; bottom row .5, 1.
    let rgb = [0.0, 0.25, 0.5, 1.0].map(|x| [x, x, x * 0.5]).to_vec();
    ImageDescription { name: "four".into(), width: 2, height: 2, rgb, alpha: vec![] }
}

fn image_texture(wrap: Wrap, scale: f32, invert: bool, bilinear: bool) -> SpectrumTexture {
    SpectrumTexture::Image { image: 0, mapping: uv(), wrap, scale, invert, bilinear }
}

fn red<const N: usize>(w: &Wavelengths<N>, s: Spectrum<N>) -> f32 {
    w.to_rgb(s)[0]
}

#[test]
fn pictures_have_their_origin_below_left_and_wrap_as_told() {
    let mut d = empty_scene();
    d.images.push(picture());
    for wrap in [Wrap::Repeat, Wrap::Black, Wrap::Clamp] {
        d.spectrum_textures.push(image_texture(wrap, 1.0, false, true));
    }
    d.spectrum_textures.push(image_texture(Wrap::Clamp, 1.0, false, false));
    d.spectrum_textures.push(image_texture(Wrap::Clamp, 0.5, true, false));
    let t = Textures::new(&d).unwrap();
    let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
    let value = |id: usize, u: f32, v: f32| red(&w, t.eval_spectrum(id, &at(u, v), &w, Role::Albedo));
    // Rounding of f32 throughout. Texel centres are exact, the middle is the mean.
    assert!((value(0, 0.25, 0.75) - 0.0).abs() < 1e-6 && (value(0, 0.75, 0.25) - 1.0).abs() < 1e-6);
    assert!((value(0, 0.5, 0.5) - 0.4375).abs() < 1e-6);
    assert!((value(0, 1.75, -0.75) - 1.0).abs() < 1e-6, "repeats");
    assert_eq!(value(1, 2.75, 0.25), 0.0, "black outside");
    assert!((value(2, 9.0, -7.0) - 1.0).abs() < 1e-6, "clamps to the corner");
    assert!((value(3, 0.6, 0.4) - 1.0).abs() < 1e-6, "nearest");
    assert!((value(4, 0.6, 0.4) - 0.5).abs() < 1e-6, "scaled, then inverted");
    assert!(
        value(0, f32::NAN, f32::INFINITY).is_nan() || value(0, f32::NAN, 0.0) <= 1.0,
        "odd coordinates do not panic"
    );
}

#[test]
fn combinations_combine() {
    let mut d = empty_scene();
    d.float_textures = vec![
        FloatTexture::Constant(0.25),
        FloatTexture::Constant(0.75),
        FloatTexture::Scale(0, 1),
        FloatTexture::Mix { a: 0, b: 1, amount: 0 },
        FloatTexture::Checkerboard { mapping: uv(), a: 0, b: 1 },
        FloatTexture::Checkerboard { mapping: TextureMapping::Point(Mat4::IDENTITY), a: 0, b: 1 },
    ];
    d.spectrum_textures = vec![
        SpectrumTexture::Constant(SpectrumDescription::Constant(0.2)),
        SpectrumTexture::Constant(SpectrumDescription::Rgb([1.0, 0.5, 0.0])),
        SpectrumTexture::DirectionMix { a: 0, b: 1, dir: Vec3::Z },
        SpectrumTexture::Scale(1, 0),
    ];
    let t = Textures::new(&d).unwrap();
    let f = |id, u, v| t.eval_float(id, &at(u, v));
    assert_eq!((f(2, 0.0, 0.0), f(3, 0.0, 0.0)), (0.1875, 0.375));
    assert_eq!((f(4, 0.5, 0.5), f(4, 1.5, 0.5), f(4, -0.5, 0.5), f(4, -0.5, -0.5)), (0.25, 0.75, 0.75, 0.25));
    assert_eq!((f(5, 0.5, 0.5), f(5, 1.5, 0.5)), (0.25, 0.75));
    let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
    assert_eq!(w.to_rgb(t.eval_spectrum(2, &at(0.0, 0.0), &w, Role::Albedo)), [1.0, 0.5, 0.0]);
    assert_eq!(w.to_rgb(t.eval_spectrum(3, &at(0.0, 0.0), &w, Role::Albedo)), [0.25, 0.125, 0.0]);
    assert_eq!(t.constant_float(2), Some(0.1875));
    // In hero mode an albedo stays in [0, 1] at every wavelength.
    for k in 0..100 {
        let w = Wavelengths::<4>::sample(WavelengthMode::Hero, (k as f32 + 0.5) / 100.0);
        assert!(t.eval_spectrum(1, &at(0.0, 0.0), &w, Role::Albedo).0.iter().all(|x| (0.0..=1.0).contains(x)));
    }
}

#[test]
fn references_to_later_textures_and_missing_pictures_are_refused() {
    let mut d = empty_scene();
    d.float_textures = vec![FloatTexture::Scale(0, 0)];
    assert!(Textures::new(&d).unwrap_err().to_string().contains("not defined before"));
    d.float_textures.clear();
    d.spectrum_textures = vec![image_texture(Wrap::Clamp, 1.0, false, true)];
    assert!(Textures::new(&d).unwrap_err().to_string().contains("does not exist"));
}

#[test]
fn the_octahedral_wrap_turns_each_edge_over_about_its_middle() {
    let mut d = empty_scene();
    d.images.push(picture());
    d.spectrum_textures.push(image_texture(Wrap::Octahedral, 1.0, false, false));
    let t = Textures::new(&d).unwrap();
    let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
    let value = |u: f32, v: f32| red(&w, t.eval_spectrum(0, &at(u, v), &w, Role::Albedo));
    // Left of the top row (0) lies the bottom row's first texel (.5); above the left column (0) the right one's top (.25).
    assert_eq!((value(-0.1, 0.75), value(0.25, 1.1), value(1.1, 0.25), value(0.75, -0.1)), (0.5, 0.25, 0.25, 0.5));
    assert!(value(-9.0, 7.0).is_finite());
}

#[test]
fn mappings_have_pbrts_coordinates() {
    use std::f32::consts::FRAC_1_SQRT_2;
    let p = Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2);
    let c = |m: TextureMapping, p: Vec3| coordinates(&m, &TexturePoint { p, n: Vec3::Z, uv: Vec2::new(0.25, 0.5) });
    let close = |a: Vec2, b: Vec2| (a - b).length() < 1e-6;
    // theta = 45, phi = 90 degrees.
    assert!(close(c(TextureMapping::Spherical(Mat4::IDENTITY), p), Vec2::new(0.25, 0.25)));
    assert!(close(c(TextureMapping::Cylindrical(Mat4::IDENTITY), p), Vec2::new(0.75, FRAC_1_SQRT_2)));
    let moved = Mat4::from_translation(-Vec3::X);
    let planar =
        |m| TextureMapping::Planar { to_texture: m, v1: Vec3::X * 2.0, v2: Vec3::Z, delta: Vec2::new(0.1, 0.2) };
    assert!(close(c(planar(moved), Vec3::new(3.0, 9.0, 5.0)), Vec2::new(4.1, 5.2)));
    let uv = TextureMapping::Uv { scale: Vec2::new(2.0, 4.0), delta: Vec2::new(0.5, 0.0) };
    assert!(close(c(uv, p), Vec2::new(1.0, 2.0)));
}

#[test]
fn textures_by_formula_are_evaluated_in_their_own_space() {
    let mut d = empty_scene();
    let m = Mat4::from_scale(Vec3::splat(3.0)) * Mat4::from_translation(Vec3::Y);
    d.float_textures = vec![
        FloatTexture::Constant(0.25),
        FloatTexture::Constant(0.75),
        FloatTexture::Fbm { to_texture: m, octaves: 3, roughness: 0.6 },
        FloatTexture::Wrinkled { to_texture: m, octaves: 3, roughness: 0.6 },
        FloatTexture::Windy(m),
        FloatTexture::Bilerp { mapping: uv(), v: [1.0, 2.0, 3.0, 5.0] },
        FloatTexture::Dots { mapping: uv(), inside: 0, outside: 1 },
        FloatTexture::DirectionMix { a: 0, b: 1, dir: Vec3::Z },
    ];
    d.spectrum_textures = vec![
        SpectrumTexture::Constant(SpectrumDescription::Constant(0.2)),
        SpectrumTexture::Constant(SpectrumDescription::Constant(0.6)),
        SpectrumTexture::Bilerp { mapping: uv(), v: [0, 0, 1, 1] },
        SpectrumTexture::Dots { mapping: uv(), inside: 0, outside: 1 },
        SpectrumTexture::Marble { to_texture: m, octaves: 4, roughness: 0.5, scale: 2.0, variation: 0.3 },
    ];
    let t = Textures::new(&d).unwrap();
    let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
    let mut seen = [0; 2];
    for k in 0..400 {
        let at = at((k % 20) as f32 * 0.37, (k / 20) as f32 * 0.41);
        let q = m.transform_point3(at.p);
        assert_eq!(t.eval_float(2, &at), noise::fbm(q, 0.6, 3));
        assert_eq!(t.eval_float(3, &at), noise::turbulence(q, 0.6, 3));
        assert_eq!(t.eval_float(4, &at), procedural::waves(q));
        let dot = procedural::in_dot(at.uv);
        seen[usize::from(dot)] += 1;
        assert_eq!(t.eval_float(6, &at), if dot { 0.25 } else { 0.75 });
        assert_eq!(w.to_rgb(t.eval_spectrum(3, &at, &w, Role::Albedo))[0], if dot { 0.2 } else { 0.6 });
        let marble = w.to_rgb(t.eval_spectrum(4, &at, &w, Role::Albedo));
        let expected = procedural::marble(q * 2.0, 0.5, 4, 0.3);
        assert!(marble.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{marble:?} {expected:?}");
    }
    assert!(seen.iter().all(|&n| n > 50), "{seen:?}");
    assert_eq!((t.eval_float(5, &at(0.5, 0.5)), t.eval_float(7, &at(0.0, 0.0))), (2.75, 0.75));
    let half = w.to_rgb(t.eval_spectrum(2, &at(0.3, 0.5), &w, Role::Albedo))[0];
    assert!((half - 0.4).abs() < 1e-6, "{half}");
}
