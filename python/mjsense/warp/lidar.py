# SPDX-License-Identifier: Apache-2.0
"""Lidars: rays of a scan, the intensity of their returns, and the errors of the device."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from mjsense.sensors.configs import SpinningScanCfg
from mjsense.warp.random import make_rng, normal, normal_at, stream_of, uniform
from mjsense.warp.rays import Frames, Hits, RayCast, Rays, world_ray
from mjsense.warp.sensor import Worlds, implements, vec3_view
from mjsense.warp.surfaces import Surfaces, colour

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def _choose_part(
    substep: wp.array(dtype=wp.int64), physics_dt: wp.float64, rate: wp.float64, parts: wp.int64, part: wp.array(dtype=int)
):
    """The last finished scan, which is cast as a whole."""
    w = wp.tid()
    scan = wp.int64(wp.floor(wp.float64(substep[w]) * physics_dt * rate + wp.float64(1.0e-6)))
    part[w] = int(scan % parts)


@wp.struct
class Device:
    """Errors of the device; all 0: none."""

    seed: wp.array(dtype=wp.uint64)
    key: wp.array(dtype=wp.uint32)
    tick: wp.array(dtype=wp.int64)
    stream: wp.uint32
    noise: wp.float64  # m
    relative_noise: wp.float64
    resolution: wp.float64  # m
    dropout: wp.float64
    nearest: wp.float64
    farthest: wp.float64


@wp.kernel
def _report(
    surfaces: Surfaces,
    frames: Frames,
    rays: Rays,
    hits: Hits,
    device: Device,
    points: wp.array2d(dtype=wp.vec3),
    intensity: wp.array2d(dtype=float),
):
    w, r = wp.tid()
    zero = wp.float64(0.0)
    i = rays.part[w] * rays.count + r % rays.count
    points[w, r] = wp.vec3()
    intensity[w, r] = 0.0
    if hits.distance[w, r] < 0.0:
        return
    geom = hits.geom[w, r]
    t = hits.distance[w, r]
    ray = world_ray(frames, rays, w, r)
    rgba = colour(surfaces, w, geom)
    cosine = wp.abs(wp.dot(ray.direction, hits.normal[w, r]))

    # Every ray has numbers of its own, whether it hits or not. With dropout and noise, two rays use four uniform numbers.
    rng = make_rng(device.seed[0], device.key[w], device.stream, device.tick[w])
    noisy = device.noise > zero or device.relative_noise > zero
    lost = bool(False)
    draw = wp.float64(0.0)
    if device.dropout > zero and noisy:
        begin = 4 * (r // 2)
        lost = uniform(rng, begin + 3 * (r % 2)) < device.dropout
        draw = normal_at(rng, begin + 1, r % 2 == 1)
    elif device.dropout > zero:
        lost = uniform(rng, r) < device.dropout
    elif noisy:
        draw = normal(rng, r)
    exact = wp.float64(t)
    relative = device.relative_noise * exact
    measured = exact + draw * wp.sqrt(device.noise * device.noise + relative * relative)
    if device.resolution > zero:
        measured = wp.round(measured / device.resolution) * device.resolution
    if lost or ((noisy or device.resolution > zero) and (measured < device.nearest or measured > device.farthest)):
        hits.distance[w, r] = -1.0
        hits.pos[w, r] = ray.origin
        hits.normal[w, r] = wp.vec3()
        hits.geom[w, r] = -1
        hits.body[w, r] = -1
        hits.material[w, r] = -1
        return
    distance = float(measured)
    hits.distance[w, r] = distance
    hits.pos[w, r] = ray.origin + distance * ray.direction
    points[w, r] = distance * rays.direction[i]
    intensity[w, r] = wp.clamp((rgba[0] + rgba[1] + rgba[2]) / 3.0 * cosine, 0.0, 1.0)


def spinning_angles(scan: SpinningScanCfg) -> np.ndarray:
    """(azimuth, elevation) of each ray, rad, ``[channels * samples, 2]``."""
    low, high, channels = scan.elevation_min_deg, scan.elevation_max_deg, scan.channels
    if len(scan.elevations_deg):
        elevation = np.asarray(scan.elevations_deg, float)
    elif channels > 1:
        elevation = low + (high - low) * np.arange(channels) / (channels - 1)
    else:
        elevation = np.array([0.5 * (low + high)])
    azimuth = scan.azimuth_start_deg + scan.azimuth_span_deg * np.arange(scan.samples) / scan.samples
    return np.radians(np.stack([np.tile(azimuth, channels), np.repeat(elevation, scan.samples)], axis=-1))


@implements("lidar")
class Lidar(RayCast):
    exclude_world = False

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        cfg, d = self.cfg, Device()
        d.seed, d.key, d.tick, d.stream = worlds.seed, worlds.key, worlds.tick, stream_of(self.name)
        d.noise, d.relative_noise, d.resolution = cfg.range_noise_std, cfg.range_noise_relative, cfg.range_resolution
        d.dropout, d.nearest, d.farthest = cfg.dropout, cfg.min_distance, cfg.max_distance
        self.device = d
        self.points = vec3_view(self.fields["points"])

    def pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        scan = self.cfg.scan
        self.parts = 1
        if isinstance(scan, SpinningScanCfg):
            angles = spinning_angles(scan)
            # A full turn takes 1 / rate, and a part of a turn takes that part of the time.
            times = (np.arange(scan.samples) - (scan.samples - 1)) * scan.azimuth_span_deg / (360 * scan.samples * scan.rate_hz)
            times = np.tile(times, scan.channels)
        else:
            angles = np.asarray(np.load(scan.file) if scan.file else scan.angles, float)
            if scan.rays_per_scan:
                self.parts = len(angles) // scan.rays_per_scan
                angles = angles[: self.parts * scan.rays_per_scan]
            count = len(angles) // self.parts
            times = (np.arange(len(angles)) % count - (count - 1)) / (count * scan.rate_hz)
        azimuth, elevation = angles.T
        directions = np.stack(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
        )
        return np.zeros_like(directions), directions, times if self.cfg.motion_distortion else np.zeros(0), self.parts

    def update(self) -> None:
        worlds = self.worlds
        if self.parts > 1:
            inputs = [worlds.substep, worlds.physics_dt, self.cfg.scan.rate_hz, self.parts, self.rays.part]
            self.launch(_choose_part, worlds.num_worlds, *inputs)
        super().update()
        inputs = [self.scene.surfaces, self.frames, self.rays, self.hits, self.device, self.points, self.fields["intensity"]]
        self.launch(_report, (worlds.num_worlds, self.num_frames * self.rays.count), *inputs)
