//! Shapes and lights as files describe them, also wrong ones.

use super::*;
use crate::lights::{LightError, Placed, Surface, surfaces_of};

#[test]
fn fronts_follow_reversal_mirrors_and_vertex_normals() {
    let triangle = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let front = |reverse: bool, m: Mat4, normals: Vec<Vec3>| {
        let geometry =
            GeometryDescription::Mesh { positions: triangle.clone(), normals, uvs: vec![], indices: vec![[0, 1, 2]] };
        let mut s = shape(geometry, m, area_light(1.0, false));
        s.reverse_orientation = reverse;
        match &surfaces_of(&s).expect("valid")[0] {
            Surface::Triangle { front, .. } => *front,
            other => panic!("{other:?}"),
        }
    };
    let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    assert_eq!(front(false, Mat4::IDENTITY, vec![]), Vec3::Z);
    assert_eq!(front(true, Mat4::IDENTITY, vec![]), -Vec3::Z);
    assert_eq!(front(false, mirror, vec![]), Vec3::Z);
    assert_eq!(front(false, Mat4::IDENTITY, vec![-Vec3::Z; 3]), -Vec3::Z);
    assert_eq!(front(true, Mat4::IDENTITY, vec![-Vec3::Z; 3]), Vec3::Z);
    assert_eq!(front(false, mirror, vec![Vec3::Z; 3]), Vec3::Z);
}

#[test]
fn input_that_cannot_be_a_light_is_an_error() {
    let mut scene = empty();
    scene.shapes.push(shape(sphere(1.0), Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0)), area_light(1.0, false)));
    assert!(matches!(Lights::of_scene(&scene), Err(LightError::Shape { .. })));
    let mut scene = empty();
    scene.images.push(ImageDescription {
        name: "flat".into(),
        width: 2,
        height: 1,
        rgb: vec![[1.0; 3]; 2],
        alpha: vec![],
    });
    scene.lights.push(light(LightKind::Environment { image: 0 }));
    assert!(matches!(Lights::of_scene(&scene), Err(LightError::NotSquare { .. })));
    let mut scene = empty();
    let irradiance = SpectrumDescription::Rgb([1.0; 3]);
    scene.lights.push(light(LightKind::Distant { from: Vec3::X, to: Vec3::X, irradiance }));
    assert!(matches!(Lights::of_scene(&scene), Err(LightError::Direction { .. })));
    let nothing = Lights::of_scene(&empty()).expect("valid");
    assert!(nothing.is_empty() && nothing.sample(Vec3::ZERO, None, &grey(), [0.5; 3]).is_none());
    assert_eq!(nothing.pdf_environment(Vec3::ZERO, None, Vec3::Z), 0.0);
}

#[test]
fn a_light_at_the_reference_point_breaks_nothing() {
    let lights = Lights::of_scene(&everything()).expect("valid");
    let mut r = Stream::new(&[50]);
    for placed in &lights.placed {
        let p = match placed {
            Placed::Punctual(lamp) => lamp.position(),
            Placed::Surface { surface: Surface::Triangle { p, .. }, .. } => p[0].lerp(p[1], 0.5),
            Placed::Surface { surface: Surface::Sphere { center, .. } | Surface::Disk { center, .. }, .. } => *center,
            Placed::Surface { surface: Surface::Quadric { form, .. }, .. } => form.sample_point([0.3, 0.6]).0.as_vec3(),
        };
        for n in [None, Some(direction(&mut r))] {
            for _ in 0..100 {
                if let Some(s) = lights.sample(p, n, &grey(), uniform3(&mut r)) {
                    assert!(
                        s.pdf > 0.0
                            && s.pdf.is_finite()
                            && s.radiance.is_finite()
                            && s.wi.is_finite()
                            && s.distance > 0.0
                    );
                }
            }
        }
    }
}
