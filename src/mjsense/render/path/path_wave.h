// SPDX-License-Identifier: Apache-2.0
#pragma once
// Paths of many pixels that advance together, one reflection at a time, so that rays can be traced and
// surfaces be gathered in packets.

#include <cstdint>
#include <vector>

#include "mjsense/render/path/path_lights.h"
#include "mjsense/render/path/path_scene.h"
#include "mjsense/render/path/path_surfaces.h"

namespace mjsense::render {

class PathWave {
 public:
  PathWave(const PathScene& scene, const PathLights& lights) : scene_(scene), lights_(lights) {}

  // Traces the paths of the samples [first, last) of each pixel of [x0, x1) x [y0, y1), and adds their radiance
  // to sum [pixels, 3], row by row.
  void add_samples(int x0, int x1, int y0, int y1, int first, int last, std::vector<double>& sum);

 private:
  struct Path {
    Vec3 o, d;       // of the current ray
    Vec3 from;       // where it was reflected; behind `o` after transparent surfaces
    double density;  // of its direction, 1/sr; 0: not random
    double total;    // PathLights::total(from)
    Rgb64 throughput, radiance;
    PathRandom random;
    int surfaces = 0, reflections = 0;
  };
  // Light that reaches a path unless something is in between.
  struct Shadow {
    int path;
    Vec3 o, d;
    double distance;
    Rgb64 light;  // from an emissive geom: the factor of its radiance
    int geom;     // emissive geom that must be hit, or -1
  };
  void start(int x0, int x1, int y0, int y1, int sample);
  void trace(PathScene::Stops stops);
  void advance();
  bool leave(Path& path, const PathHit& hit);
  bool reflect(int index, const PathHit& hit, const PathSurface& surface, const Vec3& point);
  void trace_shadows();

  const PathScene& scene_;
  const PathLights& lights_;
  std::vector<Path> paths_;
  std::vector<PathPixel> pixels_;  // by path
  std::vector<int> active_;        // paths
  std::vector<Shadow> shadows_;
  // Working memory.
  std::vector<PathRay> rays_;
  std::vector<PathHit> hits_;
  std::vector<std::uint64_t> met_;  // of active_: those that hit a geom, by geom
  std::vector<PathHit> met_hits_;
  std::vector<Vec3> points_;
  std::vector<PathSurface> surfaces_;
};

}  // namespace mjsense::render
