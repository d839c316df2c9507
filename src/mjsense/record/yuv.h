// SPDX-License-Identifier: Apache-2.0
#pragma once
// RGB to YUV 4:2:0, as the video encoder wants it: half the bytes through its pipe, and a fifth of
// the time that ffmpeg takes for it.
//
// BT.601, limited range, untagged in the file: what ffmpeg's scaler makes of RGB unless told
// otherwise, and what players take an untagged file for. Brightness is the same as ffmpeg's bit for
// bit, chroma within one step, so that sizes and colours of videos stay what they were.

#include <cstddef>
#include <cstdint>
#include <span>

namespace mjsense {

// Bytes of a picture: Y [H, W], U [H/2, W/2], V [H/2, W/2], of sizes rounded up to even ones.
std::size_t yuv420_bytes(int width, int height);

// rgb: [height, width, 3]. An odd width or height repeats its last column or row. The same bits on
// every machine.
void encode_yuv420(std::span<const std::uint8_t> rgb, int width, int height,
                   std::span<std::uint8_t> out);

// The same for each instruction set (core/cpu.h). `scratch` holds yuv420_scratch(width) numbers.
using Yuv420Kernel = void (*)(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                              std::int16_t* scratch);
std::size_t yuv420_scratch(int width);
void yuv420_portable(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                     std::int16_t* scratch);
void yuv420_avx2(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                 std::int16_t* scratch);
void yuv420_avx512(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                   std::int16_t* scratch);

}  // namespace mjsense
