# SPDX-License-Identifier: Apache-2.0
"""What all rooms use: errors, arguments, arrays, MuJoCo's library and names, progress."""
