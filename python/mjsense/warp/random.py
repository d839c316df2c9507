# SPDX-License-Identifier: Apache-2.0
"""Random numbers that equal those of the C++ library bit for bit (``core/rng.h``): Philox4x32-10, a function of seed, world,
stream, step and the number of the draw.

In C++ draws are made one after the other. Here each draw is addressed by its number, so that threads are independent: uniform
number ``n`` consists of the 32-bit words ``2 n`` and ``2 n + 1``, and four consecutive words are one block of Philox.
"""

from __future__ import annotations

import warp as wp

# Without fused multiplications and additions, float64 results are those of the C++ library.
wp.set_module_options({"enable_backward": False, "fuse_fp": False})

_TWO_PI = wp.constant(wp.float64(6.283185307179586))
# The constants of Philox4x32.
_M0 = wp.constant(wp.uint64(0xD2511F53))
_M1 = wp.constant(wp.uint64(0xCD9E8D57))
_W0 = wp.constant(wp.uint32(0x9E3779B9))
_W1 = wp.constant(wp.uint32(0xBB67AE85))


@wp.struct
class Rng:
    """Key and counter of one stream of one world at one step."""

    key0: wp.uint32
    key1: wp.uint32
    world: wp.uint32
    step_low: wp.uint32
    step_high: wp.uint32


def stream_of(name: str) -> int:
    """Stream of a sensor or an effect: FNV-1a of its name."""
    value = 2166136261
    for byte in name.encode():
        value = (value ^ byte) * 16777619 & 0xFFFFFFFF
    return value


@wp.func
def make_rng(seed: wp.uint64, key: wp.uint32, stream: wp.uint32, step: wp.int64) -> Rng:
    rng = Rng()
    rng.key0 = wp.uint32(seed) ^ (stream * _W0)
    rng.key1 = wp.uint32(seed >> wp.uint64(32)) ^ stream
    rng.world = key
    rng.step_low = wp.uint32(wp.uint64(step))
    rng.step_high = wp.uint32(wp.uint64(step) >> wp.uint64(32))
    return rng


@wp.func
def _block(rng: Rng, number: wp.uint32) -> wp.vec4ui:
    c0 = number
    c1 = rng.world
    c2 = rng.step_low
    c3 = rng.step_high
    k0 = rng.key0
    k1 = rng.key1
    for _ in range(10):
        p0 = _M0 * wp.uint64(c0)
        p1 = _M1 * wp.uint64(c2)
        c0 = wp.uint32(p1 >> wp.uint64(32)) ^ c1 ^ k0
        c1 = wp.uint32(p1)
        c2 = wp.uint32(p0 >> wp.uint64(32)) ^ c3 ^ k1
        c3 = wp.uint32(p0)
        k0 += _W0
        k1 += _W1
    return wp.vec4ui(c0, c1, c2, c3)


@wp.func
def word(rng: Rng, n: int) -> wp.uint32:
    """32-bit word number ``n``."""
    return _block(rng, wp.uint32(n // 4))[n % 4]


@wp.func
def uniform_of_words(high: wp.uint32, low: wp.uint32) -> wp.float64:
    bits = (wp.uint64(high) << wp.uint64(32)) | wp.uint64(low)
    return wp.float64(bits >> wp.uint64(11)) * wp.float64(1.1102230246251565e-16)


@wp.func
def uniform(rng: Rng, n: int) -> wp.float64:
    """Uniform number ``n`` in [0, 1)."""
    block = _block(rng, wp.uint32(n // 2))
    if n % 2 == 0:
        return uniform_of_words(block[0], block[1])
    return uniform_of_words(block[2], block[3])


@wp.func
def _box_muller(u: wp.float64, v: wp.float64, second: bool) -> wp.float64:
    r = wp.sqrt(wp.float64(-2.0) * wp.log(wp.float64(1.0) - u))
    angle = _TWO_PI * v
    if second:
        return r * wp.sin(angle)
    return r * wp.cos(angle)


@wp.func
def normal(rng: Rng, n: int) -> wp.float64:
    """Standard normal number ``n`` of a stream of which only normal numbers are drawn."""
    block = _block(rng, wp.uint32(n // 2))
    return _box_muller(uniform_of_words(block[0], block[1]), uniform_of_words(block[2], block[3]), n % 2 == 1)


@wp.func
def normal_at(rng: Rng, n: int, second: bool) -> wp.float64:
    """The first or second standard normal number that is made of the uniform numbers ``n`` and ``n + 1``."""
    return _box_muller(uniform(rng, n), uniform(rng, n + 1), second)


@wp.func
def below(rng: Rng, bound: wp.uint32, used: int) -> wp.vec2ui:
    """A uniform integer in [0, bound) drawn from word ``used`` on, and the number of the next word."""
    n = used
    product = wp.uint64(word(rng, n)) * wp.uint64(bound)
    n += 1
    if wp.uint32(product) < bound:
        threshold = (wp.uint32(0) - bound) % bound
        while wp.uint32(product) < threshold:
            product = wp.uint64(word(rng, n)) * wp.uint64(bound)
            n += 1
    return wp.vec2ui(wp.uint32(product >> wp.uint64(32)), wp.uint32(n))
