# SPDX-License-Identifier: Apache-2.0
"""Robots."""

from mjsense.tasks.robot import Robot

__all__ = ["Robot"]
