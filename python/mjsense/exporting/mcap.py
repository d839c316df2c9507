# SPDX-License-Identifier: Apache-2.0
"""Export to MCAP files with the messages of Foxglove's schemas."""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.rotations import quaternions_of
from mjsense.dataset import Episode, Video
from mjsense.dataset.video_decoder import open_container
from mjsense.exporting.images import CRF, depth_videos, padded
from mjsense.exporting.mapping import Source, check_names
from mjsense.exporting.output import join_folders, needs
from mjsense.exporting.scene import Body, Shape, bodies

_NS = 1_000_000_000
_WORLD = "world"
_Message = tuple[int, str, Any]
"""Observation, topic, and a protobuf message or a dict of numbers."""


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None, *, encode_again: bool = False) -> None:
    """Writes the files of all episodes to the new folder ``path``."""
    writers, schemas = needs("mcap.writer", "mcap"), needs("mcap_protobuf.schema", "mcap")
    for module in ("foxglove_schemas_protobuf", "av"):
        needs(module, "mcap")
    check_names(
        [
            *((topic, f"the topic '/{topic}'") for topic in ("tf", "scene", "joint_states")),
            *((name, f"the feature '{name}'") for name in source.features),
        ]
    )
    path.mkdir()
    for episode in source.each(progress):
        with open(path / f"episode_{episode.index:08d}.mcap", "wb") as file:
            writer = writers.Writer(file)
            writer.start(library="mjsense")
            about = {"task": episode.task, "outcome": episode.outcome, "seed": str(episode.seed), "robot": source.robot}
            writer.add_metadata("episode", about | {"file": f"{episode.path.name}/{episode.trajectory}"})
            _write(writer, schemas.register_schema, source, _messages(source, episode, encode_again))
            writer.finish()


join = join_folders


def _messages(source: Source, episode: Episode, encode_again: bool) -> Iterator[_Message]:
    """All messages of an episode in the order of their observations."""
    streams = [_feature(source, episode, name) for name in source.features]
    streams += [_video(source, episode, name, encode_again) for name in source.cameras]
    streams += [_calibration(source, episode, name) for name in source.cameras]
    streams += [_depth(name, video) for name, video in depth_videos(source, episode).items()]
    shown = bodies(episode)
    streams += [_joints(episode), _scene(shown), _transforms(source, episode, shown)]
    return heapq.merge(*streams, key=lambda message: message[0])


def _write(writer: Any, register_schema: Callable[[Any, Any], int], source: Source, messages: Iterable[_Message]) -> None:
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}
    for t, topic, message in messages:
        time = int(t * _NS / source.fps)
        is_json = isinstance(message, dict)
        if topic not in channels:
            kind = topic if is_json else type(message).DESCRIPTOR.full_name
            if kind not in schemas:
                schemas[kind] = _register_json(writer, topic, message) if is_json else register_schema(writer, type(message))
            channels[topic] = writer.register_channel(topic, "json" if is_json else "protobuf", schemas[kind])
        data = json.dumps(message).encode() if is_json else _stamped(message, time).SerializeToString()
        writer.add_message(channels[topic], log_time=time, publish_time=time, sequence=t, data=data)


def _register_json(writer: Any, topic: str, message: dict[str, Any]) -> int:
    numbers = {"type": "object", "properties": {name: {"type": ["number", "null"]} for name in message}}
    return writer.register_schema(f"mjsense{topic.replace('/', '.')}", "jsonschema", json.dumps(numbers).encode())


def _stamped(message: Any, time: int) -> Any:
    """The message with the time of all of its parts that have one."""
    name = type(message).__name__
    for part in message.transforms if name == "FrameTransforms" else message.entities if name == "SceneUpdate" else [message]:
        part.timestamp.FromNanoseconds(time)
    return message


def _message(kind: str, **fields: Any) -> Any:
    """A message of Foxglove's."""
    return getattr(needs(f"foxglove_schemas_protobuf.{kind}_pb2", "mcap"), kind)(**fields)


# Topics. Each function yields its messages in the order of the observations.


def _feature(source: Source, episode: Episode, name: str) -> Iterator[_Message]:
    for t, row in enumerate(source.rows(episode)[name].astype(np.float64)):
        yield (
            t,
            f"/{name}",
            {n: value if np.isfinite(value) else None for n, value in zip(source.features[name].names, row.tolist())},
        )


def _video(source: Source, episode: Episode, name: str, encode_again: bool) -> Iterator[_Message]:
    video = source.video(episode, name)
    packets = _copied(video)
    if packets is None:
        if not encode_again:
            raise ValueError(
                f"{video.path} has B-frames, which MCAP's CompressedVideo does not allow: record without B-frames, "
                "or pass encode_again=True (--encode-again)"
            )
        packets = _encoded(video)
    for t, packet in enumerate(packets):
        yield t, f"/cameras/{name}/video", _message("CompressedVideo", frame_id=name, data=packet, format="h264")


def _copied(video: Video) -> list[bytes] | None:
    """The frames as Annex B, each with the parameter sets if it is a key frame; None if the video has B-frames."""
    from av.bitstream import BitStreamFilterContext  # pyright: ignore[reportMissingImports]

    with open_container(video.path, video._info.crc) as container:
        stream = container.streams.video[0]
        convert = BitStreamFilterContext("h264_mp4toannexb", stream)
        packets = [packet for packet in container.demux(stream) if packet.size]
        if any(packet.pts != packet.dts for packet in packets):
            return None
        return [bytes(out) for packet in packets for out in convert.filter(packet)]


def _encoded(video: Video) -> Iterator[bytes]:
    import av  # pyright: ignore[reportMissingImports]

    height, width = video.shape[1:3]
    encoder: Any = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width + width % 2, height + height % 2, "yuv420p"
    encoder.framerate = video.fps
    # Zerolatency: no B-frames, one packet for each frame.
    encoder.options = {
        "preset": "veryfast",
        "tune": "zerolatency",
        "crf": str(CRF),
    }
    for t in range(len(video)):
        yield b"".join(bytes(packet) for packet in encoder.encode(padded(video[t])))


def _depth(name: str, video: Video) -> Iterator[_Message]:
    height, width = video.shape[1:3]
    for t in range(len(video)):
        data = video[t].astype("<f4").tobytes()
        yield (
            t,
            f"/cameras/{name}/depth",
            _message("RawImage", frame_id=name, width=width, height=height, encoding="32FC1", step=4 * width, data=data),
        )


def _calibration(source: Source, episode: Episode, name: str) -> Iterator[_Message]:
    place = f"obs/sensor_param/{source.cameras[name]}/intrinsic_cv"
    height, width = source.video(episode, name).shape[1:3]
    for t, matrix in enumerate(episode[place] if place in episode.streams else ()):
        numbers = {
            "D": [0.0] * 5,
            "K": matrix.ravel(),
            "R": np.eye(3).ravel(),
            "P": np.hstack([matrix, np.zeros((3, 1))]).ravel(),
        }
        calibration = _message(
            "CameraCalibration", frame_id=name, width=width, height=height, distortion_model="plumb_bob", **numbers
        )
        yield t, f"/cameras/{name}/calibration", calibration


def _joints(episode: Episode) -> Iterator[_Message]:
    """Positions and velocities by move group: ``arm_0``, ``arm_1``."""
    places = ("obs/agent/qpos", "obs/agent/qvel")
    if any(place not in episode for place in places):
        return
    positions, velocities = (episode[place] for place in places)
    groups = [
        group for group, rows in positions.items() if rows.ndim == 2 and velocities.get(group, rows[:0]).shape == rows.shape
    ]
    for t in range(episode.length if groups else 0):
        joints = [
            _message("JointState", name=f"{group}_{i}", position=positions[group][t, i], velocity=velocities[group][t, i])
            for group in groups
            for i in range(positions[group].shape[1])
        ]
        yield t, "/joint_states", _message("JointStates", joints=joints)


def _pose(position: np.ndarray, quat: np.ndarray) -> dict[str, dict[str, float]]:
    """Position and orientation as the fields of a pose; ``quat`` is wxyz."""
    x, y, z = (float(value) for value in position)
    w, i, j, k = (float(value) for value in quat)
    return {"position": {"x": x, "y": y, "z": z}, "orientation": {"x": i, "y": j, "z": k, "w": w}}


def _transforms(source: Source, episode: Episode, shown: list[Body]) -> Iterator[_Message]:
    """Poses of cameras and bodies in the world; those of bodies that do not move only once."""
    frames: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, camera in source.cameras.items():
        place = f"obs/sensor_param/{camera}/cam2world_gl"
        if place in episode.streams:
            poses = episode[place]
            frames[name] = poses[:, :3, 3], quaternions_of(poses[:, :3, :3])
    frames |= {_frame(body): (body.positions, body.quats) for body in shown}
    for t in range(episode.length if frames else 0):
        moved = {name: pose for name, pose in frames.items() if t == 0 or any((rows[t] != rows[t - 1]).any() for rows in pose)}
        transforms = []
        for name, (positions, quats) in moved.items():
            pose = _pose(positions[t], quats[t])
            transforms.append(
                _message(
                    "FrameTransform",
                    parent_frame_id=_WORLD,
                    child_frame_id=name,
                    translation=pose["position"],
                    rotation=pose["orientation"],
                )
            )
        if transforms:
            yield t, "/tf", _message("FrameTransforms", transforms=transforms)


def _frame(body: Body) -> str:
    return f"body/{body.name}"


def _scene(shown: list[Body]) -> Iterator[_Message]:
    """The geoms of each body, once, in the frame of the body."""
    entities = []
    for body in shown:
        entity = _message("SceneEntity", frame_id=_frame(body), id=body.name, frame_locked=True)
        for shape in body.shapes:
            _draw(entity, shape)
        entities.append(entity)
    if entities:
        yield 0, "/scene", _message("SceneUpdate", entities=entities)


def _draw(entity: Any, shape: Shape) -> None:
    colour = dict(zip("rgba", shape.rgba.tolist()))
    pose, (x, y, z) = _pose(shape.position, shape.quat), (2 * shape.size).tolist()
    if shape.triangles is not None:
        points = [dict(zip("xyz", point)) for point in shape.triangles.reshape(-1, 3).tolist()]
        entity.triangles.add(pose=pose, points=points, color=colour)
    elif shape.kind == "box":
        entity.cubes.add(pose=pose, size={"x": x, "y": y, "z": z}, color=colour)
    elif shape.kind == "ellipsoid":
        entity.spheres.add(pose=pose, size={"x": x, "y": y, "z": z}, color=colour)
    else:
        entity.cylinders.add(pose=pose, size={"x": x, "y": y, "z": z}, bottom_scale=1, top_scale=1, color=colour)
        for end in (-1, 1) if shape.kind == "capsule" else ():
            centre = shape.position + end * shape.size[2] * shape.rotation[:, 2]
            entity.spheres.add(pose=_pose(centre, shape.quat), size={"x": x, "y": x, "z": x}, color=colour)
