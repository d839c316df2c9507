# SPDX-License-Identifier: Apache-2.0
"""Recordings of sensors and of any Gymnasium environment."""
