// SPDX-License-Identifier: Apache-2.0
#pragma once
// `object_image_points`: for each object and camera, up to ten pixels that show it.

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

// Streams, for each object and camera
//   <name>/<object>/<camera>/points      float32 [10, 2]: (column / W, row / H), rounded to 4
//                                        decimals; NaN where there is none
//   <name>/<object>/<camera>/num_points  int32 [1]
// The pixels of an object are those whose segment is a geom of its body or below, of a visible
// group (< 3). They are eroded twice with the 3 x 3 cross (outside the picture counts as
// background) so that points lie well inside; an object that vanishes under it keeps all its
// pixels. At most ten: row by row; more: ten different ones drawn at random, in random order.
//
// Reads the cameras' segmentation, so it is computed after they are cast.
class ImagePointsSensor final : public Sensor {
 public:
  static constexpr int kPoints = 10;
  static constexpr int kMaxObjects = 16;
  struct Object {
    std::string key;    // its name in the streams
    BodyRef body;       // its root
    bool erode = true;  // false for what is thin
  };
  struct Camera {
    std::string name;
    Sensor* sensor;  // its segmentation: int32 [H, W, 2] = (object id, object type), -1 background
    std::string field = "segmentation";
    bool skip_erosion = false;
  };
  ImagePointsSensor(std::string name, std::vector<Object> objects, std::vector<Camera> cameras);
  std::string_view kind() const override { return "image_points"; }
  Stage stage() const override { return Stage::kPostCast; }
  mjtStage needs() const override { return mjSTAGE_NONE; }
  std::span<Sensor* const> inputs() const override { return inputs_; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  using Mask = std::uint16_t;  // bit o: the pixel belongs to object o
  struct Picture {
    const Field* segmentation;
    int width, height;
  };
  // Columns [left, right) of rows [top, bottom).
  struct Box {
    int left, top, right, bottom;
    void add(int from, int to, int y);
  };
  struct Masks {
    const Mask *all, *eroded;  // [H, W], the second valid in the box
    Box box;                   // around the object
  };
  void points_of(const World& world, int object, int camera, const Masks& masks);

  std::vector<Object> objects_;
  std::vector<Camera> cameras_;
  std::vector<Sensor*> inputs_;
  std::vector<Picture> pictures_;
  struct Scratch {
    std::vector<Mask> geom_objects;  // [ngeom]
    std::vector<Mask> pictures;      // [3, H, W]
  };
  std::vector<Scratch> scratch_;  // [B]
};

// The 3 x 3 cross erosion of up to 16 masks at once, bit by bit; outside counts as 0. `out` must
// not be `in`. [H, W], rows `stride` apart.
void erode_cross(const std::uint16_t* in, int width, int height, int stride, std::uint16_t* out);

}  // namespace mjsense
