# SPDX-License-Identifier: Apache-2.0
"""Random models with one textured object that only ambient light reaches, so that an image of it is the texture alone."""

import io

import numpy as np
from PIL import Image

KINDS = ("mesh", "smooth mesh", "mesh without coordinates", "cube on a mesh", "skin", "skin without coordinates", "height field", "cloth", "primitive")


def texture_image(rng, size, symmetric):
    """PNG of an image with features of many sizes, from the whole image down to about ten texels.

    With `symmetric`, the four borders are alike, so that the image has no seams on a cube: OpenGL filters across them, mjsense does not.
    """
    y, x = np.mgrid[:size, :size] / size
    image = np.full((size, size, 3), 128.0)
    for _ in range(8):
        waves = rng.integers(-size // 10, size // 10 + 1, 2) * rng.random()
        colour = rng.uniform(-60, 60, 3)
        image += colour * np.sin(2 * np.pi * (np.round(waves[0]) * x + np.round(waves[1]) * y) + rng.uniform(0, 6))[..., None]
    if symmetric:
        image = (image + image[::-1]) / 2
        image = (image + image[:, ::-1]) / 2
        image = (image + image.transpose(1, 0, 2)) / 2
        image = 128 + 2 * (image - 128)
        return png(image)
    cells = 2 ** rng.integers(1, 4)
    image += 60 * (((x * cells).astype(int) + (y * cells).astype(int)) % 2)[..., None] - 30
    return png(image)


def png(image):
    out = io.BytesIO()
    Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def numbers(values):
    return " ".join(f"{x:.5g}" for x in np.ravel(values))


def polyhedron(rng):
    """Vertices and faces of a closed surface of 8 to 96 triangles, of any proportions."""
    rings, sectors = int(rng.integers(1, 5)), int(rng.integers(4, 13))
    points = [(0, 0, 1.0)]
    for i in range(rings):
        polar = np.pi * (i + 1) / (rings + 1)
        points += [(np.sin(polar) * np.cos(a), np.sin(polar) * np.sin(a), np.cos(polar)) for a in 2 * np.pi * np.arange(sectors) / sectors]
    points.append((0, 0, -1.0))
    vertices = np.array(points) * rng.uniform(0.7, 1.3, (len(points), 1)) * rng.uniform(0.1, 0.5, 3)
    at = lambda ring, i: 1 + ring * sectors + i % sectors  # noqa: E731
    faces = [(0, at(0, i), at(0, i + 1)) for i in range(sectors)]
    for ring in range(rings - 1):
        for i in range(sectors):
            faces += [(at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)), (at(ring, i), at(ring + 1, i + 1), at(ring, i + 1))]
    last = len(points) - 1
    faces += [(last, at(rings - 1, i + 1), at(rings - 1, i)) for i in range(sectors)]
    return vertices, np.array(faces)


def split(vertices, faces):
    """A vertex for each corner, so that corners have coordinates and normals of their own."""
    return vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3)


def face_normals(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)


def _mesh(rng, coordinates, smooth):
    vertices, faces = polyhedron(rng)
    text = ""
    if coordinates:
        if rng.random() < 0.5:
            vertices, faces = split(vertices, faces)
            scale = rng.uniform(0.2, 2, (len(faces), 1, 2)) if rng.random() < 0.5 else 1.0
            uv = (np.array([[0, 0], [1, 0], [0.5, 1]]) * scale + rng.uniform(-1, 1, (len(faces), 1, 2))).reshape(-1, 2)
        else:
            uv = vertices[:, :2] * rng.uniform(0.5, 4, 2) + 0.5 * vertices[:, 2:]
        text = f'texcoord="{numbers(uv)}" '
    if smooth and rng.random() < 0.5:  # normals that have little to do with the faces
        normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True) + rng.normal(0, 0.5, vertices.shape)
        text += f'normal="{numbers(normals / np.linalg.norm(normals, axis=1, keepdims=True))}" '
    elif smooth:
        text += 'smoothnormal="true" '
    scale = f'scale="{" ".join(rng.choice(["1", "-1", "1.5"], 3))}"' if rng.random() < 0.3 else ""
    return f'<mesh name="m" inertia="shell" vertex="{numbers(vertices)}" face="{numbers(faces)}" {text}{scale}/>'


def _skin(rng, coordinates):
    vertices, faces = polyhedron(rng)
    uv = f'texcoord="{numbers(vertices[:, :2] * rng.uniform(0.5, 4, 2) + vertices[:, 2:])}"' if coordinates else ""
    weights = vertices[:, 2] > 0
    bones = "".join(
        f'<bone body="{body}" bindpos="0 0 0" bindquat="1 0 0 0" vertid="{numbers(np.flatnonzero(of))}" vertweight="{numbers(np.ones(of.sum()))}"/>'
        for body, of in (("a", weights), ("b", ~weights)))  # fmt: skip
    bodies = "".join(
        f'<body name="{name}" pos="{numbers(rng.uniform(-0.1, 0.1, 3))}" euler="{numbers(rng.uniform(-40, 40, 3))}"><geom size=".001" group="4"/></body>'
        for name in "ab")  # fmt: skip
    skin = f'<skin name="s" material="t" vertex="{numbers(vertices)}" face="{numbers(faces)}" {uv} inflate="{rng.choice([0, 0.05])}">{bones}</skin>'
    return bodies, f"<deformable>{skin}</deformable>"


def _primitive(rng):
    kind = rng.choice(["sphere", "capsule", "ellipsoid", "cylinder", "box", "plane"])
    size = {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)
    return f'type="{kind}" size="{numbers(rng.uniform(0.15, 0.5, size))}"'


def random_model(seed, kind):
    """MJCF and its files."""
    rng = np.random.default_rng(seed)
    size = int(rng.choice([48, 64, 128, 256]))
    cube = kind == "cube on a mesh" or (kind in ("height field", "primitive") and rng.random() < 0.4)
    repeat = numbers(rng.uniform(0.4, 4, 2)) if rng.random() < 0.6 else "1 1"
    assets = f'<texture name="t" type="{"cube" if cube else "2d"}" file="t.png"/>'
    assets += f'<material name="t" texture="t" specular="0" texrepeat="{repeat}" texuniform="{rng.choice(["true", "false"])}"/>'
    body = after = ""
    pose = f'material="t" euler="{numbers(rng.uniform(-180, 180, 3))}"'
    if "mesh" in kind:
        assets += _mesh(rng, kind in ("mesh", "smooth mesh"), kind != "mesh")
        body = f'<geom type="mesh" mesh="m" {pose}/>'
    elif kind.startswith("skin"):
        body, after = _skin(rng, kind == "skin")
    elif kind == "height field":
        rows, columns = rng.integers(3, 12, 2)
        assets += f'<hfield name="h" nrow="{rows}" ncol="{columns}" size="{numbers(rng.uniform(0.3, 0.7, 3))} .1" elevation="{numbers(rng.random(rows * columns))}"/>'
        body = f'<geom type="hfield" hfield="h" material="t" euler="0 0 {rng.uniform(0, 360):.0f}"/>'
    elif kind == "cloth":
        dim = int(rng.integers(2, 4))
        count = (*rng.integers(3, 6, 2), 1 if dim == 2 else int(rng.integers(2, 4)))
        coordinates = rng.uniform(-1, 2, (int(np.prod(count)), 2))
        body = (f'<flexcomp name="f" type="grid" dim="{dim}" count="{numbers(count)}" spacing="{numbers(rng.uniform(0.1, 0.25, 3))}" radius=".005" mass="1" '
                f'{pose} texcoord="{numbers(coordinates)}" rigid="{rng.choice(["true", "false"])}"><contact selfcollide="none"/></flexcomp>')  # fmt: skip
    else:
        body = f"<geom {_primitive(rng)} {pose}/>"
    # The camera looks at the origin from a random direction, mostly from above.
    eye = rng.normal(size=3)
    eye[2] = abs(eye[2]) + (1 if kind == "height field" else 0.2)
    eye *= rng.uniform(1.2, 3) / np.linalg.norm(eye)
    right = np.cross((0, 0, 1), eye)
    up = np.cross(eye, right)
    return f"""<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/>
        <quality shadowsize="0" offsamples="0" numslices="128" numstacks="128"/><map znear=".01"/></visual><statistic extent="2" center="0 0 0"/>
        <asset>{assets}</asset><worldbody><camera name="view" pos="{numbers(eye)}" xyaxes="{numbers(right)} {numbers(up)}" fovy="{rng.uniform(20, 60):.0f}"/>
        {body}</worldbody>{after}</mujoco>""", {"t.png": texture_image(rng, size, cube)}
