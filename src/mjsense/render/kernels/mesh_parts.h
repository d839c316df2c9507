// SPDX-License-Identifier: Apache-2.0
#pragma once
// Parts of meshes, which may be built at the moment when they are first used. Part of the tile
// kernels.

#include "mjsense/render/view/view_geom.h"

namespace mjsense::render {
namespace {

inline bool has_triangles(const ViewGeom& g) { return g.bvh || g.mesh_on_demand; }
inline bool has_clusters(const ViewGeom& g) { return g.clusters || g.mesh_on_demand; }
inline bool has_horizons(const ViewGeom& g) { return g.horizons || g.mesh_on_demand; }

inline const rays::Clusters& clusters_of(const ViewGeom& g) {
  return g.mesh_on_demand ? g.mesh_on_demand->clusters() : *g.clusters;
}
inline const rays::Horizons& horizons_of(const ViewGeom& g) {
  return g.mesh_on_demand ? g.mesh_on_demand->horizons() : *g.horizons;
}
inline void* bvh_of(const ViewGeom& g) {
  return g.mesh_on_demand ? g.mesh_on_demand->bvh() : g.bvh;
}
inline void* shadow_bvh_of(const ViewGeom& g) {
  return g.mesh_on_demand ? g.mesh_on_demand->shadow_bvh() : g.bvh;
}

}  // namespace
}  // namespace mjsense::render
