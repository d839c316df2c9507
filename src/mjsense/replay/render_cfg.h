// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of a rendering of recorded episodes, which python/mjsense/dataset/rendering.py makes. In
// Python, an option of images, of videos or of compression that is not given is as recorded.

#include "mjsense/record/files_cfg.h"
#include "mjsense/sensors/camera/image_cfg.h"

namespace mjsense::replay {

struct RenderCfg : sensors::ImageCfg, record::FilesCfg {
  double brightness = 1;
  int num_worlds = 4;
  int threads = 0;
};
template <class V>
void visit_fields(V& v, RenderCfg& c) {
  v.object("RenderCfg", "A rendering of recorded episodes.");
  v.include(static_cast<sensors::ImageCfg&>(c));
  v("brightness", c.brightness, "Factor of all lights.").positive();
  v("num_worlds", c.num_worlds, "Number of episodes that are rendered in parallel.")
      .option("worlds")
      .at_least(1);
  v("threads", c.threads, "Number of threads; 0: one per available CPU.").at_least(0);
  v.include(static_cast<record::FilesCfg&>(c));
}

}  // namespace mjsense::replay
