# SPDX-License-Identifier: Apache-2.0
"""Tasks as environments of RL libraries: :mod:`mjsense.tasks.rl.sb3` (Stable-Baselines3) and :mod:`mjsense.tasks.rl.rsl`
(rsl-rl)."""
