// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/image_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"

namespace mjsense::observe {
namespace {

// End of the run of pixels that are equal to the one at x. Images consist of long runs, so eight
// pixels are compared at a time.
int end_of_run(const std::int32_t* row, int x, int width) {
  const auto pixel = [row](int i) {
    std::uint64_t both;
    std::memcpy(&both, row + 2 * i, sizeof both);
    return both;
  };
  const std::uint64_t first = pixel(x);
  int end = x + 1;
  for (; end + 8 <= width; end += 8) {
    std::uint64_t other = 0;
    for (int i = 0; i < 8; ++i) other |= pixel(end + i) ^ first;
    if (other != 0) break;
  }
  while (end < width && pixel(end) == first) ++end;
  return end;
}

}  // namespace

void ImagePointsSensor::Box::add(int from, int to, int y) {
  left = std::min(left, from);
  right = std::max(right, to);
  top = std::min(top, y);
  bottom = y + 1;  // rows are visited in order
}

ImagePointsSensor::ImagePointsSensor(std::string name, std::vector<Object> objects,
                                     std::vector<Camera> cameras)
    : Sensor(std::move(name)), objects_(std::move(objects)), cameras_(std::move(cameras)) {
  if (objects_.size() > kMaxObjects) {
    throw ValueError(fmt::format("sensor '{}': {} objects: the maximum is {}", this->name(),
                                 objects_.size(), kMaxObjects));
  }
  for (const Camera& camera : cameras_) {
    if (std::ranges::find(inputs_, camera.sensor) == inputs_.end()) {
      inputs_.push_back(camera.sensor);
    }
  }
}

void ImagePointsSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  for (Object& object : objects_) object.body.resolve(m, fmt::format("sensor '{}'", name()));
  pictures_.clear();
  std::int64_t maximum = 0;
  for (const Camera& camera : cameras_) {
    const Field& field = camera.sensor->field(camera.field);
    const Shape& shape = field.spec.shape;
    if (field.spec.dtype != DType::kInt32 || shape.rank() != 3 || shape[2] != 2) {
      throw ValueError(fmt::format("sensor '{}': '{}' must be int32 (H, W, 2), but is {} {}",
                                   name(), field.spec.name, dtype_name(field.spec.dtype),
                                   shape.str()));
    }
    pictures_.push_back({&field, static_cast<int>(shape[1]), static_cast<int>(shape[0])});
    maximum = std::max(maximum, shape[0] * shape[1]);
  }
  scratch_.assign(init.num_worlds, {std::vector<Mask>(m->ngeom), std::vector<Mask>(3 * maximum)});
  clear_fields();
  for (const Object& object : objects_) {
    for (const Camera& camera : cameras_) {
      SensorSpec spec;
      spec.shape = {kPoints, 2};
      spec.frame = "image of " + camera.name;
      spec.low = 0;
      spec.high = 1;
      spec.description =
          "Pixels that show the object, (column / W, row / H); NaN where there is none.";
      add_field(fmt::format("{}/{}/points", object.key, camera.name), spec, init.num_worlds);
      SensorSpec count;
      count.dtype = DType::kInt32;
      count.shape = {1};
      count.low = 0;
      count.high = kPoints;
      count.description = "Number of points.";
      add_field(fmt::format("{}/{}/num_points", object.key, camera.name), count, init.num_worlds);
    }
  }
}

void ImagePointsSensor::compute(const World& world) {
  const mjModel* m = world.model;
  std::vector<Mask>& geom_objects = scratch_[world.id].geom_objects;
  std::ranges::fill(geom_objects, Mask(0));
  for (std::size_t o = 0; o < objects_.size(); ++o) {
    const int root = objects_[o].body(world.id);
    for (int g = 0; root >= 0 && g < m->ngeom; ++g) {
      if (m->geom_group[g] < 3 && is_descendant_or_self(m, m->geom_bodyid[g], root)) {
        geom_objects[g] |= Mask(1u << o);
      }
    }
  }
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const auto [field, width, height] = pictures_[c];
    Mask* mask = scratch_[world.id].pictures.data();
    Mask* once = mask + width * height;
    Mask* twice = once + width * height;
    const auto segments = field->data.row<std::int32_t>(world.id);
    // All work after this is limited to the bounding boxes of the objects.
    Box all{width, height, 0, 0};
    std::array<Box, kMaxObjects> boxes;
    boxes.fill(all);
    for (int y = 0; y < height; ++y) {
      const std::int32_t* row = segments.data() + 2 * y * width;
      for (int x = 0, end; x < width; x = end) {
        end = end_of_run(row, x, width);
        const std::int32_t id = row[2 * x];
        const Mask seen = row[2 * x + 1] == mjOBJ_GEOM && id >= 0 ? geom_objects[id] : Mask(0);
        std::fill(mask + y * width + x, mask + y * width + end, seen);
        if (!seen) continue;
        all.add(x, end, y);
        for (unsigned left = seen; left; left &= left - 1) {
          boxes[std::countr_zero(left)].add(x, end, y);
        }
      }
    }
    if (all.top < all.bottom) {
      // Eroding only the box gives the same result: all pixels outside it are background, as is
      // everything outside the image.
      const int from = all.top * width + all.left;
      const int columns = all.right - all.left, rows = all.bottom - all.top;
      erode_cross(mask + from, columns, rows, width, once + from);
      erode_cross(once + from, columns, rows, width, twice + from);
    }
    for (std::size_t o = 0; o < objects_.size(); ++o) {
      points_of(world, static_cast<int>(o), static_cast<int>(c), {mask, twice, boxes[o]});
    }
  }
}

void ImagePointsSensor::points_of(const World& world, int object, int camera, const Masks& masks) {
  // Not a structured binding, because clang 14 cannot capture one in a lambda.
  const int width = pictures_[camera].width;
  const int height = pictures_[camera].height;
  const std::size_t index = 2 * (object * cameras_.size() + camera);
  const auto points = fields()[index].data.row<float>(world.id);
  const auto num_points = fields()[index + 1].data.row<std::int32_t>(world.id);
  std::ranges::fill(points, std::numeric_limits<float>::quiet_NaN());

  const Box& box = masks.box;
  const auto count_of = [&](const Mask* m) {
    int n = 0;
    for (int y = box.top; y < box.bottom; ++y) {
      for (int i = y * width + box.left; i < y * width + box.right; ++i) n += m[i] >> object & 1;
    }
    return n;
  };
  const bool erode = !cameras_[camera].skip_erosion && objects_[object].erode;
  const Mask* chosen = erode ? masks.eroded : masks.all;
  int count = count_of(chosen);
  if (count == 0 && erode) count = count_of(chosen = masks.all);
  const int n = std::min(count, kPoints);
  num_points[0] = n;
  if (n == 0) return;

  // ranks[i]: index, counted row by row, of the object's pixel that becomes point i.
  std::array<int, kPoints> ranks;
  for (int i = 0; i < n; ++i) ranks[i] = i;
  if (count > kPoints) {
    Rng rng = world.rng(stream_of(fields()[index].spec.name));
    for (int i = 0; i < n; ++i) {
      do {
        ranks[i] = static_cast<int>(rng.below(count));
      } while (std::find(ranks.begin(), ranks.begin() + i, ranks[i]) != ranks.begin() + i);
    }
  }
  std::array<int, kPoints> order;
  for (int i = 0; i < n; ++i) order[i] = i;
  std::sort(order.begin(), order.begin() + n, [&](int a, int b) { return ranks[a] < ranks[b]; });

  const auto round4 = [](float x) { return std::nearbyint(x * 10000.0f) / 10000.0f; };
  int rank = 0, next = 0;
  for (int y = box.top; next < n; ++y) {
    for (int x = box.left; x < box.right && next < n; ++x) {
      if (!(chosen[y * width + x] >> object & 1)) continue;
      if (rank++ != ranks[order[next]]) continue;
      points[2 * order[next]] = round4(static_cast<float>(x) / static_cast<float>(width));
      points[2 * order[next] + 1] = round4(static_cast<float>(y) / static_cast<float>(height));
      ++next;
    }
  }
}

void erode_cross(const std::uint16_t* in, int width, int height, int stride, std::uint16_t* out) {
  std::fill(out, out + width, std::uint16_t(0));
  std::fill(out + (height - 1) * stride, out + (height - 1) * stride + width, std::uint16_t(0));
  for (int y = 1; y + 1 < height; ++y) {
    const std::uint16_t* row = in + y * stride;
    std::uint16_t* to = out + y * stride;
    to[0] = to[width - 1] = 0;
    for (int x = 1; x + 1 < width; ++x) {
      to[x] = row[x] & row[x - 1] & row[x + 1] & row[x - stride] & row[x + stride];
    }
  }
}

}  // namespace mjsense::observe
