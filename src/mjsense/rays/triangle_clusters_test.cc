// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/triangle_clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "mjsense/core/rng.h"

namespace mjsense::rays {
namespace {

// A bumpy sheet of n x n cells.
struct Sheet {
  std::vector<float> vertices;
  std::vector<int> faces;

  Sheet(int n, Rng& rng) {
    for (int r = 0; r <= n; ++r)
      for (int c = 0; c <= n; ++c)
        for (double x : {0.1 * c, 0.1 * r, 0.3 * std::sin(0.2 * c) + rng.uniform(0, 0.02)})
          vertices.push_back(static_cast<float>(x));
    for (int r = 0; r < n; ++r)
      for (int c = 0; c < n; ++c) {
        const int v = r * (n + 1) + c;
        for (int i : {v, v + 1, v + n + 2, v, v + n + 2, v + n + 1}) faces.push_back(i);
      }
  }
  int num_faces() const { return static_cast<int>(faces.size() / 3); }
};

// Calls use(block, lane) for every triangle below child `i` of a node.
template <typename Use>
void each_triangle(const Clusters& clusters, const ClusterNode& node, int i, Use use) {
  if (node.child[i] < 0) {
    for (int lane = 0; lane < kClusterSize; ++lane) use(clusters.blocks[~node.child[i]], lane);
    return;
  }
  const ClusterNode& below = clusters.nodes[node.child[i]];
  for (int k = 0; k < below.count; ++k) each_triangle(clusters, below, k, use);
}

TEST(Clusters, ContainEveryFaceOnceWithinBoxesAndCones) {
  for (int n : {1, 2, 3, 5, 7, 11, 13, 17, 20, 23, 31, 47, 61}) {
    Rng rng(3, 0, 1, n);
    const Sheet sheet(n, rng);
    const Clusters clusters =
        build_clusters(sheet.vertices.data(), sheet.faces.data(), sheet.num_faces());
    std::vector<int> seen(sheet.num_faces(), 0);
    for (std::size_t index = 0; index < clusters.nodes.size(); ++index) {
      const ClusterNode& node = clusters.nodes[index];
      for (int i = 0; i < node.count; ++i) {
        each_triangle(clusters, node, i, [&](const TriangleBlock& block, int lane) {
          std::array<std::array<float, 3>, 3> p;
          for (int corner = 0; corner < 3; ++corner)
            for (int k = 0; k < 3; ++k) {
              p[corner][k] = block.corners[corner][k][lane];
              EXPECT_LE(std::abs(p[corner][k] - node.center[k][i]), node.half[k][i] + 1e-6f);
            }
          float u[3], v[3];
          for (int k = 0; k < 3; ++k) {
            u[k] = p[1][k] - p[0][k];
            v[k] = p[2][k] - p[0][k];
          }
          const float normal[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                   u[0] * v[1] - u[1] * v[0]};
          const float length = std::hypot(normal[0], normal[1], normal[2]);
          if (length == 0) return;  // an unused lane
          float cosine = 0;
          for (int k = 0; k < 3; ++k) cosine += normal[k] * node.axis[k][i] / length;
          const float minimum = std::sqrt(1 - node.spread[i] * node.spread[i]) - 1e-3f;
          EXPECT_TRUE(node.spread[i] == 1 || cosine >= minimum);
          if (index == 0) ++seen[block.face[lane]];
        });
      }
    }
    for (int count : seen) EXPECT_EQ(count, 1);
  }
}

// A strip whose faces have a random order: each child of a node has the faces before the next child's.
TEST(Clusters, AreSortedAlongAStrip) {
  Rng rng(3, 0, 2, 0);
  for (int n : {9, 100, 1000, 5000}) {
    std::vector<float> vertices;
    std::vector<int> order(n), faces;
    for (int i = 0; i < n; ++i) order[i] = i / 2;  // pairs of equal faces
    for (int i = n - 1; i > 0; --i) std::swap(order[i], order[rng.below(i + 1)]);
    for (int i : order) {
      const float x = static_cast<float>(i);
      vertices.insert(vertices.end(), {x, 0, 0, x + 0.5f, 0, 0, x, 0.5f, 0});
    }
    for (int i = 0; i < 3 * n; ++i) faces.push_back(i);
    const Clusters clusters = build_clusters(vertices.data(), faces.data(), n);
    for (const ClusterNode& node : clusters.nodes) {
      int last = -1;
      for (int i = 0; i < node.count; ++i) {
        int low = n, high = -1;
        each_triangle(clusters, node, i, [&](const TriangleBlock& block, int lane) {
          low = std::min(low, order[block.face[lane]]);
          high = std::max(high, order[block.face[lane]]);
        });
        EXPECT_LE(last, low);
        last = high;
      }
    }
  }
}

TEST(Clusters, OfNoFacesAreEmpty) {
  EXPECT_TRUE(build_clusters(nullptr, nullptr, 0).nodes.empty());
}

}  // namespace
}  // namespace mjsense::rays
