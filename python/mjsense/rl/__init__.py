# SPDX-License-Identifier: Apache-2.0
"""Tasks as the trainers of others want them: :mod:`mjsense.rl.sb3` (Stable-Baselines3) and :mod:`mjsense.rl.rsl` (rsl-rl)."""
