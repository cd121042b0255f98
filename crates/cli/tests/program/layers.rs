//! What is recorded beside the picture, crops, single pixels, and samples that must not reach the film.

use moonmilk_io::image::{Value, Window};

use crate::common::{BALL, FLOOR, Folder, LIGHTS, channel, head, text};

const SIZE: [usize; 2] = [36, 28];
const SPP: u32 = 64;

fn scene() -> Folder {
    Folder::with_scene(&[&head([SIZE[0] as u32, SIZE[1] as u32], SPP), LIGHTS, FLOOR, BALL])
}

/// Largest error of a mean by rounding single samples to the film's quantum, with the rounding of f32.
fn rounding(x: f32) -> f32 {
    2f32.powi(-22) + 2.0 * f32::EPSILON * x.abs()
}

#[test]
fn all_layers_are_there_and_mean_what_they_say() {
    let f = scene();
    for wavelengths in ["hero", "rgb"] {
        f.succeed(&format!("render scene.pbrt --aov all --wavelengths {wavelengths} -o a.exr"));
        let p = f.picture("a.exr");
        let rgb = ["R", "G", "B"];
        let layer = |name: &str| rgb.map(|c| channel(&p, &format!("{name}.{c}")));
        let colour = rgb.map(|c| channel(&p, c));
        assert_eq!(p.channels.len(), 3 + 3 + 3 + 1 + 3 + 3 + 9 + 3 + 3);
        let (albedo, variance) = (layer("Albedo"), layer("Variance"));
        // Means over blocks are alike within a block, and no noisier than pixels are on the mean.
        let blocks = layer("BlockVariance");
        assert!((0..3).all(|c| blocks[c][0] == blocks[c][1] && blocks[c].iter().all(|v| *v >= 0.0)));
        assert!((0..3).all(|c| blocks[c].iter().sum::<f32>() < variance[c].iter().sum::<f32>()));
        let normal = ["Ns.X", "Ns.Y", "Ns.Z"].map(|c| channel(&p, c));
        let depth = channel(&p, "Depth.Z");
        let (subsurface, diffuse) = (layer("Subsurface"), layer("Diffuse"));
        let orders = [layer("Scatter0"), layer("Scatter1"), layer("Scatter2")];
        let (mut least, mut most, mut flat) = (f32::INFINITY, 0f32, 0);
        for i in 0..SIZE[0] * SIZE[1] {
            let length = normal.iter().map(|n| n[i] * n[i]).sum::<f32>().sqrt();
            assert!(length <= 1.0 + 1e-6 && depth[i] >= 0.0);
            // Where every sample sees the floor the mean normal is that of the floor.
            if normal[1][i] > 0.999_99 {
                assert!((length - 1.0).abs() < 1e-5);
                flat += 1;
            }
            for c in 0..3 {
                least = least.min(albedo[c][i]);
                most = most.max(albedo[c][i]);
                let x = colour[c][i];
                let sum: f32 = orders.iter().map(|o| o[c][i]).sum();
                assert!((sum - x).abs() <= 4.0 * rounding(x), "orders at {i}: {sum} {x}");
                let sum = subsurface[c][i] + diffuse[c][i];
                assert!((sum - x).abs() <= 3.0 * rounding(x), "parts at {i}: {sum} {x}");
                assert!(variance[c][i] >= 0.0);
            }
        }
        println!("{wavelengths}: albedo {least} to {most}, {flat} pixels of floor");
        assert!(least >= 0.0 && most <= 1.0 + rounding(1.0), "{wavelengths}: albedo {least} to {most}");
        assert!(flat > 100, "{flat}");
        // The centre: the ball, whose near point is at about 4.12 - 0.9 from the camera, seen face on.
        let centre = SIZE[0] / 2 + SIZE[1] / 2 * SIZE[0];
        let length = normal.iter().map(|n| n[centre] * n[centre]).sum::<f32>().sqrt();
        assert!((3.2..3.3).contains(&depth[centre]) && length > 0.99, "{} {length}", depth[centre]);
        assert!(subsurface[0][centre] > 0.0 && albedo[0][centre] > albedo[2][centre], "redder as it absorbs less");
        assert_eq!(p.attributes.get("moonmilk.varianceSamples"), Some(&Value::Int(8)));
        assert_eq!(text(&p, "moonmilk.spp"), SPP.to_string());
    }
    // Fewer samples than scramblings: as many parts as samples.
    f.succeed("render scene.pbrt --spp 3 --aov variance -o few.exr");
    assert_eq!(f.picture("few.exr").attributes.get("moonmilk.varianceSamples"), Some(&Value::Int(3)));
    f.succeed("render scene.pbrt --spp 1 --aov variance -o one.exr");
    assert_eq!(f.picture("one.exr").attributes.get("moonmilk.varianceSamples"), None);
}

#[test]
fn layers_of_radiance_share_the_factor_of_the_film() {
    let f = scene();
    let text = String::from_utf8(f.bytes("scene.pbrt")).expect("text");
    f.write("bright.pbrt", text.replace("Film \"rgb\"", "Film \"rgb\" \"float iso\" 250"));
    f.succeed("render scene.pbrt --aov order,albedo --spp 4 -o a.exr");
    f.succeed("render bright.pbrt --aov order,albedo --spp 4 -o b.exr");
    let (a, b) = (f.picture("a.exr"), f.picture("b.exr"));
    for (name, factor) in [("R", 2.5), ("Scatter2.G", 2.5), ("Albedo.B", 1.0)] {
        for (x, y) in channel(&a, name).iter().zip(channel(&b, name)) {
            assert!((x * factor - y).abs() <= 2.0 * rounding(*y), "{name}: {x} {y}");
        }
    }
    // A replayed pixel is that of the picture.
    assert_replay(&f, "bright.pbrt", "b.exr", 4, [18, 14]);
}

/// Checks that the mean of the samples that `--pixel` prints is the pixel.
fn assert_replay(f: &Folder, scene: &str, picture: &str, spp: u32, [x, y]: [usize; 2]) {
    let r = f.succeed(&format!("render {scene} --spp {spp} --pixel {x},{y}"));
    let rows: Vec<Vec<f64>> =
        r.stdout.lines().skip(1).map(|l| l.split(',').map(|v| v.parse().expect("a number")).collect()).collect();
    assert_eq!(rows.len(), spp as usize);
    let p = f.picture(picture);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let mean = rows.iter().map(|r| r[1 + c]).sum::<f64>() / f64::from(spp);
        let pixel = channel(&p, name)[(x - p.offset[0] as usize) + (y - p.offset[1] as usize) * p.width];
        assert!((mean as f32 - pixel).abs() <= 3.0 * rounding(pixel), "{name} at {x},{y}: {mean} {pixel}");
    }
}

#[test]
fn a_crop_is_a_part_of_the_whole_and_a_pixel_is_a_sample_of_it() {
    let f = scene();
    f.succeed("render scene.pbrt --spp 8 -o a.exr");
    f.succeed("render scene.pbrt --spp 8 --crop 7,30,5,26 -o b.exr");
    let (a, b) = (f.picture("a.exr"), f.picture("b.exr"));
    assert_eq!(b.window(), Window { x: 7, y: 5, width: 23, height: 21 });
    assert_eq!(b.display, Window { x: 0, y: 0, width: SIZE[0], height: SIZE[1] });
    for name in ["R", "G", "B"] {
        for y in 5..26 {
            let whole = &channel(&a, name)[y * SIZE[0] + 7..y * SIZE[0] + 30];
            assert_eq!(whole, &channel(&b, name)[(y - 5) * 23..(y - 4) * 23]);
        }
    }
    for pixel in [[7, 5], [18, 14], [29, 25]] {
        assert_replay(&f, "scene.pbrt", "b.exr", 8, pixel);
    }
    // Later samples have as many paths as the whole picture's noise says.
    f.succeed("render scene.pbrt --spp 12 -o c.exr");
    for pixel in [[7, 5], [18, 14], [29, 25]] {
        assert_replay(&f, "scene.pbrt", "c.exr", 12, pixel);
    }
}

#[test]
fn png_takes_the_picture_without_layers_and_says_so() {
    let f = scene();
    let r = f.succeed("render scene.pbrt --spp 2 --aov all -o a.png");
    assert!(f.bytes("a.png").starts_with(b"\x89PNG") && r.stderr.contains("no layers"), "{r:?}");
    // Resuming into a PNG file works from the same sums.
    f.succeed("render scene.pbrt --spp 4 --aov all --resume -o a.png");
    f.succeed("render scene.pbrt --spp 4 -o b.png");
    assert!(f.bytes("a.png") == f.bytes("b.png"));
}

#[test]
fn samples_beyond_the_film_are_counted_told_and_kept_out() {
    // The disk above is seen in the upper part of the picture, and its light on the floor.
    let f = scene();
    let text = String::from_utf8(f.bytes("scene.pbrt")).expect("text");
    for (name, radiance) in [("large", "1e30"), ("infinite", "3e38")] {
        f.write("hot.pbrt", text.replace("[6 5 4]", &format!("[{radiance} {radiance} {radiance}]")));
        let r = f.succeed("render hot.pbrt --spp 4 --aov all --stats -o a.exr");
        let p = f.picture("a.exr");
        for c in p.channels.iter().filter(|c| !c.name.starts_with("Variance")) {
            assert!(c.data.iter().all(|x| x.is_finite()), "{name}: {}", c.name);
        }
        assert!(channel(&p, "Variance.R").iter().all(|v| v.is_finite()));
        let counted = r.stdout.lines().find_map(|l| l.strip_prefix("invalid, endless    ")).expect("a figure");
        let n: u64 = counted.split(',').next().and_then(|n| n.parse().ok()).expect("a number");
        assert!(n > 0 && r.stderr.contains(&format!("{n} samples were not finite")), "{name}: {r:?}");
        // The message tells how to see one again.
        let (_, rest) = r.stderr.split_once(": pixel ").expect("an example");
        let words: Vec<&str> = rest.split_whitespace().collect();
        let sample: u64 = words[2].parse().expect("a sample number");
        let replay = f.succeed(&format!("render hot.pbrt --pixel {} --samples {sample}..{}", words[0], sample + 1));
        assert!(replay.stdout.lines().nth(1).is_some_and(|l| l.ends_with(",0")), "{replay:?}");
    }
}
