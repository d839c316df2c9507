# SPDX-License-Identifier: Apache-2.0
"""The repr of a sensor has its shape, unit and frame; in a notebook an image is shown as a thumbnail."""

import base64
import inspect
import pydoc
import re
import struct
import zlib

import gymnasium
import numpy as np
from scenes import ball_scene, feet_cfg

import mjsense as mjs


class Height(mjs.Sensor):
    """How high the ball is."""

    uuid = "height"
    unit = "m"
    frame = "world"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)

    def compute(self, sim):
        return sim.data.xpos[:, 1:2, 2]


def thumbnails(text):
    pictures = []
    for source in re.findall(r"src='data:image/png;base64,([^']+)'", text):
        png = base64.b64decode(source)
        width, height = struct.unpack(">II", png[16:24])
        length = struct.unpack(">I", png[33:37])[0]
        pixels = np.frombuffer(zlib.decompress(png[41 : 41 + length]), np.uint8).reshape(height, 1 + 3 * width)
        assert pixels[0, 0] == 0 and (pixels[1:, 0] == 2).all()  # the filter "Up" below the first row
        pictures.append(np.cumsum(pixels[:, 1:].reshape(height, width, 3), axis=0, dtype=np.uint8))
    return pictures


def test_text():
    scene = ball_scene(feet_cfg(fields=("found", "force")))
    assert repr(scene["touch"]) == "<contact sensor 'touch'>"  # nothing is known before a simulation
    height = Height()
    assert repr(height) == "<Height 'height': float32 [1] m in world>"
    sim = mjs.Simulation(scene, num_worlds=3)
    sim.add(height)
    assert repr(scene["ball/acc"]) == f"<builtin sensor 'ball/acc': float32 [3, 3] m/s^2 in {scene['ball/acc'].spec.frame}>"
    assert repr(scene["touch"]).startswith("<contact sensor 'touch': found float32 [3, 1]; force float32 [3, 1, 3] N in ")
    assert repr(height) == "<Height 'height': float32 [3, 1] m in world>"
    suite = mjs.SensorSuite([scene["touch"], height])
    assert repr(suite) == "<suite of 2 sensors: touch, height>"
    assert suite._repr_html_().count("<table>") == 2
    sim.close()
    assert "m/s^2" in repr(scene["ball/acc"])  # also when all is over


def test_help():
    scene = ball_scene(feet_cfg(fields=("found", "force")))
    sim = mjs.Simulation(scene, num_worlds=3)
    height = Height()
    sim.add(height)
    touch = pydoc.render_doc(scene["touch"], renderer=pydoc.plaintext)
    assert "force float32 [3, 1, 3] N in " in touch and "help(ContactSensor)" in touch
    assert "float32 [3, 1] m in world" in pydoc.render_doc(height, renderer=pydoc.plaintext)
    of_class = pydoc.render_doc(type(height), renderer=pydoc.plaintext)  # as of any class
    assert "get_observation" in of_class and "[3, 1]" not in of_class
    assert mjs.sensors.ContactSensor.__doc__ and mjs.sensors.ContactSensor.__doc__.startswith("Contacts of its primaries")


def test_html():
    eye = mjs.CameraSensorCfg(
        name="eye", pos=(0, -2, 1), quat=(0.7071, 0.7071, 0, 0), width=400, height=200, data_types=("rgb", "depth", "segmentation", "normals")
    )
    scene = ball_scene(eye)
    sim = mjs.Simulation(scene, num_worlds=2)
    shown = scene["eye"]._repr_html_()
    rgb, depth, *others = thumbnails(shown)
    assert len(others) == 2
    np.testing.assert_array_equal(rgb, scene["eye"].data.rgb[0, ::3, ::3])
    z = scene["eye"].data.depth[0, ::3, ::3, 0]
    assert (depth[z == 0] == 0).all()
    assert (depth[z == z[z > 0].min()] == (253, 231, 37)).all()  # near is bright
    assert "[2, 200, 400, 3]" in shown and "Colour image" in shown
    assert "<script>" not in mjs.SensorSuite([Named()])._repr_html_()
    sim.close()
    assert not thumbnails(scene["eye"]._repr_html_())


class Named(Height):
    uuid = "<script>"


def test_completion():
    """What the tab key offers in IPython."""
    scene = ball_scene(feet_cfg())
    sim = mjs.Simulation(scene, num_worlds=2)
    assert {"qpos", "xpos", "sensordata"} <= set(dir(sim.data))
    assert set(type(sim.data).__annotations__) - {"_sim"} <= set(dir(sim.data))
    assert len(sim.data.sensordata) == 2 and "2 worlds" in repr(sim.data)
    assert {"touch", "ball/acc", "ball"} <= set(scene._ipython_key_completions_())
    assert mjs.SensorSuite([scene["touch"]])._ipython_key_completions_() == ["touch"]
    assert "contact sensor" in scene._repr_html_() and "sensors>" in repr(sim)


def test_help_of_the_package():
    """Its example runs, and what it names is there."""
    text = mjs.__doc__
    example, rest = text.split("Where to look")
    names = {}
    exec(inspect.cleandoc("\n".join(line for line in example.splitlines() if line.startswith("    "))), names)
    assert names["scene"]["front"].data.rgb.shape == (8, 120, 160, 3)
    named = set(re.findall(r"\b[A-Z]\w+|\b[a-z_]+(?=\(\))", re.sub(r"\([^)]+\)", "", rest))) - {"Where"}
    assert {"Simulation", "CameraSensorCfg", "SensorSuite", "task_names"} <= named
    assert not [name for name in named if not hasattr(mjs, name)]
