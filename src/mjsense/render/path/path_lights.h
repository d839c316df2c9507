// SPDX-License-Identifier: Apache-2.0
#pragma once
// The lights of a view, for next-event estimation: at each surface one of them is chosen at random, in
// proportion to an estimate of its light there. Frame: the camera's, m.
//
//   model's lights   points, or balls of ViewLight::radius, which give a surface that faces them as much
//                    light as a point in their centre; those without shadows shine through geoms
//   emissive geoms   finite planes, boxes and spheres; others are only found by chance
//   surroundings     EnvironmentSampler
//
// All but points can also be hit by a ray that a surface reflects.

#include <memory>
#include <span>
#include <vector>

#include "mjsense/render/path/environment_sampler.h"
#include "mjsense/render/path/path_random.h"
#include "mjsense/render/path/path_scene.h"

namespace mjsense::render {

// A direction from a point to a light.
struct LightSample {
  Vec3 direction;   // unit
  double distance;  // m, where a shadow ray may end
  double
      density;  // 1/sr; 0: the light has exactly this direction, and `radiance` is its irradiance on
                // a surface that faces it
  Rgb64 radiance;  // of emissive geoms: not used
  double choice;   // probability with which the light was chosen
  bool blocked;    // by geoms between the point and the light
  int geom = -1;   // that must be hit for an emissive geom, index in View::geoms
};

class PathLights {
 public:
  explicit PathLights(std::shared_ptr<const EnvironmentSampler> environment)
      : environment_(std::move(environment)) {}
  void build(const View& view);

  // Sum of the estimates of all lights at a point; 0: it gets no light that can be chosen.
  double total(const Vec3& p) const;
  // Draws a light and a direction. False: the sample has no light.
  bool sample(const Vec3& p, double total, PathRandom& random, LightSample& out) const;

  // Light of a ray that was reflected at `from` with the density `density` (0: exactly in this direction),
  // weighted against sample() (the balance heuristic: E. Veach, Robust Monte Carlo Methods for Light
  // Transport Simulation, 1997). `total`: of `from`.
  Rgb64 surroundings(const Vec3& direction, double density, double total) const;
  // Balls up to the distance `end` from `o` along the ray. `first`: o = from, and lights without shadows
  // count at any distance.
  Rgb64 balls(const Vec3& from, const Vec3& o, const Vec3& direction, double end, bool first,
              double density, double total) const;
  // Weight of the light of an emissive geom that is hit at `at`, under this cosine.
  double emitter_weight(int geom, const Vec3& from, const Vec3& at, double cosine, double density,
                        double total) const;

 private:
  struct Emitter {
    int geom;
    Vec3 center;
    double area, power;  // m^2; luminance times area
  };
  // A light as it reaches a point.
  struct Arriving {
    Vec3 to;          // unit direction to its centre
    double distance;  // m
    double scale;     // of the light's diffuse colour
  };
  void add_emitter(int index);
  Arriving arriving(const ViewLight& light, const Vec3& p) const;
  bool is_ball(const ViewLight& light, double distance) const;
  double estimate(std::size_t i, const Vec3& p) const;
  double environment_estimate() const;
  void sample_light(const ViewLight& light, const Vec3& p, PathRandom& random,
                    LightSample& out) const;
  bool sample_emitter(const Emitter& emitter, const Vec3& p, PathRandom& random,
                      LightSample& out) const;
  Vec3 to_environment(const Vec3& direction) const;

  const View* view_ = nullptr;
  std::shared_ptr<const EnvironmentSampler> environment_;
  std::vector<Emitter> emitters_;
  std::vector<int> emitter_of_;  // by geom, or -1
};

}  // namespace mjsense::render
