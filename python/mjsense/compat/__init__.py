# SPDX-License-Identifier: Apache-2.0
"""What was written for another library runs here when its import is changed."""
