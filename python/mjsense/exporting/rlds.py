# SPDX-License-Identifier: Apache-2.0
"""Export to RLDS: TFRecord files that tensorflow-datasets reads. TensorFlow is not needed to write them."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.png import png_of
from mjsense.dataset import Episode
from mjsense.exporting.images import FLAGS, depth_unit, depth_videos, to_uint16
from mjsense.exporting.mapping import Source, check_names, named_streams
from mjsense.exporting.output import needs

_VERSION = "1.0.0"
_SHARD_BYTES = 200_000_000
_OWN = ("observation", "reward", "discount", "is_first", "is_last", "is_terminal", "language_instruction")
"""Members of a step."""
_MODULE = "tensorflow_datasets.core.features."


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes all episodes to the new folder ``path``, whose name is that of the data set."""
    _write_data_set(source, _records(source, progress), path)


def join(source: Source, parts: Iterable[Path], path: Path) -> None:
    """Writes the new data set ``path`` with the records of several data sets.

    Args:
        source: The episodes of all parts.
    """
    _write_data_set(source, (record for part in parts for record in _records_of(part)), path)


def _write_data_set(source: Source, records: Iterable[bytes], path: Path) -> None:
    name = path.name
    observed = [feature for feature in source.features if not source.features[feature].of_step]
    others = [feature for feature in source.features if source.features[feature].of_step and feature not in FLAGS]
    check_names(
        [
            *((key, f"RLDS's '{key}'") for key in _OWN),
            *((feature, f"the feature '{feature}'") for feature in others),
            *named_streams(source, observed, "observation/"),
        ]
    )
    if not re.fullmatch("[a-z][a-z0-9_]*", name):
        valid = re.sub(r"\W+", "_", name.lower())
        raise ValueError(
            f"The folder '{name}' cannot be the name of a data set of tensorflow-datasets; use small letters, "
            f"digits and _, such as '{valid}'"
        )
    folder = path / _VERSION
    folder.mkdir(parents=True)
    shards: list[list[int]] = []  # bytes of the examples of each shard
    for record in records:
        if not shards or sum(shards[-1]) > _SHARD_BYTES:
            shards.append([])
        with open(folder / f"shard_{len(shards) - 1}", "ab") as file:
            file.write(record)
        shards[-1].append(len(record) - _FRAME_BYTES)
    for k in range(len(shards)):
        (folder / f"shard_{k}").rename(folder / f"{name}-train.tfrecord-{k:05d}-of-{len(shards):05d}")
    split = {
        "name": "train",
        "filepathTemplate": "{DATASET}-{SPLIT}.{FILEFORMAT}-{SHARD_X_OF_Y}",
        "shardLengths": [str(len(shard)) for shard in shards],
        "numBytes": str(sum(sum(shard) for shard in shards)),
    }
    count = counted(len(source), "episode")
    about = f"{count} of the robot {source.robot} at {source.fps} observations per second, recorded with mjsense."
    info = {"name": name, "version": _VERSION, "description": about, "fileFormat": "tfrecord", "splits": [split]}
    (folder / "dataset_info.json").write_text(json.dumps(info, indent=2))
    (folder / "features.json").write_text(json.dumps(_features(source), indent=2))


# The description of the features, as tensorflow-datasets writes it.


def _dict(features: dict[str, Any]) -> dict[str, Any]:
    return {"pythonClassName": f"{_MODULE}features_dict.FeaturesDict", "featuresDict": {"features": features}}


def _tensor(dtype: str, shape: tuple[int, ...] = (), description: str = "") -> dict[str, Any]:
    kind = "tensor_feature.Tensor" if shape else "scalar.Scalar"
    dimensions = {"dimensions": [str(n) for n in shape]} if shape else {}
    return {
        "pythonClassName": _MODULE + kind,
        "tensor": {"dtype": dtype, "encoding": "none", "shape": dimensions},
        "description": description,
    }


def _image(dtype: str, shape: tuple[int, ...], description: str = "") -> dict[str, Any]:
    image = {"dtype": dtype, "encodingFormat": "png", "shape": {"dimensions": [str(n) for n in shape]}}
    return {"pythonClassName": f"{_MODULE}image_feature.Image", "image": image, "description": description}


def _text() -> dict[str, Any]:
    return {"pythonClassName": f"{_MODULE}text_feature.Text", "text": {}}


def _stored(dtype: np.dtype[Any]) -> str:
    """Type of the numbers in the file, whose format has three: float32, int64 and bytes."""
    return {"b": "bool", "f": "float32"}.get(dtype.kind, "int64")


def _features(source: Source) -> dict[str, Any]:
    observation: dict[str, Any] = {}
    step: dict[str, Any] = {name: _tensor("bool") for name in ("is_first", "is_last", "is_terminal")}
    step |= {"reward": _tensor("float32"), "discount": _tensor("float32"), "language_instruction": _text()}
    for name, feature in source.features.items():
        if name not in FLAGS:
            (step if feature.of_step else observation)[name] = _tensor(
                _stored(feature.dtype), (feature.size,), ", ".join(feature.names)
            )
    for name in source.cameras if source.episodes else ():
        observation[name] = _image("uint8", source.video(source.episodes[0], name).shape[1:])
    for name, video in depth_videos(source, source.episodes[0]).items() if source.episodes else ():
        observation[f"{name}_depth"] = _image(
            "uint16", (*video.shape[1:], 1), f"Distance to the camera plane in units of {depth_unit(video)} m; 0: no measurement."
        )
    steps = {
        "pythonClassName": f"{_MODULE}dataset_feature.Dataset",
        "sequence": {"feature": _dict({"observation": _dict(observation), **step}), "length": "-1"},
    }
    metadata = {
        "file_path": _text(),
        "outcome": _text(),
        "success": _tensor("bool"),
        "seed": _tensor("int64"),
        "trimmed_steps": _tensor("int64"),
    }
    return _dict({"steps": steps, "episode_metadata": _dict(metadata)})


# One episode as a tf.train.Example: a map from names to lists of bytes, floats or integers.


def _example(source: Source, episode: Episode) -> bytes:
    rows, steps = source.rows(episode), episode.length - 1
    flags = {name: np.zeros(steps, np.int64) for name in ("is_first", "is_last")}
    flags["is_first"][0] = flags["is_last"][-1] = 1
    values: dict[str, Any] = {f"steps/{name}": flag for name, flag in flags.items()}
    values["steps/is_terminal"] = rows["terminated"][:, 0]
    values["steps/reward"] = rows["reward"].astype(np.float32)
    values["steps/discount"] = 1 - rows["terminated"].astype(np.float32)
    values["steps/language_instruction"] = [episode.task.encode()] * steps
    for name, feature in source.features.items():
        if name not in FLAGS:
            place = f"steps/{name}" if feature.of_step else f"steps/observation/{name}"
            values[place] = rows[name][:steps].astype(np.float32 if feature.dtype.kind == "f" else np.int64)
    for name in source.cameras:
        video = source.video(episode, name)
        values[f"steps/observation/{name}"] = [png_of(video[t]) for t in range(steps)]
    for name, video in depth_videos(source, episode).items():
        values[f"steps/observation/{name}_depth"] = [png_of(to_uint16(video[t], depth_unit(video))) for t in range(steps)]
    values["episode_metadata/file_path"] = [f"{episode.path}/{episode.trajectory}".encode()]
    values["episode_metadata/outcome"] = [episode.outcome.encode()]
    values["episode_metadata/success"] = np.array([episode.success])
    values["episode_metadata/seed"] = np.array([episode.seed or 0])
    values["episode_metadata/trimmed_steps"] = np.array([episode.trimmed_steps])
    entries = [_field(1, _field(1, name.encode()) + _field(2, _feature(value))) for name, value in sorted(values.items())]
    return _field(1, b"".join(entries))


def _varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    result = bytearray()
    while value > 127:
        result.append(value & 127 | 128)
        value >>= 7
    return bytes(result + bytes([value]))


def _field(number: int, content: bytes) -> bytes:
    """A field of bytes or of a message, in protobuf's encoding."""
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _feature(values: Any) -> bytes:
    """tf.train.Feature: bytes_list = 1, float_list = 2 or int64_list = 3, each with value = 1."""
    if isinstance(values, list):
        return _field(1, b"".join(_field(1, value) for value in values))
    if values.dtype == np.float32:
        return _field(2, _field(1, values.astype("<f4").tobytes()))
    return _field(3, _field(1, b"".join(_varint(int(value)) for value in values.ravel())))


# Records of a TFRecord file: length, its checksum, data, its checksum.

_FRAME_BYTES = 16


def _records(source: Source, progress: Callable[[int, int], None] | None = None) -> Iterator[bytes]:
    checksum = needs("google_crc32c", "rlds").value

    def masked(content: bytes) -> bytes:
        crc = checksum(content)
        return struct.pack("<I", ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF)

    for episode in source.each(progress):
        data = _example(source, episode)
        length = struct.pack("<Q", len(data))
        yield length + masked(length) + data + masked(data)


def _records_of(folder: Path) -> Iterator[bytes]:
    for path in sorted((folder / _VERSION).glob("*.tfrecord-*")):
        with open(path, "rb") as file:
            while length := file.read(8):
                yield length + file.read(struct.unpack("<Q", length)[0] + _FRAME_BYTES - len(length))
