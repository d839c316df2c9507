# SPDX-License-Identifier: Apache-2.0
"""Path-traced images compared with those of Mitsuba 3: a Cornell box, a grid of materials in the studio, a room with a window, a
mesh with maps, a Panda at the table and the kitchen. How far images with shading pbr are from them is printed too.

mitsuba_images.py [SAMPLES [FOLDER [SCENE ...]]] renders with SAMPLES per pixel, 4096 by default, and four times as many with Mitsuba,
and stores the images in FOLDER: path, Mitsuba and pbr side by side.
The material is written here a second time, as a BSDF for Mitsuba, which has no equal one.
"""

import copy
import os
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from mitsuba_models import mapped_mesh, opened, plain_model, shapes

SIZE = (64, 48)  # width, height
FOVY = 40.0
STUDIO = 0.3  # radiance of a white matte surface in the studio, relative to that of emission 1
MINIMUM = 40.0  # dB


class Geom:
    """A box, sphere or rectangle in both formats. Roughness None: matte, without a specular lobe."""

    def __init__(self, kind, pos, size, color, metallic=0.0, roughness=None, emission=0.0, turn=0.0):
        self.kind, self.pos, self.size, self.color = kind, pos, size, np.asarray(color, float)
        self.metallic, self.roughness, self.emission, self.turn = metallic, roughness, emission, turn

    def mjcf(self, index):
        encoded = np.where(self.color <= 0.0031308, 12.92 * self.color, 1.055 * self.color ** (1 / 2.4) - 0.055)
        specular = 0 if self.roughness is None else 0.5
        roughness = 1 if self.roughness is None else self.roughness
        material = (
            f'<material name="m{index}" rgba="{encoded[0]} {encoded[1]} {encoded[2]} 1" specular="{specular}" '
            f'metallic="{self.metallic}" roughness="{roughness}" emission="{self.emission}"/>'
        )
        size = " ".join(str(x) for x in self.size)
        kind = "plane" if self.kind == "rectangle" else self.kind
        pos = " ".join(str(x) for x in self.pos)
        return material, f'<geom type="{kind}" pos="{pos}" size="{size}" euler="0 0 {self.turn}" material="m{index}"/>'

    def mitsuba(self, mi):
        place = mi.ScalarTransform4f().translate(list(self.pos)).rotate([0, 0, 1], self.turn)
        if self.kind == "sphere":
            shape = {"type": "sphere", "to_world": place.scale(self.size[0])}
        elif self.kind == "box":
            shape = {"type": "cube", "to_world": place.scale(list(self.size))}
        else:
            shape = {"type": "rectangle", "to_world": place.scale([self.size[0], self.size[1], 1])}
        color = {"type": "rgb", "value": list(self.color)}
        if self.roughness is None:
            shape["bsdf"] = {"type": "diffuse", "reflectance": color}
        else:
            values = {"base": mi.ScalarColor3f(*self.color), "metallic": self.metallic, "roughness": self.roughness}
            shape["bsdf"] = {"type": "metallic_roughness", **values}
        if self.emission:
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(self.emission * self.color)}}
        return shape


def walls(half, height, colors, window=False):
    """A room of thick boxes, open towards -y: floor, ceiling, left, right and rear."""
    t = 0.05
    floor, ceiling, left, right, rear = colors
    found = [
        Geom("box", (0, 0, -t), (half + 2 * t, half + 2 * t, t), floor),
        Geom("box", (0, 0, height + t), (half + 2 * t, half + 2 * t, t), ceiling),
        Geom("box", (-half - t, 0, height / 2), (t, half + 2 * t, height / 2), left),
        Geom("box", (0, half + t, height / 2), (half + 2 * t, t, height / 2), rear),
    ]
    if not window:
        return [*found, Geom("box", (half + t, 0, height / 2), (t, half + 2 * t, height / 2), right)]
    for low, high in ((-half - 2 * t, -0.3), (0.5, half + 2 * t)):
        found.append(Geom("box", (half + t, (low + high) / 2, height / 2), (t, (high - low) / 2, height / 2), right))
    for low, high in ((0, 0.6), (1.5, height)):
        found.append(Geom("box", (half + t, 0.1, (low + high) / 2), (t, 0.4, (high - low) / 2), right))
    return [*found, Geom("box", (0, -half - t, height / 2), (half + 2 * t, t, height / 2), rear)]


def scenes():
    """Name -> geoms, camera's (position, target), intensity of the studio, point light (position, radius, candela)."""
    white, red, green = (0.73, 0.73, 0.73), (0.6, 0.05, 0.05), (0.1, 0.45, 0.1)
    cornell = [
        *walls(1, 2, (white, white, red, green, white)),
        Geom("box", (-0.35, 0.35, 0.6), (0.3, 0.3, 0.6), white, turn=20),
        Geom("box", (0.35, -0.3, 0.3), (0.3, 0.3, 0.3), white, turn=-18),
        Geom("box", (0, 0, 1.98), (0.3, 0.3, 0.02), (1, 0.8, 0.5), emission=8),
    ]
    spheres = [
        Geom("sphere", (0.5 * x - 1, 0, 0.5 * y + 0.3), (0.22,), (0.9, 0.6, 0.3), metallic=y / 2, roughness=0.1 + 0.22 * x)
        for x in range(5)
        for y in range(3)
    ]
    grid = [*spheres, Geom("box", (0, 0, -0.05), (4, 4, 0.05), (0.3, 0.3, 0.35))]
    room = [
        *walls(1.5, 2, (white, white, red, white, (0.4, 0.5, 0.7)), window=True),
        Geom("sphere", (0.5, 0.6, 0.4), (0.4,), (0.9, 0.7, 0.4), metallic=1, roughness=0.35),
        Geom("box", (-0.6, 0.6, 0.35), (0.3, 0.3, 0.35), (0.7, 0.3, 0.1), roughness=0.4, turn=30),
    ]
    return {
        "cornell": (cornell, ((0, -4.2, 1), (0, 0, 1)), 0, None),
        "materials": (grid, ((0, -4, 1.4), (0, 0, 0.75)), 1, None),
        "room": (room, ((-0.6, -1.4, 1.3), (0.1, 0.6, 0.7)), 4, ((-1, -1, 1.7), 0.1, 900)),
        "mesh": (mapped_mesh(), ((0, -2.4, 1.3), (0, 0, 0.55)), 1, ((-1.5, -1.5, 2.5), 0.15, 900)),
        "panda": (plain_model("pick", "franka", "table"), ((1.5, -0.9, 1.5), (0.3, 0, 0.7)), 1, ((1.2, 0.8, 2.2), 0.1, 300)),
        "kitchen": (plain_model("open", "franka", "kitchen"), ((-1.2, -0.6, 1.6), (0.4, 0.3, 0.9)), 1, ((-0.6, -0.6, 2.1), 0.1, 300)),
    }


def mjsense_images(geoms, camera, studio, light, samples):
    """Images with shading path and pbr."""
    eye, target = (np.array(x, float) for x in camera)
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    axes = " ".join(str(x) for x in (*right, *np.cross(back, right)))
    view = f'<camera name="view" pos="{" ".join(str(x) for x in eye)}" xyaxes="{axes}" fovy="{FOVY}"/>'
    lamp = ""
    if light:
        place = " ".join(str(x) for x in light[0])
        lamp = f'<light type="point" pos="{place}" bulbradius="{light[1]}" intensity="{light[2]}" range="1e6" diffuse="1 1 1"/>'
    model, files, state, maps = geoms if isinstance(geoms, tuple) else (simple_model(geoms), {}, {}, None)
    options = {"width": SIZE[0], "height": SIZE[1], "samples_per_pixel": samples, "environment_intensity": studio, "samples": 16}
    if maps is None:
        options["use_textures"] = False
    found = []
    for shading in ("path", "pbr"):
        sim, scene = opened(copy.deepcopy(model), files, state, view, lamp, shading=shading, **options)
        found.append(scene["cam"].data.rgb[0].copy())
    return sim, *found


def simple_model(geoms):
    parts = [g.mjcf(i) for i, g in enumerate(geoms)]
    return ElementTree.fromstring(
        f'<mujoco><compiler angle="degree"/><asset>{"".join(p[0] for p in parts)}</asset>'
        f"<worldbody>{''.join(p[1] for p in parts)}</worldbody></mujoco>"
    )


def studio_radiance(z):
    def ramp(x):
        x = np.clip(x, 0, 1)
        return x * x * (3 - 2 * x)

    lower = 0.5 + 0.4 * ramp((z + 0.4) / 0.5)
    return lower + 0.35 * ramp((z - 0.1) / 0.6) + 1.6 * ramp((z - 0.75) / 0.2)


def register_material(mi, dr):
    """Metallic-roughness with compensation for the energy of further bounces, as in docs and render/light/material.h."""

    def lobe_scale(alpha, samples=4096):
        """Shares of F0 and F90 that the lobe reflects, by N . V in steps of 1/256: integrals over visible normals."""
        i = np.arange(samples)
        u, w = (i + 0.5) / samples, (i * 0.6180339887498949) % 1
        found = []
        for n_v in np.maximum(np.linspace(0, 1, 257), 1e-4):
            v = np.array([np.sqrt(1 - n_v * n_v), 0, n_v])
            s = np.array([alpha * v[0], 0, v[2]])
            s /= np.linalg.norm(s)
            across = np.array([0, 1, 0])
            up = np.cross(s, across)
            r, angle = np.sqrt(u), 2 * np.pi * w
            x, half = r * np.cos(angle), 0.5 * (1 + s[2])
            y = (1 - half) * np.sqrt(np.maximum(0, 1 - x * x)) + half * r * np.sin(angle)
            h = x[:, None] * across + y[:, None] * up + np.sqrt(np.maximum(0, 1 - x * x - y * y))[:, None] * s
            h = np.column_stack([alpha * h[:, 0], alpha * h[:, 1], np.maximum(1e-9, h[:, 2])])
            h /= np.linalg.norm(h, axis=1)[:, None]
            v_h = h @ v
            n_l = 2 * v_h * h[:, 2] - n_v
            up_side = n_l > 0
            n_l = np.where(up_side, n_l, 1)
            a2 = alpha * alpha
            joint = 2 * n_l * n_v / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
            alone = 2 * n_v / (n_v + np.sqrt(n_v**2 * (1 - a2) + a2))
            weight = np.where(up_side, joint / alone, 0)
            fresnel = (1 - np.minimum(v_h, 1)) ** 5
            found.append((np.mean((1 - fresnel) * weight), np.mean(fresnel * weight)))
        return np.array(found)

    class MetallicRoughness(mi.BSDF):
        """`base`, `metallic` and `roughness` are textures or numbers; `f0` is that of the dielectric part."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.base, self.metallic, self.roughness = props["base"], props["metallic"], props["roughness"]
            self.f0 = props.get("f0", 0.04)
            varies = isinstance(self.roughness, mi.Texture)
            self.rows = 65 if varies else 1
            rows = np.linspace(0, 1, 65) if varies else [self.roughness]
            scales = np.concatenate([lobe_scale(max(x, 0.045) ** 2) for x in rows])
            self.a, self.b = (mi.Float(scales[:, k].astype(np.float32)) for k in (0, 1))
            self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]

        def alpha(self, si):
            return dr.maximum(number(self.roughness, si), 0.045) ** 2

        def parts(self, si, n_v):
            row = dr.clip(number(self.roughness, si), 0, 1) * (self.rows - 1)
            first = dr.minimum(mi.UInt32(row), max(self.rows - 2, 0))
            between = row - mi.Float(first)
            at = dr.clip(n_v, 0, 1) * 256
            low = dr.minimum(mi.UInt32(at), 255)
            part = at - mi.Float(low)

            def read(table):
                def along(k):
                    left, right = (dr.gather(mi.Float, table, k * 257 + low + i) for i in (0, 1))
                    return left + part * (right - left)

                return along(first) if self.rows == 1 else along(first) * (1 - between) + along(first + 1) * between

            a, b = read(self.a), read(self.b)
            loss = 1 / dr.maximum(a + b, 1e-3) - 1
            base = self.base.eval(si) if isinstance(self.base, mi.Texture) else mi.Color3f(*self.base)
            f0, m = self.f0, number(self.metallic, si)
            plain0, plain90 = (1 + f0 * loss) * f0, (1 + f0 * loss) * min(1, 16.5 * f0)
            under = (1 - m) * dr.maximum(0, 1 - plain0 * a - plain90 * b)
            metal = 1 + base * loss
            low0 = (1 - m) * plain0 + m * metal * base
            high = (1 - m) * plain90 + m * metal * dr.minimum(1, 16.5 * dr.mean(base))
            return under * base, low0, high

        def value(self, si, to_light):
            v = si.wi
            n_v, n_l, a2 = dr.maximum(v.z, 1e-4), to_light.z, self.alpha(si) ** 2
            h = dr.normalize(v + to_light)
            t = h.z * h.z * (a2 - 1) + 1
            d = a2 / (dr.pi * t * t)
            smith = 0.5 / (n_l * dr.sqrt(n_v * n_v * (1 - a2) + a2) + n_v * dr.sqrt(n_l * n_l * (1 - a2) + a2))
            matte, low, high = self.parts(si, n_v)
            fresnel = (1 - dr.clip(dr.dot(v, h), 0, 1)) ** 5
            masking = 2 * n_v / (n_v + dr.sqrt(n_v * n_v * (1 - a2) + a2))
            pdf = 0.5 * n_l / dr.pi + 0.5 * masking * d / (4 * n_v)
            good = (v.z > 0) & (to_light.z > 0)
            color = (matte / dr.pi + d * smith * (low + (high - low) * fresnel)) * n_l
            return good, dr.select(good, color, 0), dr.select(good, pdf, 0)

        def sample(self, ctx, si, sample1, sample2, active):
            normal = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha(si), True).sample(si.wi, sample2)[0]
            mirrored = mi.reflect(si.wi, normal)
            to_light = dr.select(sample1 < 0.5, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
            good, color, pdf = self.value(si, to_light)
            bs = mi.BSDFSample3f()
            bs.wo, bs.pdf, bs.eta = to_light, pdf, 1.0
            bs.sampled_type, bs.sampled_component = mi.UInt32(+self.m_flags), mi.UInt32(0)
            return bs, dr.select(active & good & (pdf > 0), color / pdf, 0)

        def eval(self, ctx, si, wo, active):
            return dr.select(active, self.value(si, wo)[1], 0)

        def pdf(self, ctx, si, wo, active):
            return dr.select(active, self.value(si, wo)[2], 0)

        def eval_pdf(self, ctx, si, wo, active):
            _, color, pdf = self.value(si, wo)
            return dr.select(active, color, 0), dr.select(active, pdf, 0)

    def number(value, si):
        return value.eval_1(si) if isinstance(value, mi.Texture) else mi.Float(value)

    mi.register_bsdf("metallic_roughness", MetallicRoughness)


def mitsuba_image(mi, sim, geoms, camera, studio, light, samples):
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": -1},
        "sensor": {
            "type": "perspective",
            "fov": FOVY,
            "fov_axis": "y",
            "near_clip": 0.01,
            "to_world": mi.ScalarTransform4f().look_at(*(list(x) for x in camera), [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}},
        },
    }
    if isinstance(geoms, tuple):
        scene |= shapes(mi, sim, geoms[3])
    else:
        scene |= {f"geom{i}": geom.mitsuba(mi) for i, geom in enumerate(geoms)}
    if studio:
        z = np.cos((np.arange(1024) + 0.5) / 1024 * np.pi)
        image = np.repeat(studio_radiance(z)[:, None, None] * STUDIO * studio, 16, 1).repeat(3, 2).astype(np.float32)
        turned = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
        scene["studio"] = {"type": "envmap", "bitmap": mi.Bitmap(image), "to_world": turned}
    if light:
        radiance = light[2] / 307.2 / (np.pi * light[1] ** 2)
        scene["lamp"] = {
            "type": "sphere",
            "center": list(light[0]),
            "radius": light[1],
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
        }
    loaded = mi.load_dict(scene)
    total, parts = 0, max(1, samples // 256)
    for part in range(parts):
        total = total + np.array(mi.render(loaded, spp=samples // parts, seed=part), np.float64)
    linear = np.clip(total / parts, 0, 1)
    return np.round(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)).astype(np.uint8)


def psnr(a, b):
    return 10 * np.log10(255**2 / np.mean((a.astype(float) - b) ** 2))


def flip(a, b):
    """The mean of NVIDIA's FLIP, at its default distance."""
    import flip_evaluator

    return flip_evaluator.evaluate(b.astype(np.float32) / 255, a.astype(np.float32) / 255, "LDR")[1]


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 4096
    probe = "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); mi.render(mi.load_dict(mi.cornell_box()), spp=1).numpy()"
    tried = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True)
    if tried.returncode:
        last = tried.stderr.strip().splitlines()[0][:200] if tried.stderr else f"exit code {tried.returncode}"
        print(f"Mitsuba's variant llvm_ad_rgb does not work with this LLVM ({last}); DRJIT_LIBLLVM_PATH names the library of another one")
        sys.exit(77)
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    import drjit as dr

    register_material(mi, dr)
    wanted = sys.argv[3:]
    good = True
    for name, scene in scenes().items():
        if wanted and name not in wanted:
            continue
        start = time.perf_counter()
        sim, path, pbr = mjsense_images(*scene, samples)
        between = time.perf_counter()
        theirs = mitsuba_image(mi, sim, *scene, 4 * samples)
        decibels = psnr(path, theirs)
        good &= decibels >= MINIMUM
        seconds = f"{between - start:.1f} s, Mitsuba {time.perf_counter() - between:.1f} s"
        print(f"{name}: path PSNR {decibels:.1f} dB; pbr PSNR {psnr(pbr, theirs):.1f} dB, FLIP {flip(pbr, theirs):.3f}; {seconds}", flush=True)
        if len(sys.argv) > 2:
            folder = Path(sys.argv[2])
            folder.mkdir(parents=True, exist_ok=True)
            mi.Bitmap(np.hstack([path, theirs, pbr])).write(str(folder / f"{name}.png"))
    # Leaving the interpreter with Dr.Jit loaded can take long.
    sys.stdout.flush()
    os._exit(0 if good else 1)


if __name__ == "__main__":
    main()
