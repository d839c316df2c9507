# SPDX-License-Identifier: Apache-2.0
"""The worlds, the robot and the task as sensors written for MolmoSpaces see them: ``get_observation(env, task, batch_index)``.

These objects are read-only views: nothing can be written through them.
"""

from mjsense.compat.peer.env import PeerEnv

__all__ = ["PeerEnv"]
