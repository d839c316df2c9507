# SPDX-License-Identifier: Apache-2.0
"""Replacements for modules of mjlab and MolmoSpaces: code written for them runs after changing its imports.

The modules gymnasium, dm_control and robosuite make the environments of these packages draw with mjsense.
"""
