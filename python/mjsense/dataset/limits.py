# SPDX-License-Identifier: Apache-2.0
"""Limits of what a recording may contain. A reader refuses more, and its error names the limit.

They are far above what is recorded, and low enough that a hostile file of any kind is refused within a second and 1 GB of memory.
"""

DESCRIPTION_BYTES = 1 << 22
"""Text of the attribute ``recording``; as in the C++ reader."""
SCENE_BYTES = 1 << 24
"""Text of ``obs_scene``; as in the C++ reader."""
TEXT_BYTES = 1 << 16
"""Any other text: an outcome, a description of a stream."""
JSON_DEPTH = 60
"""Nesting of JSON values; readers recurse once for each level. The C++ reader has 64: a rendering puts the description of its
source into its own."""
JSON_VALUES = 200_000
"""Values in one JSON text. The longest text that was recorded, with 100 objects, has 3,000."""
JSON_ROW_BYTES = 1 << 20
"""One JSON row. The recorder writes 4000 bytes, and more if a sensor asks for it."""
ROW_LEAVES = 4096
"""Leaves of one JSON row, each of which becomes a stream."""
NAME_BYTES = 255
"""A file name; the limit of Linux file systems."""
NAMES = 100_000
"""Objects of one HDF5 group or trajectory."""
GROUP_DEPTH = 32
"""Nesting of HDF5 groups."""
STEPS = 10_000_000
"""Observations of an episode: a week at 15 Hz."""
EPISODES = 10_000_000
"""Rows of an index."""
OBJECT_BYTES = 1 << 30
"""An object of a bucket that is read into memory: an index, ``job.json`` or ``done.json``."""
ROW_BYTES = 1 << 26
"""One row or one chunk of a dataset; a segmentation image of 4096 x 2048 pixels has 64 MiB."""
CHUNKS = 1_000_000
"""Chunks of a dataset."""
RATIO = 1100
"""Bytes of a dataset for each byte that it stores; deflate packs at most 1032 to 1."""
UNPACKED_FREE, UNPACKED_RATIO = 1 << 29, 200
"""A dataset that is read as a whole has at most so many bytes, and so many more for each byte of its file."""
SPARSE_FREE, SPARSE_RATIO = 1 << 30, 1000
"""A file with more bytes than the first, and with more than so many bytes for each byte on the disk, is mostly a hole."""
IMAGE_SIDE, IMAGE_PIXELS = 16_384, 1 << 26
"""Width or height, and number of pixels, of an image."""
RATE_DIGITS = 12
"""Digits of the numerator and of the denominator of a rate."""
RATES = (1e-5, 1e6)
"""Observations per second."""
PERIOD_MS = 1e8
"""Duration of one observation: about a day. [ms]"""
