# SPDX-License-Identifier: Apache-2.0
"""Export to recordings of the Rerun viewer: videos, numbers, cameras, and the 3D scene."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.png import png_of
from mjsense.dataset import Episode
from mjsense.exporting.images import depth_unit, depth_videos, to_uint16
from mjsense.exporting.mapping import Mapping, Source
from mjsense.exporting.output import join_folders, needs, new_output
from mjsense.exporting.scene import Shape, bodies


@checked
def export_rerun(
    root: str | Path,
    out: str | Path,
    *,
    map: Mapping | str | Path | dict[str, Any] | None = None,
    episodes: Iterable[int] | None = None,
    success: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a recording as a folder of ``.rrd`` files, one for each episode, which ``rerun OUT/*.rrd`` shows: the videos as they are,
    depth images, features as curves, and, if the recording has data for replay, the geoms of the scene.

    Args:
        root: Recording: its folder, one of its ``house_N`` folders, or one HDF5 file.
        out: Folder to write. It must not exist.
        map: Which streams become which curves: a TOML file, a dict of the same form, or a Mapping.
        episodes: Positions of episodes in the recording; by default all.
        success: Only successful (True) or only failed (False) episodes.
        progress: Called with the number of written episodes and of all episodes.

    Returns:
        ``out``.
    """
    source = Source(root, map=map, episodes=episodes, success=success)
    source.print_notes()
    with new_output(out) as path:
        write(source, path, progress)
    return Path(out)


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes the files of all episodes to the new folder ``path``."""
    rr = needs("rerun", "rerun")
    path.mkdir()
    for episode in source.each(progress):
        name = f"episode_{episode.index:08d}"
        stream = rr.RecordingStream("mjsense", recording_id=f"{source.name}_{name}")
        stream.save(path / f"{name}.rrd", default_blueprint=_blueprint(source, episode))
        stream.send_recording_name(f"{episode.index}: {episode.task}")
        stream.send_property("episode", rr.AnyValues(outcome=episode.outcome, seed=str(episode.seed), file=f"{episode.path.name}/{episode.trajectory}"))
        stream.log("task", rr.TextDocument(episode.task), static=True)
        _log_features(rr, stream, source, episode)
        for camera in source.cameras:
            _log_camera(rr, stream, source, episode, camera)
        _log_depth(rr, stream, source, episode)
        _log_scene(rr, stream, source, episode)
        stream.disconnect()


join = join_folders


def _blueprint(source: Source, episode: Episode) -> Any:
    """Layout of the viewer: the scene, seen from 37 degrees to the side of the camera that moves least, the videos, and the curves."""
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
    shown = ["$origin/**", *(f"- $origin/cameras/{name}/depth" for name in source.cameras)]  # depth images would cover the scene with points
    scene = rrb.Spatial3DView(origin="world", name="scene", contents=shown, eye_controls=eye)
    left = rrb.Vertical(scene, rrb.TextDocumentView(origin="task", name="task"), row_shares=[9, 1])
    right = rrb.Vertical(*cameras, rrb.Tabs(*curves)) if cameras else rrb.Tabs(*curves)
    return rrb.Blueprint(rrb.Horizontal(left, right, column_shares=[3, 2]), rrb.TimePanel(timeline="time"))


def _times(rr: Any, source: Source, rows: int) -> list[Any]:
    return [rr.TimeColumn("time", duration=[float(t / source.fps) for t in range(rows)]), rr.TimeColumn("frame", sequence=range(rows))]


def _log_features(rr: Any, stream: Any, source: Source, episode: Episode) -> None:
    for name, rows in source.rows(episode).items():
        stream.log(f"features/{name}", rr.SeriesLines(names=list(source.features[name].names)), static=True)
        stream.send_columns(f"features/{name}", _times(rr, source, len(rows)), rr.Scalars.columns(scalars=rows.astype(np.float64)))


def _log_camera(rr: Any, stream: Any, source: Source, episode: Episode, name: str) -> None:
    place, video, times = f"world/cameras/{name}", source.video(episode, name), _times(rr, source, episode.length)
    video.check()
    asset = rr.AssetVideo(path=video.path)
    stream.log(f"{place}/colour", asset, static=True)
    frames = rr.VideoFrameReference.columns(timestamp=[rr.components.VideoTimestamp(nanoseconds=int(t)) for t in asset.read_frame_timestamps_nanos()])
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
    for i, body in enumerate(bodies(episode)):
        place = f"world/scene/{_part(i, body.name)}"
        for k, shape in enumerate(body.shapes):
            stream.log(f"{place}/{_part(k, shape.name)}", _drawn(rr, shape), static=True)
        quats = body.quats[:, [1, 2, 3, 0]]
        if body.moves:
            stream.send_columns(place, _times(rr, source, episode.length), rr.Transform3D.columns(translation=body.positions, quaternion=quats))
        else:
            stream.log(place, rr.Transform3D(translation=body.positions[0], quaternion=quats[0]), static=True)


def _part(i: int, name: str) -> str:
    """Part of an entity's path: a number, and the name without characters that need an escape."""
    return f"{i}_{re.sub(r'[^a-zA-Z0-9_.-]', '.', name)}"


def _drawn(rr: Any, shape: Shape) -> Any:
    """Rerun's shape."""
    x, _, z = shape.size
    if shape.triangles is not None:
        corners = shape.triangles.reshape(-1, 3) @ shape.rotation.T + shape.position  # each triangle has its own, so that edges are sharp
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
