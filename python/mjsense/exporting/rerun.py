# SPDX-License-Identifier: Apache-2.0
"""Files of the Rerun viewer. They have these entities:

task                            the instruction
features/NAME                   a curve for each number
world/cameras/NAME              pose and focal length of a camera, if they are known
world/cameras/NAME/colour       its images or video; also /depth and other images of the camera
world/scene/BODY                pose of a body; its name begins with its number in the model
world/scene/BODY/GEOM           a geom of it; its name begins with its number in the body
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.png import png_of
from mjsense.dataset import Episode
from mjsense.dataset.streams import VIDEOS
from mjsense.exporting.images import depth_unit, depth_videos, to_uint16
from mjsense.exporting.mapping import Source
from mjsense.exporting.output import join_folders, needs
from mjsense.exporting.scene import Shape, bodies


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes the files of all episodes to the new folder ``path``."""
    needs("rerun", "rerun")
    path.mkdir()
    for episode in source.each(progress):
        name = f"episode_{episode.index:08d}"
        with RerunFile(path / f"{name}.rrd", f"{source.name}_{name}", _blueprint(source, episode)) as file:
            rr, stream = file.rr, file.stream
            stream.send_recording_name(f"{episode.index}: {episode.task}")
            place = f"{episode.path.name}/{episode.trajectory}"
            stream.send_property("episode", rr.AnyValues(outcome=episode.outcome, seed=str(episode.seed), file=place))
            stream.log("task", rr.TextDocument(episode.task), static=True)
            _log_features(rr, stream, source, episode)
            for camera in source.cameras:
                _log_camera(rr, stream, source, episode, camera)
            _log_depth(rr, stream, source, episode)
            _log_scene(rr, stream, source, episode)


join = join_folders


class RerunFile:
    """A file that is written step by step. At the end of the block it is complete."""

    def __init__(self, path: Path, recording_id: str | None = None, blueprint: Any = None) -> None:
        self.rr = needs("rerun", "rerun")
        self.stream = self.rr.RecordingStream("mjsense", recording_id=recording_id)
        self.stream.save(path, default_blueprint=blueprint)
        self.stream.log("world", self.rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def __enter__(self) -> RerunFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.stream.disconnect()

    def at(self, frame: int, seconds: float) -> None:
        """Sets the time of what is logged from now on."""
        self.stream.set_time("frame", sequence=frame)
        self.stream.set_time("time", duration=seconds)

    def curve(self, name: str, values: np.ndarray) -> None:
        """Logs the present numbers of a feature."""
        self.stream.log(f"features/{name}", self.rr.Scalars(values))

    def image(self, name: str, image: np.ndarray) -> None:
        """Logs the present image of a camera: uint8 [H, W, 3], or depth in metres, float [H, W, 1]; other images are skipped.

        Args:
            name: ``CAMERA``, ``CAMERA_depth`` as in recordings, or ``CAMERA/rgb`` as in a scene.
        """
        if image.dtype.kind == "f":
            logged = self.rr.DepthImage(image.reshape(image.shape[:2]), meter=1.0)
        elif image.dtype == np.uint8:
            logged = self.rr.Image(image).compress()
        else:
            return
        self.stream.log(_image_entity(name), logged)

    def pose(self, body: str, position: np.ndarray, quat: np.ndarray) -> None:
        """Logs the present pose of a body. ``quat`` is wxyz."""
        self.stream.log(body, self._transform(position, quat))

    def mesh(
        self, place: str, position: np.ndarray, quat: np.ndarray, *, vertices: np.ndarray, faces: np.ndarray, **looks: Any
    ) -> None:
        """Logs a geom, in the frame of its body.

        Args:
            looks: Further arguments of ``rerun.Mesh3D``.
        """
        self.stream.log(place, self._transform(position, quat))
        self.stream.log(place, self.rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, **looks))

    def _transform(self, position: np.ndarray, quat: np.ndarray) -> Any:
        return self.rr.Transform3D(translation=position, quaternion=self.rr.Quaternion(xyzw=quat[[1, 2, 3, 0]]))


def body_entity(number: int, name: str) -> str:
    """Entity of a body of a model."""
    return f"world/scene/{_part(number, name)}"


def geom_entity(body: str, number: int, name: str) -> str:
    """Entity of a geom of a body, with its number in the body."""
    return f"{body}/{_part(number, name)}"


def _image_entity(name: str) -> str:
    camera, _, field = name.removeprefix(VIDEOS).partition("/")
    if not field:
        field = "depth" if camera.endswith("_depth") else "colour"
        camera = camera.removesuffix("_depth")
    return f"world/cameras/{camera}/{'colour' if field == 'rgb' else field}"


def _blueprint(source: Source, episode: Episode) -> Any:
    """Layout of the viewer: the scene, seen from 37 degrees to the side of the camera that moves least, the videos, and the
    curves."""
    import rerun.blueprint as rrb  # pyright: ignore[reportMissingImports]

    poses = [pose for name in source.cameras if (pose := _camera_poses(source, episode, name)) is not None]
    if poses:
        still = min(poses, key=lambda pose: float(np.abs(pose - pose[0]).max()))[0]
        target = still[:3, 3] + still[:3, 2]  # 1 m in front of the camera
        x, y, z = 1.6 * (still[:3, 3] - target)
        eye = rrb.EyeControls3D(position=target + [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, z], look_target=target, eye_up=[0, 0, 1])
    else:
        eye = None
    cameras = [rrb.Spatial2DView(origin=f"world/cameras/{name}", name=name) for name in source.cameras]
    curves = [rrb.TimeSeriesView(origin=f"features/{name}", name=name) for name in source.features]
    # Depth images would cover the scene with points.
    shown = [
        "$origin/**",
        *(f"- $origin/cameras/{name}/depth" for name in source.cameras),
    ]
    scene = rrb.Spatial3DView(origin="world", name="scene", contents=shown, eye_controls=eye)
    left = rrb.Vertical(scene, rrb.TextDocumentView(origin="task", name="task"), row_shares=[9, 1])
    right = rrb.Vertical(*cameras, rrb.Tabs(*curves)) if cameras else rrb.Tabs(*curves)
    return rrb.Blueprint(rrb.Horizontal(left, right, column_shares=[3, 2]), rrb.TimePanel(timeline="time"))


def _times(rr: Any, source: Source, rows: int) -> list[Any]:
    return [
        rr.TimeColumn("time", duration=[float(t / source.fps) for t in range(rows)]),
        rr.TimeColumn("frame", sequence=range(rows)),
    ]


def _log_features(rr: Any, stream: Any, source: Source, episode: Episode) -> None:
    for name, rows in source.rows(episode).items():
        stream.log(f"features/{name}", rr.SeriesLines(names=list(source.features[name].names)), static=True)
        stream.send_columns(
            f"features/{name}", _times(rr, source, len(rows)), rr.Scalars.columns(scalars=rows.astype(np.float64))
        )


def _log_camera(rr: Any, stream: Any, source: Source, episode: Episode, name: str) -> None:
    place, video, times = f"world/cameras/{name}", source.video(episode, name), _times(rr, source, episode.length)
    video.check()
    asset = rr.AssetVideo(path=video.path)
    stream.log(f"{place}/colour", asset, static=True)
    frames = rr.VideoFrameReference.columns(
        timestamp=[rr.components.VideoTimestamp(nanoseconds=int(t)) for t in asset.read_frame_timestamps_nanos()]
    )
    stream.send_columns(f"{place}/colour", times, frames)
    poses = _camera_poses(source, episode, name)
    if poses is None:
        return
    height, width = video.shape[1:3]
    matrix = episode[f"obs/sensor_param/{source.cameras[name]}/intrinsic_cv"][0]
    stream.log(place, rr.Pinhole(image_from_camera=matrix, width=width, height=height, image_plane_distance=0.1), static=True)
    stream.send_columns(place, times, rr.Transform3D.columns(translation=poses[:, :3, 3], mat3x3=poses[:, :3, :3]))


def _camera_poses(source: Source, episode: Episode, name: str) -> np.ndarray | None:
    """Poses of a camera in the world, columns right, down, forward, position: [T, 4, 4]; None if they are not recorded."""
    place = f"obs/sensor_param/{source.cameras[name]}/cam2world_gl"
    return episode[place] if place in episode.streams else None


def _log_depth(rr: Any, stream: Any, source: Source, episode: Episode) -> None:
    for name, video in depth_videos(source, episode).items():
        unit = depth_unit(video)
        images = [png_of(to_uint16(video[t], unit)) for t in range(episode.length)]
        place = f"world/cameras/{name}/depth"
        stream.log(place, rr.EncodedDepthImage.from_fields(media_type="image/png", meter=1 / unit), static=True)
        stream.send_columns(place, _times(rr, source, len(images)), rr.EncodedDepthImage.columns(blob=images))


def _log_scene(rr: Any, stream: Any, source: Source, episode: Episode) -> None:
    """The geoms of each body, once, and the poses of the bodies that move, at every observation."""
    for body in bodies(episode):
        place = body_entity(body.number, body.name)
        for shape in body.shapes:
            stream.log(geom_entity(place, shape.number, shape.name), _drawn(rr, shape), static=True)
        quats = body.quats[:, [1, 2, 3, 0]]
        if body.moves:
            stream.send_columns(
                place, _times(rr, source, episode.length), rr.Transform3D.columns(translation=body.positions, quaternion=quats)
            )
        else:
            stream.log(place, rr.Transform3D(translation=body.positions[0], quaternion=quats[0]), static=True)


def _part(i: int, name: str) -> str:
    """Part of an entity's path: a number, and the name without characters that need an escape."""
    return f"{i}_{re.sub(r'[^a-zA-Z0-9_.-]', '.', name)}"


def _drawn(rr: Any, shape: Shape) -> Any:
    """Rerun's shape."""
    x, _, z = shape.size
    if shape.triangles is not None:
        # Each triangle has its own, so that edges are sharp.
        corners = shape.triangles.reshape(-1, 3) @ shape.rotation.T + shape.position
        normals = np.repeat(np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3]), 3, 0)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return rr.Mesh3D(vertex_positions=corners, vertex_normals=normals, albedo_factor=shape.rgba)
    looks = dict(quaternions=[shape.quat[[1, 2, 3, 0]]], colors=[np.rint(shape.rgba * 255).astype(np.uint8)], fill_mode="solid")
    if shape.kind == "box":
        return rr.Boxes3D(half_sizes=[shape.size], centers=[shape.position], **looks)
    if shape.kind == "ellipsoid":
        return rr.Ellipsoids3D(half_sizes=[shape.size], centers=[shape.position], **looks)
    if shape.kind == "cylinder":
        return rr.Cylinders3D(lengths=[2 * z], radii=[x], centers=[shape.position], **looks)
    end = shape.position - z * shape.rotation[:, 2]  # Rerun's capsules begin at their pose
    return rr.Capsules3D(lengths=[2 * z], radii=[x], translations=[end], **looks)
