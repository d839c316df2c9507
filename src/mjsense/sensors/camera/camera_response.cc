// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/camera_response.h"

#include <algorithm>
#include <cmath>

#include "mjsense/render/kernels/display_colors.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::sensors {
namespace {

constexpr double kMiddleGrey = 0.18;
constexpr int kMeterStride = 4;
constexpr double kDarkest = 1e-3, kLowest = -10, kHighest = 30;  // cd/m^2 and EV of the meter

// Natural vignetting of a pixel.
double falloff(const render::PixelGrid& grid, int x, int y) {
  double dx = grid.left + grid.dx * (x + 0.5), dy = grid.top + grid.dy * (y + 0.5);
  if (grid.distorted_rays) {
    const float* ray = grid.distorted_rays + 2 * (static_cast<std::size_t>(y) * grid.width + x);
    dx = ray[0];
    dy = ray[1];
  }
  const double square = 1 / (1 + dx * dx + dy * dy);  // cos^2
  return square * square;
}

// The values of a camera.
ImagerCfg imager_preset(Imager imager) {
  // f_number: Intel, RealSense D400 Series data sheet (337029), colour sensor of the D435; that of the ZED
  // Mini is an assumption. exposure_time: both take 30 images per second. full_well and read_noise: not
  // published for the OV2740 (1.4 um pixels) and OV4689 (2 um) in them. Those of OmniVision's OV5647, which
  // has 1.4 um pixels, are 4300 electrons and 68 dB, thus 4300 / 10^(68 / 20) = 1.7 electrons; for 2 um,
  // the full well grows with the area. bits: both sensors have 10 bits. vignetting: half of the natural
  // one, because the cameras correct a part that is not published. readout_time: at their highest rates
  // the sensors read all rows 60 times (OV2740, 1920 x 1080) and 90 times (OV4689, 2688 x 1520) a second.
  ImagerCfg out;
  out.full_well = imager == Imager::kZedMini ? 4300 * (2.0 * 2.0) / (1.4 * 1.4) : 4300;
  out.read_noise = 1.7;
  out.bits = 10;
  out.f_number = 2.0;
  out.exposure_time = 1.0 / 30;
  out.readout_time = imager == Imager::kZedMini ? 1.0 / 90 : 1.0 / 60;
  out.vignetting = 0.5;
  return out;
}

}  // namespace

std::optional<ImagerCfg> imager_of(const CameraSensorCfg& cfg) {
  return cfg.imager == Imager::kNone ? cfg.imager_values : imager_preset(cfg.imager);
}

bool needs_response(const CameraSensorCfg& cfg) {
  return cfg.exposure_mode == ExposureMode::kAuto || imager_of(cfg);
}

CameraResponse::CameraResponse(const CameraSensorCfg& cfg, const render::PhysicalOptions& options,
                               int num_worlds)
    : width_(cfg.width),
      height_(cfg.height),
      automatic_(cfg.exposure_mode == ExposureMode::kAuto),
      exposure_(cfg.exposure),
      time_constant_(cfg.exposure_time_constant),
      imager_(imager_of(cfg)),
      states_(num_worlds) {
  constexpr double kIdentity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  render::set_physical(options, {1, 1, 1}, kIdentity, display_);
}

void CameraResponse::keep_radiance() {
  for (State& state : states_)
    state.radiance.resize(3 * static_cast<std::size_t>(width_) * height_);
}

double CameraResponse::exposure_time(int world, double time) const {
  const State& state = states_[world];
  double exposure = exposure_;
  if (automatic_) {
    // An image of the same time will be replaced.
    const int before = state.images - (state.images > 0 && time == state.time);
    if (before <= 0 || time < state.time) return imager_->exposure_time;
    exposure = time == state.time ? state.earlier_exposure : state.exposure;
  }
  return std::min(imager_->exposure_time,
                  imager_->f_number * imager_->f_number / std::exp2(exposure));
}

double CameraResponse::metered(const float* radiance) const {
  double sum = 0;
  int count = 0;
  for (int y = kMeterStride / 2 % height_; y < height_; y += kMeterStride)
    for (int x = kMeterStride / 2 % width_; x < width_; x += kMeterStride, ++count) {
      const float* p = radiance + 3 * (static_cast<std::size_t>(y) * width_ + x);
      sum += std::log2(std::max(render::luminance({p[0], p[1], p[2]}), kDarkest) *
                       render::exposure_scale(0) / kMiddleGrey);
    }
  return std::clamp(sum / count, kLowest, kHighest);
}

void CameraResponse::expose(State& state, double time, const float* radiance) const {
  if (!automatic_) {
    state.exposure = exposure_;
    return;
  }
  // A world may be changed without a step: then its image replaces the one of the same time. An earlier
  // state is a new beginning, as a reset is.
  if (time < state.time) state.images = 0;
  if (state.images == 0 || time > state.time) {
    state.earlier_exposure = state.exposure;
    state.earlier_time = state.time;
    state.images = std::min(state.images + 1, 2);
    state.time = time;
  }
  const double target = metered(radiance), passed = time - state.earlier_time;
  state.exposure = target;
  if (state.images == 1 || time_constant_ == 0) return;
  const double left = std::exp(-passed / time_constant_);
  state.exposure += left * (state.earlier_exposure - target);
}

void CameraResponse::develop(int world, double time, const render::PixelGrid& grid, Rng rng,
                             const float* radiance, std::uint8_t* rgb) {
  State& state = states_[world];
  expose(state, time, radiance);
  const double scale = render::exposure_scale(state.exposure);
  double well = 0, dark = 0, steps = 0, strength = 0;
  if (imager_) {
    const double square = imager_->f_number * imager_->f_number;
    const double needed = square / std::exp2(state.exposure);  // s, without gain
    well = imager_->full_well * std::min(imager_->exposure_time / needed, 1.0);
    dark = imager_->read_noise * imager_->read_noise;
    steps = std::exp2(imager_->bits) - 1;
    strength = imager_->vignetting;
  }
  std::vector<float> row(3 * static_cast<std::size_t>(width_));
  for (int y = 0; y < height_; ++y) {
    const float* from = radiance + row.size() * y;
    for (int x = 0; x < width_; ++x) {
      double share = scale;
      if (strength > 0 && !grid.orthographic) share *= 1 + strength * (falloff(grid, x, y) - 1);
      for (int c = 0; c < 3; ++c) {
        const int i = 3 * x + c;
        double value = share * from[i];
        if (imager_) {
          const double electrons = value * well;
          value = (electrons + std::sqrt(electrons + dark) * rng.normal()) / well;
          value = std::round(std::clamp(value, 0.0, 1.0) * steps) / steps;
        }
        row[i] = static_cast<float>(value);
      }
    }
    render::map_to_display(display_, row);
    std::uint8_t* to = rgb + row.size() * y;
    for (std::size_t i = 0; i < row.size(); ++i)
      to[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(row[i], 0.0f, 1.0f)));
  }
}

}  // namespace mjsense::sensors
