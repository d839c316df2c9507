// SPDX-License-Identifier: Apache-2.0
#pragma once
// From linear radiance to the colours that a camera records: exposure, which a meter may choose, and the
// errors of an image sensor. A value of 1 is what saturates the sensor: radiance 1.2 * 2^EV cd/m^2.
//
//   meter    the mean of log2 of the luminance L, over every fourth pixel of every fourth row, is shown as
//            middle grey, 0.18: EV_target = mean(log2(L / (0.18 * 1.2))). The first image of an episode has
//            this exposure; later ones follow it: EV += (EV_target - EV) (1 - exp(-dt / time_constant)),
//            from the last image of an earlier time
//   gain     exposure time and gain realise EV: t = min(longest, f_number^2 / 2^EV),
//            gain = f_number^2 / (t 2^EV), 1 or more
//   light    falls off by vignetting: 1 + vignetting (cos^4 - 1) of the angle to the optical axis
//   noise    a channel with n = value full_well / gain electrons has the variance n + read_noise^2; it is
//            clipped at 1 and rounded to `bits`
//
// The random numbers of an image depend on the seed, the world, the sensor's name and the time.

#include <memory>
#include <optional>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/physical_light.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense::sensors {

// The image sensor of a camera; empty: none.
std::optional<ImagerCfg> imager_of(const CameraSensorCfg& cfg);

// What CameraResponse does not do is done by the kernels.
bool needs_response(const CameraSensorCfg& cfg);

class CameraResponse {
 public:
  CameraResponse(const CameraSensorCfg& cfg, const render::PhysicalOptions& options,
                 int num_worlds);

  // The next image of the world is the first one.
  void reset(int world) { states_[world].images = 0; }
  // Where the radiance of a world's images is kept if they have no field for it: [H, W, 3], cd/m^2.
  float* radiance(int world) { return states_[world].radiance.data(); }
  void keep_radiance();
  // s, of the world's next image, which is taken at `time`. With automatic exposure it follows from
  // the exposure of the last image; the first one has the longest.
  double exposure_time(int world, double time) const;

  // Writes rgb [H, W, 3] for an image at `time`, s, with this radiance.
  void develop(int world, double time, const render::PixelGrid& grid, Rng rng,
               const float* radiance, std::uint8_t* rgb);

 private:
  struct State {
    int images = 0;  // since the reset, at different times; counts to 2
    double exposure = 0, time = 0;
    double earlier_exposure = 0, earlier_time = 0;  // of the last image of an earlier time
    std::vector<float> radiance;
  };
  double metered(const float* radiance) const;
  void expose(State& state, double time, const float* radiance) const;

  int width_, height_;
  bool automatic_;
  double exposure_, time_constant_;
  std::optional<ImagerCfg> imager_;
  render::PhysicalView display_;  // for tone mapping
  std::vector<State> states_;
};

}  // namespace mjsense::sensors
