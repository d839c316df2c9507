# SPDX-License-Identifier: Apache-2.0
"""Export of recordings to the formats of other programs, one module each. Their libraries are imported when an export begins."""

from mjsense.exporting.lerobot import export_lerobot
from mjsense.exporting.lerobot21 import export_lerobot21
from mjsense.exporting.mapping import Feature, Mapping, Source
from mjsense.exporting.mcap import export_mcap
from mjsense.exporting.rerun import export_rerun
from mjsense.exporting.rlds import export_rlds
from mjsense.exporting.robomimic import export_robomimic
from mjsense.exporting.zarr import export_zarr

FORMATS = {
    "lerobot": "LeRobot v3.0",
    "lerobot21": "LeRobot v2.1 with meta/modality.json, as GR00T reads it",
    "robomimic": "one HDF5 file of robomimic, with simulator states and models",
    "rlds": "RLDS for tensorflow-datasets",
    "zarr": "Zarr 2, as Diffusion Policy reads it",
    "rerun": "files for the Rerun viewer, one for each episode",
    "mcap": "MCAP files with Foxglove's schemas, one for each episode",
}
"""Names and one-line descriptions. The module ``mjsense.exporting.NAME`` has the function ``export_NAME``."""

__all__ = ["FORMATS", "Feature", "Mapping", "Source", "export_lerobot", "export_lerobot21", "export_mcap", "export_rerun", "export_rlds",
           "export_robomimic", "export_zarr"]  # fmt: skip
