# SPDX-License-Identifier: Apache-2.0
"""Any model for Mitsuba: its visible geoms with their materials. Scenes for mitsuba_images.py: a Panda at the table, the kitchen,
a mesh with maps.

The lights of the models are replaced by a point light. Colours are those of the materials; only the mesh has textures.
"""

import io
import struct
import tempfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

import mjsense as mjs

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = 0, 2, 3, 4, 5, 6, 7
SIDES = 96  # of round shapes


def plain_model(task, robot, scene):
    """MJCF with the files' names, files and joint positions of the first episode of a task, without lights, mirrors and emission."""
    env = mjs.make(task, robot, scene=scene, cameras=[], meshes="shapes")
    env.reset(seed=0)
    root = ElementTree.fromstring(env.scene.to_xml())
    for parent in list(root.iter()):
        for light in parent.findall("light"):
            parent.remove(light)
        for camera in parent.findall("camera"):
            parent.remove(camera)
    for material in root.iter("material"):
        material.set("emission", "0")
        material.set("reflectance", "0")
        # Without their textures, walls would be white, and light in a closed room would hardly end.
        rgba = [float(x) for x in material.get("rgba", "1 1 1 1").split()]
        material.set("rgba", " ".join(str(x) for x in (*(0.7 * x for x in rgba[:3]), rgba[3])))
    for key in root.findall("keyframe"):
        root.remove(key)
    state = {name: np.array(getattr(env.sim, name)[0]) for name in ("qpos", "mocap_pos", "mocap_quat")}
    return root, env.scene.assets(), state, None


def mapped_mesh():
    """A bumpy ball over a floor, with textures of all roles that Mitsuba reads too, and the pixels of the textures."""
    u, v = np.meshgrid(np.linspace(0, 1, 65), np.linspace(0.02, 0.98, 33))
    angle, height = 2 * np.pi * u, np.pi * (v - 0.5)
    radius = 0.5 * (1 + 0.08 * np.sin(3 * angle) * np.cos(height) ** 2)
    points = np.stack([np.cos(angle) * np.cos(height), np.sin(angle) * np.cos(height), np.sin(height)], -1) * radius[..., None]
    index = np.arange(65 * 33).reshape(33, 65)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    flat = points.reshape(-1, 3)
    across = np.zeros_like(flat)
    corners = flat[faces]
    for k in range(3):
        np.add.at(across, faces[:, k], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    normals = across.reshape(33, 65, 3)
    normals[:, 0] = normals[:, -1] = normals[:, 0] + normals[:, -1]  # the seam
    normals = normals.reshape(-1, 3) / np.linalg.norm(normals.reshape(-1, 3), axis=1, keepdims=True)
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in flat]
    lines += [f"vn {x:.7g} {y:.7g} {z:.7g}" for x, y, z in normals]
    lines += [f"vt {x:.7g} {y:.7g}" for x, y in zip(u.ravel(), v.ravel())]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}/{i + 1}" for i in face) for face in faces]
    y, x = np.mgrid[0:64, 0:128]
    waves = np.sin(2 * np.pi * 8 * x / 128), np.sin(2 * np.pi * 4 * y / 64)
    slope = np.stack([0.3 * waves[0], 0.3 * waves[1], np.ones_like(waves[0])], -1)
    slope /= np.linalg.norm(slope, axis=-1, keepdims=True)
    maps = {
        "rgb": np.stack([60 + 190 * (x // 16 % 2), 90 + 60 * (y // 16 % 2), 200 - x], -1),
        "orm": np.stack([255 + 0 * x, 40 + 180 * (y // 8 % 2), 255 * (x // 32 % 2)], -1),
        "normal": 127.5 + 127.5 * slope,
    }
    maps = {role: np.round(pixels).astype(np.uint8) for role, pixels in maps.items()}
    layers = "".join(f'<layer texture="{role}" role="{role}"/>' for role in maps)
    textures = "".join(
        f'<texture name="{role}" type="2d" file="{role}.png"{"" if role == "rgb" else " colorspace=" + chr(34) + "linear" + chr(34)}/>'
        for role in maps
    )
    xml = f"""<mujoco><asset>{textures}<material name="maps" rgba="1 1 1 1">{layers}</material>
      <material name="floor" rgba=".5 .5 .55 1" roughness=".8"/><mesh name="ball" file="ball.obj" inertia="shell"/></asset>
      <worldbody><geom type="mesh" mesh="ball" material="maps" pos="0 0 .6"/><geom type="box" size="4 4 .05" pos="0 0 -.05" material="floor"/>
      </worldbody></mujoco>"""
    files = {"ball.obj": "\n".join(lines).encode(), **{f"{role}.png": png(pixels) for role, pixels in maps.items()}}
    return ElementTree.fromstring(xml), files, {}, maps


def png(pixels):
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    out = io.BytesIO(b"\x89PNG\r\n\x1a\n")
    out.seek(0, 2)
    for kind, data in chunks:
        out.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))
    return out.getvalue()


def opened(root, files, state, camera, lamp, **options):
    """A simulation of the model with a camera (MJCF) and a point light (MJCF), and the scene."""
    world = root.find("worldbody")
    world.append(ElementTree.fromstring(camera))
    if lamp:
        world.append(ElementTree.fromstring(lamp))
    visual = root.find("visual")
    if visual is None:
        visual = ElementTree.SubElement(root, "visual")
    for old in visual.findall("headlight"):
        visual.remove(old)
    ElementTree.SubElement(visual, "headlight", active="0")
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        path = Path(folder) / "scene.xml"
        ElementTree.ElementTree(root).write(path)
        cfg = mjs.CameraSensorCfg(name="cam", camera_name="view", use_shadows=True, tone_mapping="linear", **options)
        scene = mjs.Scene(mjs.SceneCfg(base=path, sensors=[cfg]))
        sim = mjs.Simulation(scene, num_worlds=1)
    for name, values in state.items():
        if values.size:
            getattr(sim, name)[0] = values
    sim.forward()
    return sim, scene


def turned(profile):
    """Vertices, normals and faces of the surface that a profile (r, z, normal's r, normal's z) makes when it turns about z."""
    angle = np.linspace(0, 2 * np.pi, SIDES + 1)
    r, z, nr, nz = (np.asarray(x, float)[:, None] for x in zip(*profile))
    cos, sin = np.cos(angle)[None], np.sin(angle)[None]
    vertices = np.stack([r * cos, r * sin, z + 0 * cos], -1)
    normals = np.stack([nr * cos, nr * sin, nz + 0 * cos], -1)
    index = np.arange(vertices.shape[0] * (SIDES + 1)).reshape(-1, SIDES + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), faces


def round_shape(kind, size):
    up = np.linspace(np.pi / 2, -np.pi / 2, SIDES // 2 + 1)
    if kind == CYLINDER:
        r, h = size[:2]
        return turned([(0, h, 0, 1), (r, h, 0, 1), (r, h, 1, 0), (r, -h, 1, 0), (r, -h, 0, -1), (0, -h, 0, -1)])
    if kind == CAPSULE:
        r, h = size[:2]
        ends = [(r * np.cos(t), r * np.sin(t) + (h if t >= 0 else -h), np.cos(t), np.sin(t)) for t in up]
        middle = len(ends) // 2
        return turned([*ends[: middle + 1], (r, -h, 1, 0), *ends[middle + 1 :]])
    vertices, normals, faces = turned([(np.cos(t), np.sin(t), np.cos(t), np.sin(t)) for t in up])
    normals = normals / size
    return vertices * size, normals / np.linalg.norm(normals, axis=1, keepdims=True), faces


def mesh_of(model, mesh):
    """Corners of the triangles: positions, normals, texture coordinates or None."""
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    part = slice(first, first + count)
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][model.mesh_face[part].ravel()]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] :][model.mesh_facenormal[part].ravel()]
    coordinates = None
    if model.mesh_texcoordadr[mesh] >= 0:
        coordinates = model.mesh_texcoord[model.mesh_texcoordadr[mesh] :][model.mesh_facetexcoord[part].ravel()]
    return vertices, normals, np.arange(3 * count).reshape(-1, 3), coordinates


def linear(rgb):
    rgb = np.asarray(rgb, float)
    return [float(x) for x in np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)]


def material_of(mi, model, geom, maps):
    own, material = model.geom_rgba[geom], model.geom_matid[geom]
    look = {"type": "metallic_roughness", "metallic": 0.0, "roughness": 0.5, "f0": 0.04}
    rgba = own
    if material >= 0:
        if np.allclose(own, (0.5, 0.5, 0.5, 1)):
            rgba = model.mat_rgba[material]
        rough = model.mat_roughness[material]
        look["metallic"] = float(max(model.mat_metallic[material], 0))
        look["roughness"] = float(rough if rough >= 0 else 1 - model.mat_shininess[material])
        look["f0"] = float(0.16 * model.mat_specular[material] ** 2)
    look["base"] = mi.ScalarColor3f(*linear(rgba[:3]))
    if maps and material >= 0 and (model.mat_texid[material] >= 0).any():

        def bitmap(pixels, raw):
            return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)), "raw": raw, "filter_type": "bilinear"}

        look |= {"base": bitmap(maps["rgb"], False), "roughness": bitmap(maps["orm"][..., 1:2], True), "metallic": bitmap(maps["orm"][..., 2:3], True)}
        look = {"type": "normalmap", "normalmap": bitmap(maps["normal"], True), "bsdf": look}
    if rgba[3] < 1:
        look = {"type": "mask", "opacity": float(rgba[3]), "bsdf": look}
    return look


def shapes(mi, sim, maps=None):
    """What Mitsuba's scene has for the visible geoms."""
    model, data, found = sim.model, sim.data, {}
    for i in range(model.ngeom):
        look = material_of(mi, model, i, maps)
        material = model.geom_matid[i]
        alpha = model.geom_rgba[i][3] if material < 0 else model.mat_rgba[material][3]
        if model.geom_group[i] > 2 or alpha == 0:
            continue
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = np.array(data.geom_xmat[0, i]).reshape(3, 3), data.geom_xpos[0, i]
        place = mi.ScalarTransform4f(place)
        kind, size = int(model.geom_type[i]), np.array(model.geom_size[i], float)
        if kind == BOX:
            found[f"geom{i}"] = {"type": "cube", "to_world": place.scale([float(x) for x in size]), "bsdf": look}
        elif kind == SPHERE:
            found[f"geom{i}"] = {"type": "sphere", "to_world": place.scale([float(size[0])] * 3), "bsdf": look}
        elif kind == PLANE:
            half = [float(x) if x > 0 else 100.0 for x in size[:2]]
            found[f"geom{i}"] = {"type": "rectangle", "to_world": place.scale([*half, 1]), "bsdf": look}
        else:
            vertices, normals, faces, coordinates = mesh_of(model, model.geom_dataid[i]) if kind == MESH else (*round_shape(kind, size), None)
            found[f"geom{i}"] = mesh(mi, place, vertices, normals, faces, coordinates, look)
    return found


def mesh(mi, place, vertices, normals, faces, coordinates, look):
    matrix = np.array(place.matrix)
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(look)
    made = mi.Mesh("mesh", len(vertices), len(faces), props=props, has_vertex_normals=True, has_vertex_texcoords=coordinates is not None)
    params = mi.traverse(made)
    params["vertex_positions"] = (vertices @ matrix[:3, :3].T + matrix[:3, 3]).ravel().astype(np.float32)
    params["vertex_normals"] = (normals @ matrix[:3, :3].T).ravel().astype(np.float32)
    params["faces"] = faces.ravel().astype(np.uint32)
    if coordinates is not None:
        params["vertex_texcoords"] = coordinates.ravel().astype(np.float32)
    params.update()
    return made
