#!/usr/bin/env python3
"""Scenes of many things: 1000 instances of a translucent object (10^8 triangles), 10 000 lights, a medium of 262 144 equal voxels.

    cargo build --release && python3 benches/many.py [instances] [lights] [grid] [--keep DIR] [--spp N] [--program PATH]

Generates each scene with many things and with a single one, renders both and compares time per sample (CPU seconds of the
whole process, set-up taken off by a render of one sample less) and peak memory. Exit code 4 if many cost more than three
times the time per sample of one, or more than 2 GiB.
"""

import argparse
import math
import os
import pathlib
import random
import struct
import sys
import tempfile

LIMIT_RATIO, LIMIT_BYTES = 3.0, 2 << 30
SIZE = (240, 160)


def bumpy_ball(path, rings=224, sectors=224):
    """Writes a closed bumpy ball of 2 (rings - 1) sectors triangles as binary PLY."""
    def radius(theta, phi):
        return 0.42 * (1 + 0.1 * math.sin(5 * phi) * math.sin(theta) ** 3 * math.cos(3 * theta))

    vertices = [(0.0, 0.0, radius(0, 0)), (0.0, 0.0, -radius(math.pi, 0))]
    for i in range(1, rings):
        theta = math.pi * i / rings
        for j in range(sectors):
            phi = 2 * math.pi * j / sectors
            r = radius(theta, phi)
            vertices.append((r * math.sin(theta) * math.cos(phi), r * math.sin(theta) * math.sin(phi), r * math.cos(theta)))
    at = lambda i, j: 2 + (i - 1) * sectors + j % sectors
    faces = []
    for j in range(sectors):
        faces.append((0, at(1, j), at(1, j + 1)))
        faces.append((1, at(rings - 1, j + 1), at(rings - 1, j)))
        for i in range(1, rings - 1):
            faces.append((at(i, j), at(i + 1, j), at(i + 1, j + 1)))
            faces.append((at(i, j), at(i + 1, j + 1), at(i, j + 1)))
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as f:
        f.write(head.encode())
        f.write(b"".join(struct.pack("<3f", *v) for v in vertices))
        f.write(b"".join(struct.pack("<B3i", 3, *t) for t in faces))
    return len(faces)


HEAD = """LookAt {eye} {at} 0 0 1
Camera "perspective" "float fov" {fov}
Film "rgb" "integer xresolution" {w} "integer yresolution" {h}
Sampler "sobol" "integer pixelsamples" 16
WorldBegin
"""
SKY = 'LightSource "infinite" "rgb L" [ .7 .8 1 ]\nLightSource "distant" "point3 from" [ 3 -2 5 ] "rgb L" [ 2 1.9 1.7 ]\n'
GROUND = ('AttributeBegin\nMaterial "diffuse" "rgb reflectance" [ .5 .45 .4 ]\nShape "trianglemesh" "point3 P" '
          "[ -99 -99 0  99 -99 0  99 99 0  -99 99 0 ] \"integer indices\" [ 0 1 2 0 2 3 ]\nAttributeEnd\n")
JADE = 'Material "subsurface" "rgb sigma_a" [ .2 .05 .15 ] "rgb sigma_s" [ 12 12 12 ] "float eta" 1.5\n'


def head(eye, at, fov):
    return HEAD.format(eye=" ".join(map(str, eye)), at=" ".join(map(str, at)), fov=fov, w=SIZE[0], h=SIZE[1])


def instances(folder):
    """Returns names of the scenes with one object and with 1000 instances of it."""
    faces = bumpy_ball(folder / "ball.ply")
    thing = 'Shape "plymesh" "string filename" "ball.ply"\n'
    # Both fill about half of the picture, so that samples are alike.
    one = head((0, -3, 1.6), (0, 0, 0.42), 16.5) + SKY + GROUND + JADE + "Translate 0 0 .42\n" + thing
    (folder / "instances-one.pbrt").write_text(one)
    rng = random.Random(1)
    text = head((-1.5, -6, 5), (8, 9, 0), 42) + SKY + GROUND + JADE + f'ObjectBegin "ball"\n{thing}ObjectEnd\n'
    for i in range(1000):
        x, y = i % 25 * 0.8 + rng.uniform(-0.15, 0.15), i // 25 * 0.8 + rng.uniform(-0.15, 0.15)
        scale = rng.uniform(0.6, 1.1)
        flip = -scale if i % 3 == 0 else scale
        text += (f"AttributeBegin Translate {x:.4f} {y:.4f} {0.4 * scale:.4f} Rotate {rng.uniform(0, 360):.2f} "
                 f"{rng.uniform(-1, 1):.3f} {rng.uniform(-1, 1):.3f} 1 Scale {flip:.4f} {scale:.4f} {scale:.4f} "
                 f'ObjectInstance "ball" AttributeEnd\n')
    (folder / "instances-many.pbrt").write_text(text)
    return "instances-one.pbrt", "instances-many.pbrt", f"1000 instances of {faces} triangles"


def lights(folder):
    """Returns names of the scenes with one light and with 10 000: points, and quads of two triangles."""
    faces = bumpy_ball(folder / "ball.ply")
    thing = JADE + 'AttributeBegin Translate 0 0 .42\nShape "plymesh" "string filename" "ball.ply"\nAttributeEnd\n'
    start = head((0, -3, 1.6), (0, 0, 0.42), 24) + GROUND + thing
    quad = ('AttributeBegin Material "diffuse" Translate {x} {y} {z} Scale {s} {s} 1 AreaLightSource "diffuse" "rgb L" [ {l} {l} {l} ]\n'
            'Shape "trianglemesh" "point3 P" [ -1 -1 0  -1 1 0  1 1 0  1 -1 0 ] "integer indices" [ 0 1 2 0 2 3 ] AttributeEnd\n')
    (folder / "lights-one.pbrt").write_text(start + quad.format(x=0, y=0, z=3, s=1, l=8))
    rng = random.Random(2)
    text = start
    for i in range(10_000):
        x, y, z = (round(v, 4) for v in (rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(2, 4)))
        if i % 2:
            text += quad.format(x=x, y=y, z=z, s=0.02, l=4)
        else:
            text += f'LightSource "point" "point3 from" [ {x} {y} {z} ] "rgb I" [ .002 .002 .002 ]\n'
    (folder / "lights-many.pbrt").write_text(text)
    return "lights-one.pbrt", "lights-many.pbrt", f"10 000 lights over {faces} triangles"


def grid(folder):
    """Returns names of the scenes with a homogeneous ball, and with the same medium as a grid of equal voxels."""
    n = 64
    shell = ('AttributeBegin Translate 0 0 .42 Material "interface" MediumInterface "inside" ""\n'
             'Shape "sphere" "float radius" .4 AttributeEnd\n')
    start = head((0, -3, 1.6), (0, 0, 0.42), 24) + SKY + GROUND
    common = '"rgb sigma_a" [ .2 .5 1 ] "rgb sigma_s" [ 20 20 20 ] "float g" .3\n'
    (folder / "grid-one.pbrt").write_text(start + 'MakeNamedMedium "inside" "string type" "homogeneous" ' + common + shell)
    voxels = " ".join(["1"] * n**3)
    (folder / "grid-many.pbrt").write_text(
        start + f'MakeNamedMedium "inside" "string type" "uniformgrid" "integer nx" {n} "integer ny" {n} "integer nz" {n} '
        f'"point3 p0" [ -.5 -.5 -.1 ] "point3 p1" [ .5 .5 .9 ] "float density" [ {voxels} ] ' + common + shell)
    return "grid-one.pbrt", "grid-many.pbrt", f"a grid of {n}^3 equal voxels against a homogeneous medium"


def run(program, folder, scene, spp, out):
    """Returns CPU seconds and peak bytes of a render."""
    args = [program, "render", str(folder / scene), "--spp", str(spp), "-o", str(folder / out), "-q"]
    pid = os.fork()
    if pid == 0:
        os.execv(args[0], args)
    _, status, usage = os.wait4(pid, 0)
    if status:
        sys.exit(f"{' '.join(args)}: failed with status {status}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", choices=[[], "instances", "lights", "grid"], default=[])
    parser.add_argument("--keep", type=pathlib.Path, help="folder that keeps scenes and pictures")
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--program", default="target/release/moonmilk")
    options = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name, make in {"instances": instances, "lights": lights, "grid": grid}.items():
            if options.what and name not in options.what:
                continue
            one, many, title = make(folder)
            print(title)
            per_sample = {}
            for scene in (one, many):
                picture = scene.replace(".pbrt", ".png")
                base, _ = run(options.program, folder, scene, 1, picture)
                full, peak = run(options.program, folder, scene, options.spp, picture)
                per_sample[scene] = (full - base) / (options.spp - 1)
                print(f"  {scene:22} {per_sample[scene]:8.3f} CPU s per sample of {SIZE[0]} x {SIZE[1]}, "
                      f"{full:7.2f} s in all at {options.spp}, {peak / 2**20:7.0f} MiB at most")
                failed |= peak > LIMIT_BYTES
            ratio = per_sample[many] / per_sample[one]
            failed |= ratio > LIMIT_RATIO
            print(f"  ratio {ratio:.2f} (limit {LIMIT_RATIO})")
    sys.exit(4 if failed else 0)


if __name__ == "__main__":
    main()
