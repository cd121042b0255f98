#!/usr/bin/env python3
"""Compares moonmilk with exact values, with other renderers' converged pictures, and with Mitsuba's efficiency.

  python3 benches/reference.py              everything but efficiency (about an hour on two cores)
  python3 benches/reference.py --quick      the same at a sixteenth of the samples (CI)
  python3 benches/reference.py efficiency   nMSE x CPU seconds beside Mitsuba's in the same run (pip: mitsuba, numpy)
  python3 benches/reference.py furnace|pictures|efficiency [--scenes dragon,milk] [--factor 0.25]

Needs the release build, the pictures in ../shared/reference, and the Python packages numpy and OpenEXR; a virtual environment
with them is made in target/reference-venv if the running Python lacks them. Prints what it skips. Exit code 4 if a check fails.
"""
import argparse, json, math, os, re, subprocess, sys, tempfile, time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
REFERENCE = os.path.join(ROOT, "..", "shared", "reference")
PROGRAM = os.environ.get("MOONMILK") or os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release", "moonmilk")
VENV = os.path.join(ROOT, "target", "reference-venv")


def need_packages(script=os.path.abspath(__file__)):
    """Restarts a script in a virtual environment with numpy and OpenEXR if this Python lacks them."""
    try:
        import numpy, OpenEXR  # noqa: F401
    except ImportError:
        python = os.path.join(VENV, "bin", "python")
        if sys.executable == python:
            raise
        if not os.path.exists(python):
            subprocess.run([sys.executable, "-m", "venv", VENV], check=True)
            if subprocess.run([python, "-m", "pip", "install", "-q", "numpy", "OpenEXR"]).returncode != 0:
                print("skipped: numpy and OpenEXR cannot be installed, no comparison with other renderers")
                sys.exit(0)
        os.execv(python, [python, script, *sys.argv[1:]])


def channels(path):
    """All channels of an EXR file as float64 arrays by name."""
    import numpy as np, OpenEXR
    out = {}
    with OpenEXR.File(path, separate_channels=True) as f:
        for name, c in f.channels().items():
            out[name] = np.asarray(c.pixels, dtype=np.float64)
    return out


def gray(path, prefix=""):
    c = channels(path)
    if prefix + "R" in c:
        return (c[prefix + "R"] + c[prefix + "G"] + c[prefix + "B"]) / 3
    return c.get(prefix + "Y", next(iter(c.values())))


def render(scene, out, *arguments):
    """Renders a scene and returns user + system seconds of the whole process."""
    before = os.times()
    r = subprocess.run([PROGRAM, "-q", "render", scene, "-o", out, "--checkpoint-every", "0", *map(str, arguments)])
    if r.returncode != 0:
        print("FAILED: moonmilk", scene, *arguments)
        sys.exit(4)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def sidak(significance, n):
    return 1 - (1 - significance) ** (1 / n)


def normal_p(z):
    return math.erfc(abs(z) / math.sqrt(2))


def black_light(scene, folder):
    """A copy of a scene whose light quad reflects nothing, as Mitsuba's does.

    pbrt gives an area light without a material the default diffuse reflectance 0.5; Mitsuba 3.9.1 gives its emitters a diffuse BSDF
    of reflectance 0 (printing scene.shapes()[0].bsdf() shows it; a quad of radiance 1 under a sky of 1 looks 1 there, 1.5 in
    pbrt). It is worth .5 % of the mean of the lit scenes, more than the bound.
    """
    here = os.path.dirname(os.path.abspath(scene))
    text = open(scene).read().replace("  AreaLightSource", '  Material "diffuse" "rgb reflectance" [0 0 0]\n  AreaLightSource')
    text = text.replace("../../meshes", os.path.normpath(os.path.join(here, "..", "..", "meshes")))
    out = os.path.join(folder, os.path.basename(here) + "-black-light.pbrt")
    open(out, "w").write(text)
    return out


class Checks:
    def __init__(self):
        self.failed = 0

    def line(self, ok, text):
        self.failed += not ok
        print(("ok    " if ok else "FAIL  ") + text, flush=True)


# Pictures with random numbers of their own that a mean and its error come from: pixels of one picture share errors where walks share vertices of light's paths.
PARTS = 16


def parts(scene, out, spp):
    """Renders so many samples per pixel in PARTS pictures; returns them and all CPU seconds."""
    import numpy as np
    images, cpu = [], 0
    for k in range(PARTS):
        cpu += render(scene, out, "--wavelengths", "mono", "--spp", max(1, int(spp / PARTS)), "--seed", 1 + k)
        images.append(gray(out))
    return np.stack(images), cpu


def estimate(x):
    """Mean over the first axis and its standard error."""
    return x.mean(axis=0), x.std(axis=0, ddof=1) / math.sqrt(len(x))


def score(t):
    """The standard normal deviate about as improbable as t of Student's law with PARTS - 1 degrees of freedom (Wallace 1959)."""
    n = PARTS - 1
    return math.copysign((8 * n + 1) / (8 * n + 3) * math.sqrt(n * math.log1p(t * t / n)), t)


# Exact or independent values of the mean over the mask (reference/README.md); the dragons' from Mitsuba.
FURNACES = {
    "furnace_sphere_abs": (0.513777, 0.000125, 768),
    "furnace_milk_abs": (0.652991, 0.000224, 320),
    "furnace_dragon_abs": (0.56721, 0.00043, 768),
    "furnace_dragon_flat_abs": (0.56862, 0.00043, 768),
    "furnace_dragon_wf": (1.0, 0.0, 16),
    "furnace_dragon_flat_wf": (1.0, 0.0, 16),
}


def furnaces(checks, folder, factor, scenes):
    for name, (exact, error, spp) in FURNACES.items():
        if scenes and name not in scenes:
            continue
        out = os.path.join(folder, name + ".exr")
        images, cpu = parts(os.path.join(REFERENCE, name, "scene.pbrt"), out, spp * factor)
        mask = gray(os.path.join(REFERENCE, name, "mask.exr")) > 0.5
        mean, own = estimate(images[:, mask].mean(axis=1))
        combined = math.hypot(own, error)
        z = 0.0 if mean == exact else score((mean - exact) / max(combined, 1e-12))
        # Smooth normals: Mitsuba's figure lost 0.25 % to its rule, so a difference of that size is expected and reported.
        loose = name == "furnace_dragon_abs"
        ok = abs(mean / exact - 1) < 0.006 if loose else abs(z) < 4 or abs(mean / exact - 1) < 1e-6
        checks.line(ok, f"{name:26s} {mean:.6f} +- {own:.6f} ({100 * own / mean:.3f} %) against {exact} +- {error}: {z:+.2f} sigma, {cpu:.0f} CPU s")


PICTURES = {"dragon_flat": ("mitsuba", 1024, 0.003), "sphere": ("pbrt", 512, 0.003), "milk": ("mitsuba", 256, 0.003), "dragon": ("mitsuba", 1024, 0.006)}


def pictures(checks, folder, factor, scenes):
    import numpy as np
    for name, (renderer, spp, bound) in PICTURES.items():
        if scenes and name not in scenes:
            continue
        out = os.path.join(folder, name + ".exr")
        scene = os.path.join(REFERENCE, name, "scene.pbrt")
        scene = black_light(scene, folder) if renderer == "mitsuba" else scene
        images, cpu = parts(scene, out, spp * factor)
        there = os.path.join(REFERENCE, name, renderer)
        theirs, their_var = gray(there + ".exr"), gray(there + "_variance.exr")
        if renderer == "pbrt":
            # pbrt's channels share their paths: the variance of their mean is at most the mean of their variances.
            their_var = gray(there + "_variance.exr")
        mask = gray(os.path.join(REFERENCE, name, "mask.exr")) > 0.5
        (a, ea), b = estimate(images[:, mask].mean(axis=1)), theirs[mask].mean()
        eb = math.sqrt(their_var[mask].sum()) / mask.sum()
        error = math.hypot(ea, eb) / b
        text = f"{name:12s} mean / {renderer}'s = {a / b:.5f} +- {error:.5f} (ours {100 * ea / a:.3f} %), {cpu:.0f} CPU s"
        checks.line(abs(a / b - 1) < bound + 3 * error, text)
        # Blocks of 16 x 16 pixels: difference in combined standard errors, Sidak over the blocks.
        h, w = theirs.shape
        block = lambda x: x[: h // 16 * 16, : w // 16 * 16].reshape(h // 16, 16, w // 16, 16).sum(axis=(1, 3))
        count = block(mask.astype(float))
        used = count > 64
        means = np.stack([(block(np.where(mask, x - theirs, 0)) / np.maximum(count, 1))[used] for x in images])
        diff, own = estimate(means)
        sd = np.hypot(own, (np.sqrt(block(np.where(mask, their_var, 0))) / np.maximum(count, 1))[used])
        z = score(np.abs(diff / sd).max())
        limit = sidak(6.3e-5, used.sum())
        ok = normal_p(z) > limit
        if name == "dragon":
            print(f"info  {name:12s} worst of {used.sum()} blocks {z:.2f} sigma (smooth normals: rules differ, no exact answer)")
        else:
            checks.line(ok, f"{name:12s} worst of {used.sum()} blocks {z:.2f} sigma (p {normal_p(z):.1e}, limit {limit:.1e}: 4 sigma after Sidak)")


def times(numbers, factor):
    """Numbers in a text, each times a factor."""
    return " ".join(repr(float(n) * factor) for n in numbers.split())


def scaled_quad(numbers, factor):
    """Corner coordinates of a quad that is `factor` times as wide and high about its centre."""
    x = [float(n) for n in numbers.split()]
    centre = [sum(x[k::3]) / (len(x) // 3) for k in range(3)]
    return " ".join(repr(centre[i % 3] + factor * (v - centre[i % 3])) for i, v in enumerate(x))


def variant(name, folder, light, power, density):
    """A folder with both scene files of a reference scene, its light `light` times as wide and high and `power` times as strong in all, its scattering `density` times as strong."""
    here, out = os.path.join(REFERENCE, name), os.path.join(folder, "variant", name)
    os.makedirs(out, exist_ok=True)
    meshes = os.path.normpath(os.path.join(ROOT, "..", "shared", "meshes"))
    text = open(os.path.join(here, "scene.pbrt")).read().replace("../../meshes", meshes)
    text = re.sub(r'("point3 P" \[)([^\]]*)(\])', lambda m: m[1] + scaled_quad(m[2], light) + m[3], text, count=1)
    radiance = power / light**2
    text = re.sub(r'(AreaLightSource[^\n]*"(?:rgb|spectrum) L" \[)([^\]]*)', lambda m: m[1] + times(m[2], radiance), text, count=1)
    sigma = {}
    for which in "as":
        found = re.search(rf'"spectrum sigma_{which}" \[ *\S+ (\S+)', text)
        sigma[which] = float(found[1]) * (density if which == "s" else 1)
        text = re.sub(rf'("spectrum sigma_{which}" \[)[^\]]*', lambda m: f"{m[1]} 200 {sigma[which]!r} 1000 {sigma[which]!r} ", text)
    open(os.path.join(out, "scene.pbrt"), "w").write(text)
    text = open(os.path.join(here, "scene.xml")).read().replace("../../meshes", meshes)
    text = re.sub(r'(name="sigma_t" value=")[^"]*', lambda m: m[1] + repr(sigma["a"] + sigma["s"]), text)
    text = re.sub(r'(name="albedo" value=")[^"]*', lambda m: m[1] + repr(sigma["s"] / (sigma["a"] + sigma["s"])), text)
    head, quad = text.split('<shape type="rectangle" name="light">')
    columns = lambda m: m[1] + " ".join(repr(float(v) * (light if i % 4 < 2 and i < 12 else 1)) for i, v in enumerate(m[2].split()))
    quad = re.sub(r'(name="radiance" value=")([^"]*)', lambda m: m[1] + times(m[2], radiance), quad, count=1)
    text = head + '<shape type="rectangle" name="light">' + re.sub(r'(<matrix value=")([^"]*)', columns, quad, count=1)
    open(os.path.join(out, "scene.xml"), "w").write(text)
    open(os.path.join(out, "mask.exr"), "wb").write(open(os.path.join(here, "mask.exr"), "rb").read())
    return out


def efficiency(folder, scenes, spp, seeds, modes, walk, light, power, density):
    import numpy as np
    print("efficiency = 1 / (nMSE x CPU s) over the object's pixels; both renderers in turn, same machine, same minutes")
    if light != 1 or power is not None or density != 1:
        print(f"lights {light:g} times as wide and high, {power or light**2:g} times the power, scattering {density:g} times as strong")
    for name in scenes or ["sphere", "dragon", "milk"]:
        here = variant(name, folder, light, light**2 if power is None else power, density)
        mask = gray(os.path.join(here, "mask.exr")) > 0.5
        scene = black_light(os.path.join(here, "scene.pbrt"), folder)
        found = {}
        for mode in modes:
            images, cost = [], []
            settings = ["--wavelengths", "mono", "--walk", walk, "--subsurface", mode]
            # The process's start and the loading of the scene are measured apart and taken off, as Mitsuba's are.
            idle = min(render(scene, os.path.join(folder, "idle.exr"), *settings, "--spp", 1, "--crop", "0,1,0,1") for _ in range(3))
            for k in range(seeds):
                out = os.path.join(folder, f"{name}{k}.exr")
                cost.append(render(scene, out, *settings, "--spp", spp, "--seed", 100 + k) - idle)
                images.append(gray(out)[mask])
            x = np.stack(images)
            mean = x.mean()
            nmse = x.var(axis=0, ddof=1).mean() / mean**2
            cpu = float(np.mean(cost))
            found[mode] = (mean, nmse, cpu)
            print(f"{name:8s} moonmilk {mode}: mean {mean:.5f}, nMSE {nmse:.4g} at {spp} spp, {cpu:.2f} CPU s, efficiency {1 / (nmse * cpu):.4g}", flush=True)
        for label, rr in [("roulette off", 1000000), ("rr_depth 100", 100)]:
            # A copy of the scene and of the script, which looks for scenes beside itself.
            s = os.path.join(os.path.dirname(here), "measure_mitsuba.py")
            open(s, "w").write(open(os.path.join(REFERENCE, "measure_mitsuba.py")).read())
            text = open(os.path.join(here, "scene.xml")).read()
            open(os.path.join(here, "scene.xml"), "w").write(re.sub(r'(name="rr_depth" value=")\d+', rf"\g<1>{rr}", text))
            python = os.environ.get("MITSUBA_PYTHON", sys.executable)
            r = subprocess.run([python, s, name, "--spp", str(spp), "--seeds", str(seeds)], capture_output=True, text=True)
            if r.returncode != 0:
                print(f"skipped: Mitsuba ({label}): {r.stderr.strip().splitlines()[-1:] or r.returncode}")
                continue
            m = json.loads(r.stdout.strip().splitlines()[-1])
            print(f"{name:8s} Mitsuba {label}: mean {m['mean']:.5f}, nMSE {m['nMSE']:.4g}, {m['cpu_s']:.2f} CPU s, efficiency {m['efficiency']:.4g}", flush=True)
            for mode, (mean, nmse, cpu) in found.items():
                ratio = 1 / (nmse * cpu * m["efficiency"])
                print(f"{name:8s}   {mode}: ratio {ratio:.2f} (noise {m['nMSE'] / nmse:.2f} x time {m['cpu_s'] / cpu:.2f}), mean ratio {mean / m['mean']:.4f}", flush=True)


def main():
    p = argparse.ArgumentParser()
    p.add_argument("what", nargs="?", default="checks", choices=["checks", "furnace", "pictures", "efficiency"])
    p.add_argument("--quick", action="store_true")
    p.add_argument("--factor", type=float, default=1.0)
    p.add_argument("--scenes", default="")
    p.add_argument("--spp", type=int, default=32)
    p.add_argument("--seeds", type=int, default=4)
    p.add_argument("--subsurface", default="path", help="efficiency: modes, separated by commas")
    p.add_argument("--walk", default="auto", help="efficiency: policy of walks")
    p.add_argument("--light", type=float, default=1.0, help="efficiency: width and height of the light, times the scene's")
    p.add_argument("--power", type=float, help="efficiency: power of the light, times the scene's; without it the radiance stays")
    p.add_argument("--density", type=float, default=1.0, help="efficiency: scattering coefficient, times the scene's")
    a = p.parse_args()
    if not os.path.isdir(REFERENCE):
        print("skipped: ../shared/reference is absent, no comparison with other renderers")
        return
    need_packages()
    scenes = [s for s in a.scenes.split(",") if s]
    factor = a.factor / 16 if a.quick else a.factor
    checks = Checks()
    with tempfile.TemporaryDirectory() as folder:
        if a.what in ("checks", "furnace"):
            furnaces(checks, folder, factor, scenes)
        if a.what in ("checks", "pictures"):
            pictures(checks, folder, factor, scenes)
        if a.what == "efficiency":
            efficiency(folder, scenes, a.spp, a.seeds, a.subsurface.split(","), a.walk, a.light, a.power, a.density)
    if checks.failed:
        print(f"{checks.failed} checks failed")
        sys.exit(4)


if __name__ == "__main__":
    main()
