# SPDX-License-Identifier: Apache-2.0
"""How sensors with the methods of other libraries are called."""

from __future__ import annotations

from mjsense.compat.mjlab_methods import MjlabCalls
from mjsense.compat.peer.per_world import PerWorldCalls

ADAPTERS = (MjlabCalls, PerWorldCalls)
"""A sensor is called by the first one whose ``fits(sensor)`` is true."""
