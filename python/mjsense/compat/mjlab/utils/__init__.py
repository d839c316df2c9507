# SPDX-License-Identifier: Apache-2.0
"""``mjlab.utils``, as far as configurations of entities need it."""
