# SPDX-License-Identifier: Apache-2.0
"""Images of MuJoCo's abstract scene (``mjvScene``): what the renderer in C++ reads of the scene and its model, and its errors
with the names of elements."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from mjsense import _core
from mjsense.sim import scene_layout

if TYPE_CHECKING:
    import mujoco

_MODEL_ARRAYS = tuple(
    """
    mesh_vertadr mesh_vertnum mesh_faceadr mesh_facenum mesh_normaladr mesh_normalnum mesh_texcoordadr mesh_texcoordnum
    mesh_graphadr mesh_vert mesh_normal mesh_texcoord mesh_face mesh_facenormal mesh_facetexcoord mesh_graph hfield_adr
    hfield_nrow hfield_ncol hfield_size hfield_data skin_vertadr skin_vertnum skin_texcoordadr skin_faceadr skin_facenum
    skin_vert skin_texcoord skin_face tex_adr tex_type tex_width tex_height tex_nchannel tex_colorspace tex_data mat_texid
    mat_texuniform mat_texrepeat mat_metallic mat_roughness light_type light_texid light_active
    """.split()
)
"""The model's arrays that an image depends on and that are not in the abstract scene."""

_SCENE_ARRAYS = tuple(
    """
    flexedgeadr flexedgenum flexedge flexvertadr flexvertnum flexfaceadr flexfaceused flexvert flexface flexnormal
    flextexcoord skinfacenum skinvertadr skinvertnum skinvert skinnormal
    """.split()
)

# Flags of renderer.scene.flags (mjtRndFlag) by their effect here.
_REFUSED_IF_SET = ("mjRND_WIREFRAME", "mjRND_ADDITIVE", "mjRND_DEPTH", "mjRND_SEGMENT", "mjRND_IDCOLOR")
_REFUSED_IF_CLEAR = ("mjRND_CULL_FACE",)
_SHOWN = ("mjRND_SHADOW", "mjRND_REFLECTION", "mjRND_SKYBOX", "mjRND_HAZE", "mjRND_FOG")


class SceneDrawer:
    """Draws a scene with the model's textures, meshes and quality.

    Args:
        model: The ``mujoco.MjModel``.
        scene: The scene, which must have room for at least two geoms. Its memory is read when an image is drawn.
        version: The version of MuJoCo whose light model is used, ``(3, 12)``; None for the installed one.
    """

    def __init__(self, model: mujoco.MjModel, scene: mujoco.MjvScene, version: tuple[int, ...] | None = None) -> None:
        import mujoco

        self._mujoco, self._model, self._scene = mujoco, model, scene
        self.fixed_camera = -1
        """Id of the model's camera that the scene shows; -1 if it is not one of the model."""
        flag = mujoco.mjtRndFlag
        self._flags = {
            name: int(getattr(flag, name)) for name in (*_SHOWN, *_REFUSED_IF_SET, *_REFUSED_IF_CLEAR) if hasattr(flag, name)
        }
        """Indices into the scene's flags."""
        version = version or tuple(int(x) for x in mujoco.mj_versionString().split(".")[:2])
        arrays = {name: getattr(model, name) for name in _MODEL_ARRAYS if hasattr(model, name)}
        if arrays["tex_adr"].dtype != np.int64:
            arrays["tex_adr"] = arrays["tex_adr"].astype(np.int64)
        arrays |= {name: getattr(model, name) for name in _core.scene_index_fields() if hasattr(model, name)}
        soft = {name: getattr(scene, name) for name in _SCENE_ARRAYS}
        self._alive = (arrays, soft)  # the native renderer reads their memory
        quality, map_, rgba, extent = model.vis.quality, model.vis.map, model.vis.rgba, float(model.stat.extent)
        settings = {
            "samples": max(1, int(quality.offsamples)),
            "shadows": bool(quality.shadowsize > 0),
            "shadow_clip": float(extent * map_.shadowclip),
            "shadow_scale": float(map_.shadowscale),
            "shadow_near": float(extent * map_.znear),
            "haze": float(map_.haze),
            "haze_rgb": tuple(float(x) for x in rgba.haze[:3]),
            "fog_start": extent * map_.fogstart,
            "fog_slope": 1 / (extent * max(map_.fogend - map_.fogstart, 1e-6)),
            "fog_rgb": tuple(float(x) for x in rgba.fog[:3]),
            "line_width": float(model.vis.global_.linewidth),
            # 3.12 wraps 2D textures around spheres, cylinders and so on, and repeats those of meshes; earlier versions project
            # them along z.
            "projected_textures": version < (3, 12),
            "point_lights_at_camera": version < (3, 12),
            "sized_soft_textures": version < (3, 13),
        }
        # The geoms of mujoco's class: dm_control's subclass has only those in use, at this moment possibly none.
        geoms = mujoco.MjvScene.geoms.fget(scene)
        lights, cameras = scene.lights, scene.camera
        first = {"geoms": geoms[0], "lights": lights[0], "left_camera": cameras[0], "right_camera": cameras[1]}
        where = {name: scene_layout.address(element.pos) for name, element in first.items()}
        where["geom_stride"] = scene_layout.address(geoms[1].pos) - where["geoms"]
        where["light_stride"] = scene_layout.address(lights[1].pos) - where["lights"]
        self.native = _core.SceneRenderer(arrays, settings, scene_layout.layouts(), where, soft)

    def draw(
        self,
        rgb: np.ndarray | None = None,
        depth: np.ndarray | None = None,
        segmentation: np.ndarray | None = None,
        *,
        point_lights: bool = False,
    ) -> bool:
        """Fills images of the same size. Returns False if the scene has no camera, so that nothing can be seen."""
        scene = self._scene
        if not 0 <= scene.ngeom <= scene.maxgeom:
            raise ValueError(f"Renderer: scene.ngeom is {scene.ngeom}: must be in [0, {scene.maxgeom}], which max_geom has set")
        values = scene.flags.tolist()
        flags = {name: values[index] for name, index in self._flags.items()}
        if rgb is not None:
            self._check_scene(flags)
        shown = [bool(flags[name]) for name in _SHOWN]
        shown += [bool(x) for x in (scene.flexvertopt, scene.flexedgeopt, scene.flexskinopt)]
        shown.append(point_lights)
        images = [image for image in (rgb, depth, segmentation) if image is not None]
        height, width = images[0].shape[:2] if images else (1, 1)
        memory = [0 if image is None else scene_layout.address(image) for image in (rgb, depth, segmentation)]
        try:
            self.native.render(scene.ngeom, scene.nlight, tuple(shown), width, height, *memory)
        except ValueError as error:
            if any(eye.forward.any() and eye.up.any() for eye in scene.camera):
                raise ValueError(f"Renderer: {self._with_names(str(error))}") from None
            for image, nothing in ((rgb, 0), (depth, self._model.vis.map.zfar * self._model.stat.extent), (segmentation, -1)):
                if image is not None:
                    image.fill(nothing)
            return False
        return True

    def _with_names(self, message: str) -> str:
        """The message with names instead of MuJoCo's object types and ids."""
        mujoco, model, scene = self._mujoco, self._model, self._scene

        def named(kind: int, id: int) -> str:
            if id < 0 or not (text := mujoco.mju_type2Str(kind)):
                return "(decoration)"
            return f"({text} '{mujoco.mj_id2name(model, kind, id) or ''}', id {id})"

        def light(found: re.Match[str]) -> str:
            one = scene.lights[int(found[1])]
            if not hasattr(one, "id") or one.headlight:  # MuJoCo 3.3 has no ids of lights
                return found[0]
            return f"{found[0]} {named(mujoco.mjtObj.mjOBJ_LIGHT.value, one.id)}"

        message = re.sub(r"\(object type (\d+), id (-?\d+)\)", lambda found: named(int(found[1]), int(found[2])), message)
        message = re.sub(r"light (\d+) of the scene", light, message)
        if self.fixed_camera >= 0:
            camera = named(mujoco.mjtObj.mjOBJ_CAMERA.value, self.fixed_camera)
            message = message.replace("the scene's camera", f"the scene's camera {camera}")
        return message

    def _check_scene(self, flags: dict[str, int]) -> None:
        """Raises ValueError for settings of the scene, with these flags, that change an image and are not supported."""
        scene = self._scene
        for names, refused in ((_REFUSED_IF_SET, 1), (_REFUSED_IF_CLEAR, 0)):
            for name in names:
                if name in flags and bool(flags[name]) == refused:
                    raise ValueError(f"Renderer: scene.flags[{name}] = {refused} is not supported")
        for name in ("stereo", "enabletransform", "framewidth"):
            if getattr(scene, name):
                raise ValueError(f"Renderer: scene.{name} = {getattr(scene, name)} is not supported")
