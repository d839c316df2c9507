# SPDX-License-Identifier: Apache-2.0
"""Recording of demonstrations by a person who drives the robot in the viewer."""

from mjsense.tasks.teleoperation.teleoperation import Teleoperation, play

__all__ = ["Teleoperation", "play"]
