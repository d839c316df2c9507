// SPDX-License-Identifier: Apache-2.0
// Replaces render/opengl/ in builds without it.
#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/render/opengl/gl_renderer.h"

namespace mjsense::render {

std::unique_ptr<GlRenderer> make_gl_renderer(const mjModel*, const GlRendererCfg&,
                                             const std::string& context) {
  throw RuntimeError(fmt::format(
      "{}: renderer 'opengl' is not in this build: install libegl-dev and configure with "
      "-DMJSENSE_OPENGL=ON, or use renderer 'rays'",
      context));
}

}  // namespace mjsense::render
