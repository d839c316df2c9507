# SPDX-License-Identifier: Apache-2.0
"""Parts of other packages: scenes and sensors of mjlab; tasks, policies, robots and sensors of MolmoSpaces.

The modules gymnasium, dm_control and robosuite make the environments of these packages draw with mjsense.
"""
