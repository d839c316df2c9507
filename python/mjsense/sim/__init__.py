# SPDX-License-Identifier: Apache-2.0
"""Simulations: worlds of one scene that are stepped together, or follow another program's data."""
