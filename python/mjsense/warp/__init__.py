# SPDX-License-Identifier: Apache-2.0
"""Worlds and sensors on mujoco_warp. Import it through ``mjs.Simulation(..., backend="warp")``; the extra ``warp`` installs what
it needs."""
