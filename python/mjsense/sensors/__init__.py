# SPDX-License-Identifier: Apache-2.0
"""Sensors, their configurations and data, effects, and suites."""
