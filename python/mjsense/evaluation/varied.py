# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of a policy: the same episodes, in which one factor differs at a time."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.errors import did_you_mean, printable
from mjsense.evaluation.benchmarks import Benchmark, arrays_of, is_benchmark
from mjsense.evaluation.comparison import Comparison
from mjsense.evaluation.playing import play
from mjsense.evaluation.report import Results
from mjsense.evaluation.rows import group_of, key_of
from mjsense.evaluation.summary import rate_text
from mjsense.tasks.robot import Robot
from mjsense.tasks.vector import make_vec

UNCHANGED = "unchanged"
_TRIED = 4  # episodes in which a factor must change something
_SCENES = {
    "light": '[[vary]]\nwhat = "light"\npattern = ".*"\nbrightness = [0.4, 1.6]\nhue = 20\nangle = 20\n',
    "texture": (
        '[[vary]]\nwhat = "material"\npattern = "(?!robot_0/).*"\nbrightness = [0.6, 1.3]\nhue = 40\nsaturation = 0.25\n\n'
        '[[vary]]\nwhat = "geom"\npattern = "(?!robot_0/).*"\noptional = true\nbrightness = [0.6, 1.3]\nhue = '
        "40\nsaturation = 0.25\n"
    ),
    "distractors": "count = [1000, 1000]\n",  # all that the scene has
    "start": "[robot]\npos_spread = [0.05, 0.05]\nyaw_spread = 10\n",
}
"""What a scene that extends that of the evaluation adds to it."""
_CAMERA_NOISE = "pos_noise = [0.03, 0.03, 0.03]\nrot_noise = [4, 4, 4]\n"
FACTORS = {
    "light": "brightness, colour and direction of the lights",
    "camera": "poses of the cameras: 3 cm and 4 degrees",
    "texture": "colours of everything but the robot",
    "distractors": "all objects of the scene are present",
    "instruction": "the canonical sentence instead of paraphrases, or the reverse",
    "start": "place of the robot: 5 cm and 10 degrees more",
    "latency": "delay of the actions, in seconds: latency=0.1",
}
"""The factors, and what each changes."""
_SAME_START = ("light", "camera", "texture", "instruction", "latency")
"""Factors that do not change the state in which an episode starts."""


@dataclass(frozen=True)
class Sensitivity:
    """The result of :func:`sensitivity`. ``print(sensitivity)`` is a table."""

    unchanged: Results
    comparisons: dict[str, Comparison]
    """By factor: A is the evaluation without it, B with it."""

    def __str__(self) -> str:
        rates = {UNCHANGED: rate_text(group_of(self.unchanged.rows))}
        rates |= {name: rate_text(group_of(one.b.rows)) for name, one in self.comparisons.items()}
        width, size = (max(map(len, texts)) for texts in (rates, rates.values()))
        lines = [f"{'':{width}}  {'success':{size}}  difference, paired       p", f"{UNCHANGED:{width}}  {rates[UNCHANGED]}"]
        for name, one in self.comparisons.items():
            low, high = one.interval
            difference = f"{one.difference:+.1%} [{low:+.1%}, {high:+.1%}]"
            lines.append(f"{name:{width}}  {rates[name]:{size}}  {difference:23}  {one.p_value:.3g}")
        lines.append("95 % intervals: Wilson, and paired bootstrap; p: McNemar's exact test")
        return printable("\n".join(lines))


def sensitivity(vary: Iterable[str], **options: Any) -> Sensitivity:
    """Evaluates a policy on the same episodes without and with each of several factors, one at a time.

    Args:
        vary: Names of factors: ``light``, ``camera``, ``texture``, ``distractors``, ``instruction``, ``start``, ``latency=0.1``.
        options: Arguments of :func:`mjsense.evaluation.evaluate`. The evaluations are in the folders ``out/unchanged``,
            ``out/light`` and so on.

    Raises:
        ValueError: A factor is not known, or changes nothing in this task.
    """
    arguments = ("policy", "policy_options", "execution_horizon", "ensemble", "latency", "sensors", "ray", "progress")
    given = {name: options.pop(name) for name in arguments if name in options}
    options = {"task": "pick", "terminate_upon_success": True, **options}
    return play_varied(options, given.pop("policy", "planner"), list(vary), **given)


def play_varied(options: dict[str, Any], policy: Any, vary: list[str], **arguments: Any) -> Sensitivity:
    """See :func:`sensitivity`; the other arguments are those of :func:`mjsense.evaluation.playing.play`."""
    out = Path(options["out"])
    benchmark = Benchmark(options["task"]) if is_benchmark(options["task"]) else None
    if benchmark is not None:
        benchmark.check_starts(int(options.get("num_worlds", 4)))
        options = {**benchmark.options(options), "episodes": benchmark.episodes}
    base = {name: value for name, value in options.items() if name != "out"}
    out.mkdir(parents=True, exist_ok=True)
    cases = {_folder_of(text): _changes(text, base, out) for text in vary}
    _check(base, cases)
    found: dict[str, Results] = {}
    for name, (changed, more) in {UNCHANGED: ({}, {}), **cases}.items():
        case: dict[str, Any] = {**base, **changed, "out": out / name}
        if case.get("resume") and not any((out / name).glob("house_*")):
            del case["resume"]  # it was not begun
        found[name] = play(case, policy, **{**arguments, **more})
    unchanged = found.pop(UNCHANGED)
    made = Sensitivity(unchanged, {name: _compared(unchanged, results) for name, results in found.items()})
    (out / "sensitivity.txt").write_text(f"{made}\n", encoding="utf-8")
    return made


def _folder_of(text: str) -> str:
    name, _, value = text.partition("=")
    if name not in FACTORS:
        raise ValueError(f"vary: '{name}' is not a factor{did_you_mean(name, FACTORS, 'there are')}")
    if (name == "latency") != bool(value):
        raise ValueError(f"vary: '{text}': {'give seconds, latency=0.1' if name == 'latency' else 'this factor has no value'}")
    return text


def _changes(text: str, base: Mapping[str, Any], out: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options of a recording, and the arguments of ``play``, that a factor changes."""
    name, _, value = text.partition("=")
    if name == "latency":
        try:
            return {}, {"latency": float(value)}
        except ValueError:
            raise ValueError(f"vary: '{text}': must be seconds, such as latency=0.1") from None
    if name == "instruction":
        return {"instructions": "varied" if base.get("instructions") == "canonical" else "canonical"}, {}
    parts = {key: base[key] for key in ("task", "robot", "scene", "split") if base.get(key)}
    if not all(isinstance(part, str) for part in parts.values()):
        raise ValueError(f"vary: '{name}' needs a registered task, and a robot and a scene by their names or files")
    _, robot, scene, _, _ = _core.resolved_job({**parts, "out": "."})
    if name == "camera":
        if base.get("camera_system") or base.get("cameras") == []:
            raise ValueError("vary: 'camera' moves the cameras of the robot's model; leave out camera_system, and render cameras")
        return {"camera_system": _written(out / "camera.toml", _cameras(Robot(robot)))}, {}
    scene, _, part = scene.partition("@")
    extended = str(Path(scene).resolve()) if scene.endswith(".toml") else scene
    text = f'name = "{name}"\nextends = "{extended}"\n{_SCENES[name]}'
    changed = {"scene": _written(out / f"{name}.toml", text)}
    return {**changed, "split": part} if part else changed, {}


def _cameras(robot: Robot) -> str:
    width, height = robot.image_size
    mounts = [
        f'[[cameras]]\nname = "{one.name}"\nmount = "mjcf"\ncamera = "{one.camera}"\n{_CAMERA_NOISE}' for one in robot.cameras
    ]
    return "\n".join([f'name = "camera"\nwidth = {width}\nheight = {height}\n', *mounts])


def _written(path: Path, text: str) -> str:
    path.write_text(f"# Made by `mjsense evaluate --vary`.\n{text}", encoding="utf-8")
    return str(path)


def _check(base: Mapping[str, Any], cases: Mapping[str, tuple[dict[str, Any], dict[str, Any]]]) -> None:
    """Raises ValueError if a factor changes nothing in the first episodes, or the start of an episode although it must not."""
    starts = _starts(base)
    for text, (changed, _) in cases.items():
        name = text.partition("=")[0]
        if not changed:
            continue
        varied = _starts({**base, **changed})
        if name in _SAME_START and not all(np.array_equal(a, b) for a, b in zip(starts[0], varied[0])):
            raise ValueError(
                f"vary: '{name}' changes the states in which the episodes of this task start, and not only the {name}"
            )
        if all(np.array_equal(a, b) for a, b in zip(starts[0], varied[0])) and starts[1] == varied[1]:
            raise ValueError(f"vary: '{name}' changes nothing in this task ({FACTORS[name]}); leave it out")


def _starts(options: Mapping[str, Any]) -> tuple[list[np.ndarray], list[str]]:
    """States, and checksums of models and instructions, at the starts of the first episodes."""
    numbers = options.get("episodes", 50)
    numbers = list(range(numbers) if isinstance(numbers, int) else numbers)[:_TRIED]
    taken = {name: value for name, value in options.items() if name in _STARTS}
    env = make_vec(**{**taken, "seed": options.get("seed", 0), "width": 16, "height": 16, "num_envs": len(numbers)})
    try:
        env.reset(options={"episodes": numbers})
        return list(env.sim.state.copy()), [
            _digest(env.sim.model_of(world)) + instruction for world, instruction in enumerate(env.instructions)
        ]
    finally:
        env.close()


_STARTS = (
    "task",
    "robot",
    "scene",
    "split",
    "arm_controller",
    "camera_system",
    "cameras",
    "policy_dt_ms",
    "perturb",
    "instructions",
)
"""Options on which the start of an episode depends."""


def _digest(model: Any) -> str:
    total = hashlib.sha256()
    for name, values in arrays_of(model):
        if name.startswith(("light_", "mat_", "geom_", "cam_", "body_")):
            total.update(values.tobytes())
    return total.hexdigest()


def _compared(a: Results, b: Results) -> Comparison:
    of_b = {key_of(row): row for row in b.rows}
    pairs = [(row, of_b[key_of(row)]) for row in a.rows if key_of(row) in of_b]
    if not pairs:
        raise ValueError(f"vary: {a.dataset.root} and {b.dataset.root} have no episode in common")
    return Comparison(a, b, pairs, len(a.rows) + len(b.rows) - 2 * len(pairs))
