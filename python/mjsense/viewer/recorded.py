# SPDX-License-Identifier: Apache-2.0
"""The viewer of recordings."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.representations import plain
from mjsense.dataset import Dataset, Episode
from mjsense.dataset.streams import VIDEOS
from mjsense.sensors.drawing import DebugShapes
from mjsense.viewer.camera import first_view
from mjsense.viewer.curves import MAX_CURVES, Curves, StreamInfo
from mjsense.viewer.pictures import Pictures, point_streams
from mjsense.viewer.poses import POSE, PoseStream
from mjsense.viewer.text import label, labels, panel_text
from mjsense.viewer.viewer import Viewer

_LISTED = 200  # episodes in the list; the filters find the others
_ALL = "(all outcomes)"
_SPEEDS = ("0.25", "0.5", "1", "2", "5", "10")


def curve_streams(dataset: Dataset) -> dict[str, StreamInfo]:
    """Streams of a recording that can be drawn as curves."""
    found = {}
    for name, stream in dataset.streams.items():
        width = int(np.prod(stream.shape, dtype=np.int64))
        if stream.kind != "video" and stream.dtype.kind in "fiub" and 0 < width <= MAX_CURVES:
            found[name] = StreamInfo(stream.unit, width)
    return found


class RecordingViewer(Viewer):
    """Shows episodes of a recording: the 3D scene from the recorded states, videos and curves."""

    def __init__(self, dataset: Dataset, *, episode: int = 0, host: str = "127.0.0.1", port: int = 8080) -> None:
        if not dataset.episodes:
            raise ValueError(f"{dataset.root}: there is no episode to show")
        if not 0 <= episode < len(dataset.episodes):
            raise ValueError(f"episode {episode}: must be in [0, {len(dataset.episodes)})")
        super().__init__(dataset.root.name or str(dataset.root), host, port)
        self._dataset = dataset
        self._episode: Episode = dataset.episodes[episode]
        self._model: Any = None
        self._data: Any = None
        self._shown = -1
        gui = self._server.gui
        tabs = gui.add_tab_group()
        with tabs.add_tab("Episodes"):
            self._outcomes = labels(sorted({one.outcome for one in dataset.episodes}))
            self._outcome = gui.add_dropdown(
                "Outcome", [_ALL, *self._outcomes], initial_value=_ALL, visible=len(self._outcomes) > 1
            )
            self._text = gui.add_text("Task contains", "", hint="Only episodes whose instruction contains this text.")
            self._choice = gui.add_dropdown("Episode", ["0"])
            self._about = gui.add_html("")
            self._add_play(gui)
            self._time = gui.add_slider("Step", min=0, max=1, step=1, initial_value=0)
            self._speed = gui.add_dropdown("Speed", _SPEEDS, initial_value="1")
            for handle, action in (
                (self._outcome, self._filter),
                (self._text, self._filter),
                (self._choice, self._choose),
                (self._time, self._show),
                (self._speed, self._start),
            ):
                self._later(handle, action)
        with tabs.add_tab("Show"):
            self._add_groups(gui)
            self._poses = {
                name: gui.add_checkbox(label(name.removeprefix("obs/extra/")), initial_value=False)
                for name, stream in dataset.streams.items()
                if stream.unit == POSE and PoseStream.can_draw(stream.frame)
            }
            for box in self._poses.values():
                self._later(box, self._draw)
        # Colour images first.
        videos = sorted(
            (stream for stream in dataset.streams.values() if stream.kind == "video"), key=lambda stream: stream.dtype.kind != "u"
        )
        with tabs.add_tab("Videos"):
            self._pictures = Pictures(
                gui,
                [stream.name.removeprefix(VIDEOS) for stream in videos],
                self._later,
                self._show,
                shown=2,
                points=self._image_points,
            )
        with tabs.add_tab("Curves"):
            self._curves = Curves(gui, curve_streams(dataset), self._later, self._rows, lambda: max(self._shown, 0))
        self._filter(episode)

    # ---------------------------------------------------------------------------------------------------------- episodes

    def _filter(self, position: int = 0) -> None:
        """Lists the episodes that the filters leave, and shows one of them."""
        outcome, text = self._outcomes.get(self._outcome.value), self._text.value.strip().lower()
        found = []
        for k, episode in enumerate(self._dataset.episodes):
            if outcome in (None, episode.outcome) and (not text or text in episode.task.lower()):
                found.append(k)
            if len(found) == _LISTED:
                break
        if position not in found and len(found) < _LISTED:
            position = found[0] if found else position
        self._listed = {self._label(k): k for k in dict.fromkeys([position, *found])} if found else {}
        self._choice.options = list(self._listed) or ["no episode matches"]
        if self._listed:
            self._choice.value = self._label(position)
            self._choose()

    def _label(self, position: int) -> str:
        episode = self._dataset.episodes[position]
        return label(f"{episode.index}: {episode.outcome}, {episode.task}")

    def _choose(self) -> None:
        position = self._listed.get(self._choice.value)
        if position is not None:
            self.show_episode(position)

    def show_episode(self, position: int) -> None:
        """Shows the first step of an episode, by its position in the data set."""
        episode = self._episode = self._dataset.episodes[position]
        missing = ""
        try:
            self._model = episode.model()
        except (ValueError, RuntimeError, OSError) as error:
            self._model, missing = None, f"There is no 3D scene, only videos and curves: {error}"
        else:
            import mujoco  # present, or there would be no model

            self._data = mujoco.MjData(self._model)
            episode.set_state(self._model, self._data, 0)
            self._stage.set_model(self._model)
            if self._shown < 0:
                self._look(*first_view(self._model, self._data.xpos, self._data.xmat))
        if missing and self._shown < 0:
            print(plain(missing, 1000), flush=True)
        self._about.content = panel_text(
            episode.task, f"{episode.outcome}, {counted(episode.length, 'observation')}, seed {episode.seed}", missing
        )
        self._time.max = max(episode.length - 1, 1)
        self._time.value = 0
        self._curves.reload()
        self._show()

    def seek(self, t: int) -> None:
        """Shows observation ``t`` of the episode."""
        self._time.value = min(max(t, 0), self._episode.length - 1)
        self._show()

    def _image_points(self, camera: str) -> np.ndarray | None:
        names = point_streams(camera, self._dataset.streams)
        return (
            np.concatenate(
                [self._episode[name][max(self._shown, 0)] for name in names if name in self._episode] or [np.zeros((0, 2))]
            )
            if names
            else None
        )

    def _rows(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        rows = np.asarray(self._episode[name], np.float64) if name in self._episode else np.zeros((0, 1))
        return np.arange(len(rows)) / float(self._dataset.fps), rows

    # ----------------------------------------------------------------------------------------------------------- showing

    def _start(self) -> None:
        if self._playing and self._time.value >= self._episode.length - 1:
            self._time.value = 0
        super()._start()

    def _advance(self, now: float) -> bool:
        if not self._playing:
            self._show_pictures()
            return False
        period = 1 / (float(self._dataset.fps) * float(self._speed.value))
        steps = int(max(now - self._due, 0) / period)
        if steps:
            self._due += steps * period
            self.seek(int(self._time.value) + steps)
            if self._time.value >= self._episode.length - 1:
                self._set_playing(False)
        self._show_pictures()
        return True

    def _show(self) -> None:
        """Shows the scene. Videos follow when there is nothing newer to do, because finding a frame can take long."""
        t = self._shown = min(int(self._time.value), self._episode.length - 1)
        if self._model is not None:
            self._episode.set_state(self._model, self._data, t)
            self._stage.show(lambda name: getattr(self._data, name))
            if self._drawn:
                self._draw()
        self._stale = True

    def _show_pictures(self) -> None:
        if self._stale:
            self._stale = False
            self._curves.refresh()
            self._pictures.refresh(lambda name: self._episode.video(name)[self._shown])

    def update(self) -> None:
        super().update()
        self._show_pictures()

    _drawn = _stale = False

    def _draw(self) -> None:
        names = [name for name, box in self._poses.items() if box.value]
        self._drawn = bool(names)
        if self._model is None:
            return
        shapes = DebugShapes(0, float(self._model.stat.meansize))
        for name in names:
            PoseStream(name, self._dataset.streams[name].frame).draw(
                shapes, self._episode[name][self._shown], self._model, self._data.xpos, self._data.xmat
            )
        self._layer.show(shapes)
