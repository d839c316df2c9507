// SPDX-License-Identifier: Apache-2.0
#pragma once
// RGB to YUV 4:2:0 conversion for the video encoder. It halves the bytes that go through the
// encoder's pipe and takes a fifth of the time of ffmpeg's conversion.
//
// The colours are BT.601, limited range, untagged in the file. This is the default of ffmpeg's
// scaler for RGB input and what players assume for untagged files. Luma equals ffmpeg's bit for bit
// and chroma differs by at most one step, so that sizes and colours of videos do not depend on who
// converts.

#include <cstddef>
#include <cstdint>
#include <span>

namespace mjsense::record {

// Bytes of a frame: Y [H, W], U [H/2, W/2], V [H/2, W/2], with H and W rounded up to even numbers.
std::size_t yuv420_bytes(int width, int height);

// rgb: [height, width, 3]. If the width or height is odd, the last column or row is repeated. The
// result is the same bit for bit on every machine.
void encode_yuv420(std::span<const std::uint8_t> rgb, int width, int height,
                   std::span<std::uint8_t> out);

// Variants for each instruction set (core/system/cpu.h). `scratch` holds yuv420_scratch(width) values.
using Yuv420Kernel = void (*)(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                              std::int16_t* scratch);
std::size_t yuv420_scratch(int width);
void yuv420_portable(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                     std::int16_t* scratch);
void yuv420_avx2(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                 std::int16_t* scratch);
void yuv420_avx512(const std::uint8_t* rgb, int width, int height, std::uint8_t* out,
                   std::int16_t* scratch);

}  // namespace mjsense::record
