# SPDX-License-Identifier: Apache-2.0
"""Scenes in motion as files: ``.viser`` for web pages, ``.rrd`` for Rerun."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mjsense.core.new_output import expect_folder
from mjsense.core.progress_line import tracked
from mjsense.core.rotations import rotation_of
from mjsense.dataset import Dataset, Episode
from mjsense.exporting.rerun import RerunFile, body_entity, geom_entity
from mjsense.viewer import surfaces
from mjsense.viewer.camera import first_view
from mjsense.viewer.curves import MAX_CURVES
from mjsense.viewer.server import serve, stop
from mjsense.viewer.soft import fields_of
from mjsense.viewer.source import LiveSource
from mjsense.viewer.stage import MIN_REACH, VISIBLE_GROUPS, Stage


class Moment(NamedTuple):
    """One step of an export."""

    time: float
    """s since the start."""
    model: Any
    """The model from now on; None: unchanged."""
    fields: dict[str, np.ndarray]
    """What the picture of the model depends on, of MjData."""
    values: dict[str, np.ndarray]
    """Rows of streams."""
    images: dict[str, np.ndarray]


def export(
    source: LiveSource | Dataset,
    path: str | Path,
    *,
    world: int = 0,
    episode: int = 0,
    seconds: float = 10.0,
    progress: bool | None = None,
) -> None:
    """Writes an episode of a recording, or some seconds of a live world, to a file.

    Args:
        path: A file that ends in ``.viser`` (shapes only) or ``.rrd`` (with streams and images; ``mjsense[rerun]``).
        seconds: Length of the export of a live world. [s]
        progress: Show the progress on stderr; by default where it is a terminal or a notebook.
    """
    path = Path(path)
    writers = {".viser": _write_viser, ".rrd": _write_rerun}
    if path.suffix not in writers:
        raise ValueError(f"--export: {path.name} ends in neither .viser nor .rrd")
    expect_folder(path)
    if isinstance(source, Dataset):
        if not 0 <= episode < len(source.episodes):
            raise ValueError(f"episode {episode}: must be in [0, {len(source.episodes)})")
        one = source.episodes[episode]
        moments, period, count = _recorded(source, one, path.suffix == ".rrd"), 1 / float(source.fps), one.length
    else:
        count = max(1, round(seconds / source.period))
        moments, period = _live(source, world, count, path.suffix == ".rrd"), source.period
    writers[path.suffix](tracked(moments, count, "steps", enabled=progress), period, path)


def _live(source: LiveSource, world: int, count: int, full: bool) -> Iterator[Moment]:
    streams, pictures = (list(source.streams()), source.pictures()) if full else ([], [])
    shown = None
    for step in range(count):
        values = {name: source.value(name, world) for name in streams}
        images = {name: source.picture(name, world) for name in pictures}
        fields = {name: source.field(name, world).copy() for name in fields_of(source.sim.model)}
        yield Moment(step * source.period, source.model(world) if source.version != shown else None, fields, values, images)
        shown = source.version
        source.step()


def _recorded(dataset: Dataset, episode: Episode, full: bool) -> Iterator[Moment]:
    model = episode.model()
    rows, videos = {}, {}
    if full:
        names = [
            n
            for n, s in dataset.streams.items()
            if s.kind != "video" and s.dtype.kind in "fiub" and 0 < np.prod(s.shape) <= MAX_CURVES
        ]
        rows = {name: episode[name] for name in names if name in episode}
        videos = {name: episode.video(name) for name, stream in dataset.streams.items() if stream.kind == "video"}
    for t, data in episode.replay(model=model):
        yield Moment(
            t / float(dataset.fps),
            None if t else model,
            {name: getattr(data, name).copy() for name in fields_of(model)},
            {name: np.asarray(values[t], np.float64).reshape(-1) for name, values in rows.items()},
            {name: video[t] for name, video in videos.items()},
        )


def _write_viser(moments: Iterator[Moment], period: float, path: Path) -> None:
    server, _, _ = serve("export", "127.0.0.1", 0)
    try:
        stage, serializer = Stage(server), None
        for moment in moments:
            if moment.model is not None:
                stage.set_model(moment.model)
            stage.show(moment.fields.__getitem__)
            if serializer is None:
                xmat = np.stack([rotation_of(quaternion) for quaternion in moment.fields["xquat"]])
                camera = server.initial_camera
                camera.position, camera.look_at, camera.fov = first_view(moment.model, moment.fields["xpos"], xmat)
                serializer = server.get_scene_serializer()
            serializer.insert_sleep(period)
        if serializer is not None:
            path.write_bytes(serializer.serialize())
    finally:
        stop(server)


def _write_rerun(moments: Iterator[Moment], period: float, path: Path) -> None:
    with RerunFile(path) as file:
        bodies: list[str] = []
        sent = np.zeros((0, 7))
        for step, moment in enumerate(moments):
            file.at(step, moment.time)
            if moment.model is not None:
                bodies = _log_model(file, moment.model)
                sent = np.full((len(bodies), 7), np.nan)
            poses = np.concatenate([moment.fields["xpos"], moment.fields["xquat"]], 1)
            for body in np.flatnonzero((poses != sent).any(1)).tolist():
                file.pose(bodies[body], poses[body, :3], poses[body, 3:])
            sent = poses
            for name, values in moment.values.items():
                file.curve(name, values)
            for name, image in moment.images.items():
                file.image(name, image)


def _log_model(file: RerunFile, model: Any) -> list[str]:
    """Logs the visible geoms, and returns the entities of the bodies."""
    bodies = [body_entity(body, model.body(body).name) for body in range(model.nbody)]
    reach = max(MIN_REACH, 2 * float(model.stat.extent))
    for geom in range(model.ngeom):
        surface = surfaces.of_geom(model, geom, reach) if int(model.geom_group[geom]) in VISIBLE_GROUPS else None
        if surface is None:
            continue
        shape, body = surface.shape, int(model.geom_bodyid[geom])
        place = geom_entity(bodies[body], geom - int(model.body_geomadr[body]), model.geom(geom).name or f"geom_{geom}")
        file.mesh(
            place,
            model.geom_pos[geom],
            model.geom_quat[geom],
            vertices=shape.vertices,
            faces=shape.faces,
            vertex_normals=shape.normals,
            vertex_texcoords=shape.uv,
            albedo_texture=surface.texture,
            albedo_factor=surface.rgba,
        )
    return bodies
