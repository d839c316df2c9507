// SPDX-License-Identifier: Apache-2.0
#pragma once
// Small scenes and images of them, whose pixels can be computed by hand.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/view_builder.h"

namespace mjsense::testing {

using Pixel = std::array<int, 3>;

struct Picture {
  int width, height;
  std::vector<std::uint8_t> rgb;
  std::vector<float> depth, normals, points;
  std::vector<std::int32_t> ids;  // (id, mjtObj) per pixel

  Picture(int w, int h)
      : width(w),
        height(h),
        rgb(3 * w * h),
        depth(w * h),
        normals(3 * w * h),
        points(3 * w * h),
        ids(2 * w * h) {}
  render::ImageTargets targets() {
    render::ImageTargets t;
    t.rgb = rgb.data();
    t.depth = depth.data();
    t.normals = normals.data();
    t.points = points.data();
    t.segmentation = ids.data();
    return t;
  }
  Pixel at(int x, int y) const {
    const std::uint8_t* p = rgb.data() + 3 * (y * width + x);
    return {p[0], p[1], p[2]};
  }
  int id(int x, int y) const { return ids[2 * (y * width + x)]; }
};

// A model, its ray scene, and images of it from any camera pose.
struct TestRenderer {
  std::unique_ptr<mjModel, void (*)(mjModel*)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};
  std::unique_ptr<rays::RayScene> rays;
  std::unique_ptr<render::SurfaceAssets> assets;
  render::ViewOptions options;
  render::RenderTiles render = render::best_render_tiles();

  explicit TestRenderer(std::string xml) {
    // A camera in the model enables what only images need: clusters of triangles.
    if (xml.find("<camera") == std::string::npos)
      xml += "<worldbody><camera pos='0 0 90'/></worldbody>";
    char error[500] = "";
    mjSpec* spec =
        mj_parseXMLString(("<mujoco>" + xml + "</mujoco>").c_str(), nullptr, error, sizeof error);
    if (!spec) throw RuntimeError(error);
    model.reset(mj_compile(spec, nullptr));
    if (!model) throw RuntimeError(mjs_getError(spec));
    mj_deleteSpec(spec);
    data.reset(mj_makeData(model.get()));
    mj_forward(model.get(), data.get());
  }
  // Overwrites texture `id`; color(i) is texel i of the image in memory.
  void paint(int id, auto&& color) {
    const int n = model->tex_width[id] * model->tex_height[id];
    for (int i = 0; i < n; ++i) {
      const Pixel c = color(i);
      for (int k = 0; k < 3; ++k)
        model->tex_data[model->tex_adr[id] + 3 * i + k] = static_cast<mjtByte>(c[k]);
    }
  }
  // Call after data or the model have changed.
  void update() {
    mj_forward(model.get(), data.get());
    if (!rays) {
      rays = std::make_unique<rays::RayScene>(model.get(), 1);
      assets = std::make_unique<render::SurfaceAssets>(model.get(), true, true);
    }
    World world;
    world.model = model.get();
    world.data = data.get();
    rays->update(world);
  }
  // The view from `at`; x and y are the camera's axes (unit, world frame).
  const render::View& view(render::ViewBuilder& builder, std::array<double, 3> at,
                           std::array<double, 3> x, std::array<double, 3> y,
                           const render::PixelGrid& grid) {
    const double z[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                         x[0] * y[1] - x[1] * y[0]};
    double r[9];
    for (int i = 0; i < 3; ++i) {
      r[3 * i] = x[i];
      r[3 * i + 1] = y[i];
      r[3 * i + 2] = z[i];
    }
    return builder.build(rays->world(0), rays->shared(), render::Appearance(model.get()), {},
                         at.data(), r, grid);
  }
  void draw(const render::View& view, const render::ImageTargets& targets) {
    render::TileMemory memory(render::ViewBuilder::max_geoms(model.get()));
    render(view, targets, 0, (view.grid.height + render::kTileSize - 1) / render::kTileSize,
           memory.scratch());
  }
  Picture take(std::array<double, 3> at, std::array<double, 3> x, std::array<double, 3> y,
               const render::PixelGrid& grid, int samples = 1) {
    if (!rays) update();
    render::ViewBuilder builder(model.get(), *assets, options);
    Picture out(grid.width, grid.height);
    render::ImageTargets targets = out.targets();
    targets.samples = samples;
    draw(view(builder, at, x, y, grid), targets);
    return out;
  }
  // Returns rgb [size, size, 3].
  std::vector<std::uint8_t> shoot(std::array<double, 3> at, std::array<double, 3> x,
                                  std::array<double, 3> y, int size, double fovy = 45,
                                  int samples = 1) {
    return take(at, x, y, render::grid_from_fovy(size, size, fovy, false), samples).rgb;
  }
  Pixel center(std::array<double, 3> at, std::array<double, 3> x, std::array<double, 3> y,
               double fovy = 45) {
    const auto image = shoot(at, x, y, 9, fovy);
    const std::uint8_t* p = image.data() + 3 * (4 * 9 + 4);
    return {p[0], p[1], p[2]};
  }
  Pixel from_above(double x, double y, double height = 2) {
    return center({x, y, height}, {1, 0, 0}, {0, 1, 0}, 1);
  }
};

inline void expect_pixel(Pixel got, Pixel want, int tolerance = 1) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(got[c], want[c], tolerance) << got[0] << " " << got[1] << " " << got[2] << " for "
                                            << want[0] << " " << want[1] << " " << want[2];
}

// Axes of a camera that looks down.
inline constexpr std::array<double, 3> kX{1, 0, 0}, kY{0, 1, 0};

// Ambient light only: a pixel shows colour times texture.
inline constexpr char kAmbient[] =
    R"(<visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>)";
inline constexpr char kDark[] = R"(<visual><headlight active="0"/></visual>)";
inline constexpr char kMatte[] =
    R"(<asset><material name="matte" specular="0" rgba="1 .5 .2 1"/></asset>)";

}  // namespace mjsense::testing
