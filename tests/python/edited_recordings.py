# SPDX-License-Identifier: Apache-2.0
"""Changes of recordings, for tests of their readers."""

import contextlib
import json

import h5py


def file_of(root):
    """The first HDF5 file of a recording."""
    return min(root.glob("house_*/trajectories_batch_*.h5"))


@contextlib.contextmanager
def changed(file):
    """The HDF5 file, open for changes. At the end the checksums of its datasets are removed, as a program that changes them has to do."""
    def remove(_, one):
        if isinstance(one, h5py.Dataset) and "width" not in one.attrs:  # a video's checksum stays
            one.attrs.pop("crc32", None)

    with h5py.File(file, "a") as opened:
        yield opened
        opened.visititems(remove)


def describe(root, change):
    """Passes the description of a recording, the attribute ``recording``, to a function that changes it."""
    with changed(file_of(root)) as file:
        about = json.loads(file.attrs["recording"])
        change(about)
        file.attrs["recording"] = json.dumps(about)


def rename_video(root, camera, name):
    """Writes another name of a camera's video into the first trajectory."""
    with changed(file_of(root)) as file:
        group = file["traj_0/obs/sensor_data"]
        attributes = dict(group[camera].attrs)
        del group[camera]
        made = group.create_dataset(camera, data=list(name.encode() + b"\0"), dtype="u1")
        for key, value in attributes.items():
            made.attrs[key] = value
