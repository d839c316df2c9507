// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/mesh_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <span>
#include <thread>
#include <vector>

#include "mjsense/core/content_cache.h"
#include "mjsense/core/error.h"

namespace mjsense::rays {
namespace {

const std::vector<float> kVertices{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<int> kFaces{0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3};

MeshArrays arrays(std::span<const float> vertices, std::span<const int> faces) {
  return {vertices, faces};
}

TEST(MeshGeometry, EqualContentIsShared) {
  const std::vector<float> vertices = kVertices;
  const MeshGeometry a(arrays(kVertices, kFaces), true), b(arrays(vertices, kFaces), true);
  EXPECT_EQ(a.scene, b.scene);
  EXPECT_EQ(a.clusters, b.clusters);
  EXPECT_EQ(a.horizons, b.horizons);
  EXPECT_FALSE(a.clusters->nodes.empty());
  EXPECT_EQ(a.box, (std::array<float, 6>{0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(a.scene->device.get(), ray_device().get());
}

TEST(MeshGeometry, DifferentContentIsNotShared) {
  const auto a = mesh_clusters(arrays(kVertices, kFaces));
  for (std::size_t i = 0; i < kVertices.size(); ++i) {
    std::vector<float> other = kVertices;
    other[i] += 1e-6f;
    EXPECT_NE(a, mesh_clusters(arrays(other, kFaces))) << i;
  }
  std::vector<int> turned = kFaces;
  std::swap(turned[0], turned[1]);
  EXPECT_NE(a, mesh_clusters(arrays(kVertices, turned)));
  const auto scene = mesh_scene(arrays(kVertices, kFaces), BuildQuality::kHigh);
  EXPECT_NE(scene, mesh_scene(arrays(kVertices, kFaces), BuildQuality::kFast));
}

TEST(MeshGeometry, HasWhatOnlyImagesNeedOnRequest) {
  const MeshGeometry geometry(arrays(kVertices, kFaces), false);
  EXPECT_NE(geometry.scene, nullptr);
  EXPECT_EQ(geometry.clusters, nullptr);
  EXPECT_EQ(geometry.horizons, nullptr);
  EXPECT_EQ(MeshGeometry(arrays(kVertices, {}), true).scene, nullptr);  // no faces
}

TEST(MeshGeometry, BoxContainsAllPoints) {
  for (int count = 1; count < 12; ++count) {
    std::vector<float> points;
    float low[3], high[3];
    for (int i = 0; i < 3 * count; ++i) {
      points.push_back(static_cast<float>((i * 7919) % 101 - 50));
      low[i % 3] = i < 3 ? points[i] : std::min(low[i % 3], points[i]);
      high[i % 3] = i < 3 ? points[i] : std::max(high[i % 3], points[i]);
    }
    float box[6];
    box_around(points, box);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(box[k], 0.5f * (low[k] + high[k])) << count;
      EXPECT_EQ(box[3 + k], 0.5f * (high[k] - low[k])) << count;
    }
  }
}

// Embree reports no error by itself; rays would hit nothing. Memory runs out at each allocation in
// turn.
TEST(MeshGeometry, FailedBuildThrows) {
  const auto device = ray_device();
  int allowed = 0, left = 0;
  rtcSetDeviceMemoryMonitorFunction(
      device.get(),
      [](void* count, ssize_t bytes, bool) {
        return bytes <= 0 || --*static_cast<int*>(count) >= 0;
      },
      &left);
  for (bool built = false; !built; ++allowed) {
    ASSERT_LT(allowed, 100);
    left = allowed;
    try {
      built = build_triangles(device.get(), kVertices, kFaces, BuildQuality::kHigh) != nullptr;
      EXPECT_GE(left, 0);
    } catch (const RuntimeError& error) {
      EXPECT_STREQ(error.what(),
                   "ray scene: Embree could not build a mesh of 4 vertices and 4 faces: memory "
                   "monitor forced termination (error 4)");
    }
  }
  EXPECT_GT(allowed, 3);  // allocations of the buffers and of the tree
  rtcSetDeviceMemoryMonitorFunction(device.get(), nullptr, nullptr);
}

TEST(MeshGeometry, IsReleasedWithItsLastOwner) {
  std::weak_ptr<const MeshScene> seen;
  {
    const MeshGeometry a(arrays(kVertices, kFaces), false);
    seen = a.scene;
  }
  EXPECT_TRUE(seen.expired());
  EXPECT_NE(mesh_scene(arrays(kVertices, kFaces), BuildQuality::kHigh), nullptr);
}

TEST(MeshGeometry, IsThreadSafe) {
  std::vector<std::shared_ptr<const Horizons>> made(8);
  {
    std::vector<std::jthread> threads;
    threads.reserve(made.size());
    for (auto& one : made)
      threads.emplace_back([&one] { one = mesh_horizons(arrays(kVertices, kFaces)); });
  }
  for (const auto& one : made) EXPECT_EQ(one, made[0]);
}

// Two arrays differ from their concatenation, and their order matters.
TEST(ContentKey, DistinguishesArrays) {
  const std::vector<int> a{1, 2, 3}, b{4, 5}, ab{1, 2, 3, 4, 5};
  const auto key = [](auto... parts) {
    ContentKey k;
    (k.add(std::span<const int>(parts)), ...);
    return k;
  };
  EXPECT_EQ(key(a, b), key(a, b));
  EXPECT_NE(key(a, b), key(ab));
  EXPECT_NE(key(a, b), key(b, a));
  EXPECT_NE(key(a), key(a, std::vector<int>{}));
}

TEST(ContentKey, DependsOnEveryElementOfALongArray) {
  std::vector<int> values(203);
  std::iota(values.begin(), values.end(), 0);
  const auto key = [&] { return ContentKey().add(std::span<const int>(values)); };
  const ContentKey first = key();
  for (std::size_t i = 0; i < values.size(); ++i) {
    ++values[i];
    EXPECT_NE(key(), first) << i;
    --values[i];
    std::swap(values[i], values[(i + 2) % values.size()]);
    EXPECT_NE(key(), first) << i;
    std::swap(values[i], values[(i + 2) % values.size()]);
  }
  EXPECT_EQ(key(), first);
}

}  // namespace
}  // namespace mjsense::rays
