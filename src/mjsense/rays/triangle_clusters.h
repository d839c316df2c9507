// SPDX-License-Identifier: Apache-2.0
#pragma once
// Triangles of a shape in blocks of 16 neighbours, under a tree of bounding boxes with 16 children
// per node. Cameras draw from it where the image is finer than the triangles. The layout suits
// kernels that process a whole block or node at a time.

#include <vector>

namespace mjsense::rays {

constexpr int kClusterSize = 16;

struct alignas(64) TriangleBlock {
  float corners[3][3][kClusterSize];  // [corner][coordinate][lane], m, shape frame
  int face[kClusterSize];             // in unused lanes all corners are one point
};

struct alignas(64) ClusterNode {
  float center[3][kClusterSize], half[3][kClusterSize];  // bounding box of each child, m
  // The normals of a child's triangles are all within some angle of `axis`. `spread` is the sine of
  // that angle, or 1 if the angle is 90 degrees or more.
  float axis[3][kClusterSize], spread[kClusterSize];
  int child[kClusterSize];  // index into `nodes`, or ~index into `blocks`
  int count;
};

struct Clusters {
  std::vector<ClusterNode> nodes;  // the first is the root
  std::vector<TriangleBlock> blocks;

  // Maximum number of pending nodes during a traversal of the tree.
  static constexpr int kMaxWaiting = 256;
};

// `vertices` [n, 3], `faces` [num_faces, 3]. The result is the same on every machine.
Clusters build_clusters(const float* vertices, const int* faces, int num_faces);

}  // namespace mjsense::rays
