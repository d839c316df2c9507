# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of a policy: the same episodes, in which one factor differs at a time."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.errors import did_you_mean, printable
from mjsense.evaluation.benchmarks import Benchmark, arrays_of, is_benchmark
from mjsense.evaluation.comparison import Comparison
from mjsense.evaluation.molmospaces_benchmark import is_molmospaces
from mjsense.evaluation.playing import play
from mjsense.evaluation.report import Results
from mjsense.evaluation.rows import group_of, key_of
from mjsense.evaluation.summary import rate_text
from mjsense.tasks.making import make_vec
from mjsense.tasks.robot import Robot

UNCHANGED = "unchanged"
_TRIED = 4  # episodes in which a factor must change something
MAX_STRENGTH = 1.5
_ALL = 1000  # more objects than a scene has
FACTORS = {
    "light": "brightness by 60 %, hue by 20 degrees and direction by 20 degrees of the lights",
    "camera": "poses of the cameras: 3 cm and 4 degrees",
    "texture": "colours of everything but the robot: brightness by 40 %, hue by 40 degrees and saturation by 0.25",
    "distractors": "all objects of the scene are present, or as many as distractors=5 says",
    "instruction": "the canonical sentence instead of paraphrases, or the reverse",
    "start": "place of the robot: 5 cm and 10 degrees more",
    "latency": "delay of the actions, in seconds: latency=0.1",
}
"""The factors, and what each changes by how much at most; light=0.5 is half as much."""
_SAME_START = ("light", "camera", "texture", "instruction", "latency")
"""Factors that do not change the state in which an episode starts."""


def _light(strength: float) -> str:
    return _colours("light", ".*", 0.6 * strength, 0.6 * strength, 20 * strength) + f"angle = {20 * strength}\n"


def _texture(strength: float) -> str:
    colours = [_colours(what, "(?!robot_0/).*", 0.4 * strength, 0.3 * strength, 40 * strength) for what in ("material", "geom")]
    saturation = f"saturation = {0.25 * strength}\n"
    return f"{colours[0]}{saturation}\n{colours[1]}{saturation}optional = true\n"


def _colours(what: str, pattern: str, darker: float, brighter: float, hue: float) -> str:
    return f'[[vary]]\nwhat = "{what}"\npattern = "{pattern}"\nbrightness = [{1 - darker}, {1 + brighter}]\nhue = {hue}\n'


_SCENES: dict[str, Callable[[float], str]] = {
    "light": _light,
    "texture": _texture,
    "distractors": lambda count: f"count = [{count:.0f}, {count:.0f}]\n",
    "start": lambda strength: f"[robot]\npos_spread = [{0.05 * strength}, {0.05 * strength}]\nyaw_spread = {10 * strength}\n",
}
"""What a scene that extends that of the evaluation adds to it, by the strength of the factor, or by the number of objects."""


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
            ``light=0.5`` changes half as much; ``distractors=5`` is the number of objects.
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
    if is_benchmark(options["task"]) and is_molmospaces(options["task"]):
        raise ValueError(f"vary: '{options['task']}' is a benchmark of MolmoSpaces, whose episodes fix what would vary")
    benchmark = Benchmark(options["task"]) if is_benchmark(options["task"]) else None
    if benchmark is not None:
        benchmark.check_starts(int(options.get("num_worlds", 4)))
        options = {**benchmark.options(options), "episodes": benchmark.episodes}
    base = {name: value for name, value in options.items() if name != "out"}
    out.mkdir(parents=True, exist_ok=True)
    cases = {text: _changes(text, *_factor_of(text), base, out) for text in vary}
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


def _factor_of(text: str) -> tuple[str, float]:
    """The name of a factor, and its strength, number of objects, or seconds."""
    name, equals, value = text.partition("=")
    if name not in FACTORS:
        raise ValueError(f"vary: '{name}' is not a factor{did_you_mean(name, FACTORS, 'there are')}")
    if name == "instruction" and equals:
        raise ValueError(f"vary: '{text}': this factor has no strength")
    if name == "latency" and not equals:
        raise ValueError(f"vary: '{text}': give seconds, latency=0.1")
    if not equals:
        return name, _ALL if name == "distractors" else 1.0
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if name == "latency" and not 0 <= number < math.inf:
        raise ValueError(f"vary: '{text}': must be seconds, such as latency=0.1")
    if name == "distractors" and number not in range(1, _ALL + 1):
        raise ValueError(f"vary: '{text}': must be a number of objects from 1 on, such as distractors=5")
    if name not in ("latency", "distractors") and not 0 < number <= MAX_STRENGTH:
        raise ValueError(f"vary: '{text}': the strength must be above 0 and at most {MAX_STRENGTH}; 1 is the default")
    return name, number


def _changes(text: str, name: str, strength: float, base: Mapping[str, Any], out: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options of a recording, and the arguments of ``play``, that a factor changes."""
    if name == "latency":
        return {}, {"latency": strength}
    if name == "instruction":
        return {"instructions": "varied" if base.get("instructions") == "canonical" else "canonical"}, {}
    parts = {key: base[key] for key in ("task", "robot", "scene", "split") if base.get(key)}
    if not all(isinstance(part, str) for part in parts.values()):
        raise ValueError(f"vary: '{name}' needs a registered task, and a robot and a scene by their names or files")
    _, robot, scene, _, _ = _core.resolved_job({**parts, "out": "."})
    if name == "camera":
        if base.get("camera_system") or base.get("cameras") == []:
            raise ValueError("vary: 'camera' moves the cameras of the robot's model; leave out camera_system, and render cameras")
        return {"camera_system": _written(out / f"{text}.toml", _cameras(Robot(robot), strength))}, {}
    scene, _, part = scene.partition("@")
    extended = str(Path(scene).resolve()) if scene.endswith(".toml") else scene
    varied = f'name = "{text}"\nextends = "{extended}"\n{_SCENES[name](strength)}'
    changed = {"scene": _written(out / f"{text}.toml", varied)}
    return {**changed, "split": part} if part else changed, {}


def _cameras(robot: Robot, strength: float) -> str:
    width, height = robot.image_size
    pos, rot = 3 * [0.03 * strength], 3 * [4 * strength]
    noise = f"pos_noise = {pos}\nrot_noise = {rot}\n"
    mounts = [f'[[cameras]]\nname = "{one.name}"\nmount = "mjcf"\ncamera = "{one.camera}"\n{noise}' for one in robot.cameras]
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


_STARTS = tuple("task robot scene split arm_controller camera_system cameras policy_dt_ms perturb instructions".split())
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
