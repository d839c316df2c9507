// SPDX-License-Identifier: Apache-2.0
#pragma once
// The triangles of a shape in blocks of 16 neighbours, under a tree of boxes with 16 children a
// node: what an image draws where it is finer than the triangles. Laid out for kernels, which take
// a block or a node at a time.

#include <vector>

namespace mjsense {

constexpr int kClusterSize = 16;

struct alignas(64) TriangleBlock {
  float corners[3][3][kClusterSize];  // corner, coordinate; m, the shape's frame
  int face[kClusterSize];             // unused lanes: all corners in one point
};

struct alignas(64) ClusterNode {
  float center[3][kClusterSize], half[3][kClusterSize];  // box of each child, m
  // All normals of a child's triangles are within an angle of `axis`; its sine, 1 if that is 90
  // degrees or more.
  float axis[3][kClusterSize], spread[kClusterSize];
  int child[kClusterSize];  // of `nodes`; ~child of `blocks`
  int count;
};

struct Clusters {
  std::vector<ClusterNode> nodes;  // the first is the root
  std::vector<TriangleBlock> blocks;

  // Nodes that a walk over the tree has waiting at most.
  static constexpr int kMaxWaiting = 256;
};

// `vertices` [n, 3], `faces` [num_faces, 3]. The same for the same shape on every machine.
Clusters build_clusters(const float* vertices, const int* faces, int num_faces);

}  // namespace mjsense
