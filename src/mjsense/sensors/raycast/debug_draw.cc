#include "mjsense/sensors/raycast/debug_draw.h"

#include <algorithm>
#include <array>
#include <cstdio>

namespace mjsense {
namespace {

using Point = std::array<double, 3>;

Point point(const float* p) { return {p[0], p[1], p[2]}; }

Point step(const Point& p, double length, const Point& d) {
  return {p[0] + length * d[0], p[1] + length * d[1], p[2] + length * d[2]};
}

class Drawing {
 public:
  Drawing(const RayCastSensor& sensor, mjvScene* scene) : name_(sensor.name()), scene_(scene) {}

  void ball(const Point& at, double radius, const std::array<float, 4>& rgba, int ray) {
    const double size[3] = {radius, radius, radius};
    if (mjvGeom* g = next()) {
      mjv_initGeom(g, mjGEOM_SPHERE, size, at.data(), nullptr, rgba.data());
      label(g, "hit", ray);
    }
  }
  void arrow(const Point& from, const Point& to, double width, const std::array<float, 4>& rgba,
             const char* what, int ray) {
    if (mjvGeom* g = next()) {
      mjv_initGeom(g, mjGEOM_ARROW, nullptr, nullptr, nullptr, rgba.data());
      mjv_connector(g, mjGEOM_ARROW, width, from.data(), to.data());
      label(g, what, ray);
    }
  }
  int left_out() const { return left_out_; }

 private:
  mjvGeom* next() {
    if (scene_->ngeom >= scene_->maxgeom) {
      ++left_out_;
      return nullptr;
    }
    mjvGeom* g = scene_->geoms + scene_->ngeom++;
    return g;
  }
  void label(mjvGeom* g, const char* what, int ray) {
    g->category = mjCAT_DECOR;
    std::snprintf(g->label, sizeof g->label, "%s_%s_%d", name_.c_str(), what, ray);
  }

  const std::string& name_;
  mjvScene* scene_;
  int left_out_ = 0;
};

}  // namespace

int draw_rays(const RayCastSensor& sensor, int world, const mjModel* model, mjvScene* scene) {
  const RayCastVizCfg& viz = sensor.cfg().viz;
  const double unit = model->stat.meansize;
  const double miss_length = std::min(0.5, 0.05 * sensor.cfg().max_distance);
  const float* distance = sensor.field("distances").data.row<float>(world).data();
  const float* hit = sensor.field("hit_pos_w").data.row<float>(world).data();
  const float* normal = sensor.field("normals_w").data.row<float>(world).data();
  Drawing drawing(sensor, scene);
  for (int r = 0; r < sensor.num_rays(); ++r) {
    const RayCastSensor::WorldRay ray = sensor.world_ray(world, r);
    if (distance[r] < 0) {
      if (viz.show_rays)
        drawing.arrow(ray.origin, step(ray.origin, miss_length, ray.direction),
                      viz.ray_width * unit, viz.miss_color, "ray", r);
      continue;
    }
    const Point at = point(hit + 3 * r);
    drawing.ball(at, viz.hit_radius * unit, viz.hit_color, r);
    if (viz.show_rays) drawing.arrow(ray.origin, at, viz.ray_width * unit, viz.ray_color, "ray", r);
    if (viz.show_normals)
      drawing.arrow(at, step(at, viz.normal_length * unit, point(normal + 3 * r)),
                    viz.ray_width * unit, viz.normal_color, "normal", r);
  }
  return drawing.left_out();
}

}  // namespace mjsense
