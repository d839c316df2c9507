// SPDX-License-Identifier: Apache-2.0
#pragma once
// `object_image_points`: for each object and camera, up to ten pixels that show the object.

#include <cstdint>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense::observe {

// Streams, for each object and camera
//   <name>/<object>/<camera>/points      float32 [10, 2]: (column / W, row / H), rounded to 4
//                                        decimals; NaN for unused points
//   <name>/<object>/<camera>/num_points  int32 [1]
// The pixels of an object are those whose segmentation is a geom of a visible group (< 3) of its
// body or of a descendant. They are eroded twice with the 3 x 3 cross (outside the image counts as
// background), so that points are well inside the object. If erosion removes all pixels of an
// object, all of them are used. Up to ten pixels are listed row by row; of more, ten different ones
// are drawn at random, in random order.
//
// The sensor reads the cameras' segmentation, so it is computed after the cameras are rendered.
class ImagePointsSensor final : public Sensor {
 public:
  static constexpr int kPoints = 10;
  static constexpr int kMaxObjects = 16;
  struct Object {
    std::string key;    // name in the streams
    BodyRef body;       // root body
    bool erode = true;  // false for thin objects
  };
  struct Camera {
    std::string name;
    // Has the segmentation: int32 [H, W, 2] = (object id, object type), -1 for background.
    Sensor* sensor;
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
    const Mask *all, *eroded;  // [H, W], `eroded` is valid in the box only
    Box box;                   // bounding box of the object
  };
  void points_of(const World& world, int object, int camera, const Masks& masks);

  std::vector<Object> objects_;
  std::vector<Camera> cameras_;
  std::vector<Sensor*> inputs_;
  std::vector<Picture> pictures_;
  struct Scratch {
    std::vector<Mask> geom_objects;  // [ngeom]
    std::vector<Mask> pictures;      // [3, H, W]: the masks, eroded once, eroded twice
  };
  std::vector<Scratch> scratch_;  // [B]
};

// Erodes up to 16 masks [H, W] at once, one per bit, with the 3 x 3 cross; outside counts as 0.
// Rows are `stride` elements apart. `out` must not be `in`.
void erode_cross(const std::uint16_t* in, int width, int height, int stride, std::uint16_t* out);

}  // namespace mjsense::observe
