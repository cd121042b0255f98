#!/usr/bin/env python3
"""Measures how the cost of a path grows with the optical thickness of a body, for walks flight by flight and by jumps.

  python3 benches/growth.py                 table on standard output (about fifteen minutes)
  python3 benches/growth.py --quick         three albedos of five
  python3 benches/growth.py --write         also writes docs/growth.svg
  python3 benches/growth.py --g 0.9         where scattering is forward: exits of balls are simulated for every four samples, which is part of the time

A ball, a slab and the dragon (skipped without ../shared) under uniform light, optical thickness sigma_t 4 V / S of 10 to 10 000, albedo of scattering .9 to .99999.
Time is CPU time per path that enters, on one thread: the difference of two runs, so that reading, building and tables are left out. What is asked for:
by jumps at most twice the time per tenfold thickness beyond 10. Walks flight by flight are left out once a path has taken a tenth of a millisecond.
"""
import argparse, os, re, subprocess, sys, tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PROGRAM = os.environ.get("MOONMILK") or os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release", "moonmilk")
DRAGON = os.path.join(ROOT, "..", "shared", "meshes", "dragon30.ply")
SIDE = 128
THICKNESSES = [10, 100, 1000, 10000]
ALBEDOS = [0.9, 0.99, 0.999, 0.9999, 0.99999]
# Mean chords 4 V / S; the dragon's is measured by `moonmilk check` when the script runs.
BALL = 'Shape "sphere" "float radius" [1]'
SLAB = ('Shape "trianglemesh" "point3 P" [-50 -50 -.5 50 -50 -.5 50 50 -.5 -50 50 -.5 -50 -50 .5 50 -50 .5 50 50 .5 -50 50 .5] '
        '"integer indices" [0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7]')


def scene(shape, eye, half, sigma_t, albedo, eta, g=0):
    sigma_s, sigma_a = sigma_t * albedo, sigma_t * (1 - albedo)
    boundary = f'Material "dielectric" "float eta" [{eta}]' if eta != 1 else 'Material "interface"'
    return f'''LookAt {eye} 0 0 0 0 1 0
Camera "orthographic" "float screenwindow" [{-half} {half} {-half} {half}]
Film "rgb" "integer xresolution" [{SIDE}] "integer yresolution" [{SIDE}] "string filename" "g.exr"
Sampler "independent" "integer pixelsamples" [1]
Integrator "volpath" "integer maxdepth" [100000]
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
MakeNamedMedium "m" "string type" "homogeneous" "rgb sigma_a" [{sigma_a} {sigma_a} {sigma_a}] "rgb sigma_s" [{sigma_s} {sigma_s} {sigma_s}] "float g" [{g}]
AttributeBegin
MediumInterface "m" ""
{boundary}
{shape}
AttributeEnd
'''


def run(path, walk, spp):
    r = subprocess.run([PROGRAM, "-q", "render", path, "--spp", str(spp), "--walk", walk, "--wavelengths", "mono", "--threads", "1", "--stats",
                        "--checkpoint-every", "0", "-o", path + ".exr"], capture_output=True, text=True)
    if r.returncode:
        sys.exit(f"FAILED: {path} {walk}\n{r.stderr}")
    number = lambda pattern: float(re.search(pattern, r.stdout)[1])
    return number(r"samples .* in ([\d.]+) s"), number(r"closed bodies +(\d+)"), number(r"collisions +(\d+)"), number(r"(\d+) jumps")


def cost(path, walk, seconds):
    """Microseconds, events (collisions and jumps) per path that enters."""
    n, least = 1, run(path, walk, 1)
    while True:
        more = run(path, walk, 3 * n)
        if more[0] - least[0] > seconds or n > 200:
            t, entered, collisions, jumps = (b - a for a, b in zip(least, more))
            return 1e6 * t / entered, (collisions + jumps) / entered
        n, least = 3 * n, more


def chord(path):
    r = subprocess.run([PROGRAM, "check", path], capture_output=True, text=True)
    found = re.search(r"4V/S ([\d.]+)", r.stdout)
    return float(found[1]) if found else None


def svg(rows, path):
    """Time against thickness on logarithmic axes, one panel per body."""
    import math
    bodies = list(dict.fromkeys(r[0] for r in rows))
    width, height, left, top = 300, 260, 62, 34
    low, high = -0.5, 3.5
    x = lambda tau: left + (math.log10(tau) - 1) / 3 * (width - 30)
    y = lambda us: top + (high - math.log10(us)) / (high - low) * height
    colour = {"classic": "#b4532a", "jump": "#23659e"}
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {len(bodies) * (width + 40) + 40} {height + 110}" font-family="sans-serif" font-size="12">',
           '<rect width="100%" height="100%" fill="#fff"/>']
    for b, body in enumerate(bodies):
        out.append(f'<g transform="translate({b * (width + 40)} 0)"><text x="{left}" y="20" font-size="14">{body}</text>')
        for d in range(0, 4):
            out.append(f'<path d="M{left} {y(10**d):.1f}H{left + width - 30}" stroke="#ddd"/>')
            if b == 0:
                out.append(f'<text x="{left - 8}" y="{y(10**d) + 4:.1f}" text-anchor="end">{10**d}</text>')
        for tau in THICKNESSES:
            out.append(f'<text x="{x(tau):.1f}" y="{top + height + 18}" text-anchor="middle">{tau}</text>')
        out.append(f'<text x="{left + width / 2 - 15}" y="{top + height + 38}" text-anchor="middle">optical thickness</text>')
        for walk in colour:
            for albedo in ALBEDOS:
                line = [(x(r[1]), y(r[4])) for r in rows if r[0] == body and r[2] == albedo and r[3] == walk]
                if line:
                    shade = 0.35 + 0.65 * ALBEDOS.index(albedo) / (len(ALBEDOS) - 1)
                    points = " ".join(f"{a:.1f},{c:.1f}" for a, c in line)
                    out.append(f'<polyline points="{points}" fill="none" stroke="{colour[walk]}" stroke-opacity="{shade:.2f}" stroke-width="1.6"/>')
                    out += [f'<circle cx="{a:.1f}" cy="{c:.1f}" r="2.4" fill="{colour[walk]}" fill-opacity="{shade:.2f}"/>' for a, c in line]
        out.append("</g>")
    out.append(f'<text x="16" y="{top + height / 2}" transform="rotate(-90 16 {top + height / 2})" text-anchor="middle">microseconds per path</text>')
    for i, (walk, c) in enumerate(colour.items()):
        out.append(f'<text x="{left + 150 * i}" y="{height + 98}" fill="{c}">{"flight by flight" if walk == "classic" else "by jumps"}</text>')
    out.append(f'<text x="{left + 300}" y="{height + 98}">the stronger the colour, the less is absorbed</text></svg>')
    open(path, "w").write("\n".join(out) + "\n")


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--quick", action="store_true")
    a.add_argument("--write", action="store_true")
    a.add_argument("--eta", type=float, default=1.0)
    a.add_argument("--g", type=float, default=0.0)
    a = a.parse_args()
    rows, worst = [], (0, "")
    albedos = [0.9, 0.999, 0.99999] if a.quick else ALBEDOS
    with tempfile.TemporaryDirectory() as folder:
        bodies = [("ball", BALL, "0 0 4", 0.7, 4 / 3), ("slab", SLAB, "0 0 4", 0.5, 2.0 / 1.02)]
        if os.path.exists(DRAGON):
            shape = f'Shape "plymesh" "string filename" "{os.path.abspath(DRAGON)}"'
            path = os.path.join(folder, "dragon.pbrt")
            open(path, "w").write(scene(shape, "0 0 60", 14, 1, 0.99, a.eta))
            bodies.append(("dragon", shape, "0 0 60", 14, chord(path)))
        else:
            print("skipped: the dragon (no ../shared)")
        print("| body | thickness | albedo | by jumps: us | events | flight by flight: us | events |\n|---|---|---|---|---|---|---|", flush=True)
        for name, shape, eye, half, chords in bodies:
            for albedo in albedos:
                previous, plain = None, 0.0
                for tau in THICKNESSES:
                    path = os.path.join(folder, "g.pbrt")
                    open(path, "w").write(scene(shape, eye, half, tau / chords, albedo, a.eta, a.g))
                    jump = cost(path, "jump", 2.0)
                    rows.append((name, tau, albedo, "jump", jump[0]))
                    text = "| |"
                    if plain < 100:
                        classic = cost(path, "classic", 0.5)
                        plain = classic[0]
                        rows.append((name, tau, albedo, "classic", plain))
                        text = f"{classic[0]:.2f} | {classic[1]:.1f} |"
                    print(f"| {name} | {tau} | {albedo} | {jump[0]:.2f} | {jump[1]:.1f} | {text}", flush=True)
                    if previous and jump[0] / previous > worst[0]:
                        worst = (jump[0] / previous, f"{name}, albedo {albedo}, {tau // 10} to {tau}")
                    previous = jump[0]
    print(f"\nlargest growth by jumps per tenfold thickness: {worst[0]:.2f} ({worst[1]}); asked: at most 2")
    if a.write:
        svg(rows, os.path.join(ROOT, "docs", "growth.svg"))
    sys.exit(0 if worst[0] <= 2 else 4)


if __name__ == "__main__":
    main()
