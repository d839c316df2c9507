// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/raycast_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/sensors/raycast/raycast_data.h"

namespace mjsense::sensors {
namespace {

// Number of packets that a thread takes at a time.
constexpr int kChunk = 12;
constexpr int kMaxMoments = 100'000;  // maximum number of stored poses of a frame
constexpr double kInf = std::numeric_limits<double>::infinity();

// Of the two quaternions of a rotation, takes the one whose largest component is positive, as mjlab
// does.
void make_largest_positive(double q[4]) {
  const double largest =
      *std::max_element(q, q + 4, [](double a, double b) { return std::abs(a) < std::abs(b); });
  if (largest < 0) mju_scl(q, q, -1.0, 4);
}

std::uint32_t group_mask(const std::optional<std::vector<int>>& groups,
                         const std::string& context) {
  if (!groups) return 0x3f;
  std::uint32_t mask = 0;
  for (int g : *groups) {
    if (g < 0 || g > 5)
      throw ValueError(
          fmt::format("{}: include_geom_groups has {}: groups are 0 to 5", context, g));
    mask |= 1u << g;
  }
  if (mask == 0)
    throw ValueError(context + ": include_geom_groups is empty: the rays would hit nothing");
  return mask;
}

}  // namespace

SensorKind raycast_kind() { return sensor_kind<RayCastSensorCfg>(&kRayCastData); }

std::unique_ptr<Sensor> RayCastSensorCfg::build() const {
  return std::make_unique<RayCastSensor>(*this);
}

RayCastSensor::RayCastSensor(const RayCastSensorCfg& cfg) : Sensor(cfg.key()), cfg_(cfg) {
  sensor_context(cfg.name);
  if (cfg.frame.empty()) throw ValueError(context() + ": no frame given");
  check_fields(cfg, context());
  for (const scene::ObjRef& ref : cfg.frame) {
    if (!cfg.any_frame && (ref.type == "xbody" || ref.type == "camera"))
      throw ValueError(
          fmt::format("{}: frame '{}' is a {}: must be 'body', 'site', or 'geom' "
                      "(any_frame takes xbody and camera)",
                      context(), ref.full_name(), ref.type));
  }
  alignment_ = cfg.ray_alignment;
  filter_.groups = group_mask(cfg.include_geom_groups, context());
  if (!(cfg.min_distance < cfg.max_distance))
    throw ValueError(fmt::format("{}: min_distance is {} m: must be in [0, max_distance = {})",
                                 context(), cfg.min_distance, cfg.max_distance));
  for (const scene::ObjRef& ref : cfg.frame) validate_frame(ref, context());
}

RayCastSensor::~RayCastSensor() = default;

std::string RayCastSensor::context() const { return fmt::format("sensor '{}'", name()); }

Field& RayCastSensor::add(std::string_view name, Shape shape, std::string frame, double low,
                          double high, int num_worlds) {
  SensorSpec spec = kRayCastData.spec(name, shape, std::move(frame));
  spec.low = low;
  spec.high = high;
  return add_field(name, std::move(spec), num_worlds);
}

void RayCastSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  frames_.clear();
  for (const scene::ObjRef& ref : cfg_.frame) frames_.emplace_back(m, init.scene, ref, context());
  pattern_ = build_pattern(m);
  const int count = static_cast<int>(pattern_.size()) / num_parts();
  bundles_.clear();
  for (int k = 0; k < num_parts(); ++k)
    bundles_.emplace_back(pattern_, k * count, count, std::min(3.0, cfg_.max_distance));
  parts_.assign(init.num_worlds, 0);
  moments_.assign(init.num_worlds, 0.0);
  history_ = {};
  if (!pattern_.times.empty()) {
    const double oldest = *std::min_element(pattern_.times.begin(), pattern_.times.end());
    const double steps = -oldest / m->opt.timestep + 3;
    if (steps > kMaxMoments)
      throw ValueError(
          fmt::format("{}: the times of its rays reach {} s back, which needs {:.0f} stored poses: "
                      "the maximum is {}",
                      context(), -oldest, steps, kMaxMoments));
    history_ = PoseHistory(init.num_worlds * num_frames(), static_cast<int>(steps));
  }
  poses_.assign(static_cast<std::size_t>(init.num_worlds) * frames_.size(), FramePose{});
  const int objects = static_cast<int>(m->ngeom + m->nflex);
  scratch_.assign(init.threads, rays::RayScratch(objects));

  clear_fields();
  const int b = init.num_worlds, n = num_rays(), f = num_frames();
  const double far = cfg_.max_distance;
  distances_ = &add("distances", {n}, "", -1, far, b);
  hit_pos_ = &add("hit_pos_w", {n, 3}, "world", -kInf, kInf, b);
  normals_ = &add("normals_w", {n, 3}, "world", -1, 1, b);
  frame_pos_ = &add("frame_pos_w", {f, 3}, "world", -kInf, kInf, b);
  frame_quat_ = &add("frame_quat_w", {f, 4}, "world", -1, 1, b);
  pos_ = &add("pos_w", {3}, "world", -kInf, kInf, b);
  quat_ = &add("quat_w", {4}, "world", -1, 1, b);
  if (cfg_.hit_ids) {
    geom_id_ = &add("geom_id", {n}, "", -1, objects - 1, b);
    body_id_ = &add("body_id", {n}, "", -1, m->nbody - 1, b);
    material_id_ = &add("material_id", {n}, "", -1, m->nmat - 1, b);
  }
}

RayPattern RayCastSensor::build_pattern(const mjModel* model) const {
  return make_pattern(cfg_.pattern, model, context());
}

void RayCastSensor::remember(const World& world) {
  for (int f = 0; f < num_frames(); ++f)
    history_.push(world.id * num_frames() + f, world.time(),
                  frames_[f].pose(world.data, RayAlignment::kBase));
}

void RayCastSensor::substep(const World& world) { remember(world); }

void RayCastSensor::reset(const World& world) {
  if (history_.empty()) return;
  for (int f = 0; f < num_frames(); ++f) history_.clear(world.id * num_frames() + f);
  remember(world);
}

void RayCastSensor::compute(const World& world) {
  parts_[world.id] = part(world);
  moments_[world.id] = world.time();
  if (!history_.empty()) remember(world);
  for (int f = 0; f < num_frames(); ++f) {
    FramePose& pose = poses_[world.id * num_frames() + f];
    pose = frames_[f].pose(world.data, alignment_);
    double q[4];
    mju_mat2Quat(q, pose.mat);
    make_largest_positive(q);
    std::copy_n(pose.pos, 3, frame_pos_->data.row<float>(world.id).data() + 3 * f);
    std::copy_n(q, 4, frame_quat_->data.row<float>(world.id).data() + 4 * f);
  }
  std::copy_n(frame_pos_->data.row<float>(world.id).data(), 3,
              pos_->data.row<float>(world.id).data());
  std::copy_n(frame_quat_->data.row<float>(world.id).data(), 4,
              quat_->data.row<float>(world.id).data());
}

void RayCastSensor::cast(const CastContext& context) {
  const int packets = bundles_.front().num_packets(), chunks = (packets + kChunk - 1) / kChunk;
  const int per_world = chunks * num_frames();
  const int worlds = static_cast<int>(context.ids.size());
  // If there are enough worlds, a thread takes whole worlds: two threads with parts of one world
  // would both load its geoms into their caches.
  const int parts_of_item = worlds >= 4 * context.pool.size() ? per_world : 1;
  context.pool.run_near(worlds * per_world / parts_of_item, [&](int item, int thread) {
    for (int k = 0; k < parts_of_item; ++k) {
      const int at = item * parts_of_item + k, world = context.ids[at / per_world];
      const int part = at % per_world, begin = part % chunks * kChunk;
      trace_packets(*context.rays, world, part / chunks, begin, std::min(begin + kChunk, packets),
                    scratch_[thread]);
    }
  });
  if (wants_finish())
    context.pool.run(worlds, [&](int item, int thread) {
      finish(*context.rays, context.ids[item], scratch_[thread]);
    });
}

void RayCastSensor::finish(const rays::RayScene& /*rays*/, int /*world*/,
                           rays::RayScratch& /*scratch*/) {}

void RayCastSensor::forget(int world, int r) {
  distances_->data.row<float>(world)[r] = -1.0f;
  for (int k = 0; k < 3; ++k) normals_->data.row<float>(world)[3 * r + k] = 0.0f;
  for (Field* ids : {geom_id_, body_id_, material_id_})
    if (ids != nullptr) ids->data.row<int>(world)[r] = -1;
}

rays::RayFilter RayCastSensor::filter(int frame) const {
  rays::RayFilter filter = filter_;
  const int body = frames_[frame].body();
  if (cfg_.exclude_parent_body && (body > 0 || exclude_world_)) filter.exclude_body = body;
  return filter;
}

void RayCastSensor::place_timed(int world, int frame, int packet, float reach,
                                rays::RayPacket& out) const {
  const RayBundle& bundle = bundles_[parts_[world]];
  const rays::LocalPacket& local = bundle.packet(packet);
  const double* times = pattern_.times.data() + parts_[world] * num_rays_per_frame();
  double last = 1.0;  // not the time of any ray
  float shift[3] = {}, align[9] = {};
  for (int i = 0; i < rays::kPacket; ++i) {
    const int r = bundle.rays(packet)[i];
    if (r >= 0 && times[r] != last) {
      last = times[r];
      const Pose pose = history_.at(world * num_frames() + frame, moments_[world] + last);
      const double p[3] = {pose.p.x, pose.p.y, pose.p.z},
                   q[4] = {pose.q.w, pose.q.x, pose.q.y, pose.q.z};
      double mat[9];
      mju_quat2Mat(mat, q);
      align_rays(alignment_, mat, align);
      for (int k = 0; k < 3; ++k) shift[k] = static_cast<float>(p[k] - out.origin[k]);
    }
    for (int k = 0; k < 3; ++k) {
      const float* row = align + 3 * k;
      out.o[k][i] =
          shift[k] + row[0] * local.o[0][i] + row[1] * local.o[1][i] + row[2] * local.o[2][i];
      out.d[k][i] = row[0] * local.d[0][i] + row[1] * local.d[1][i] + row[2] * local.d[2][i];
    }
    out.tmax[i] = local.active[i] * reach;
  }
}

RayCastSensor::WorldRay RayCastSensor::world_ray(int world, int r) const {
  const int n = num_rays_per_frame(), i = parts_[world] * n + r % n;
  const FramePose& pose = frame_pose(world, r / n);
  WorldRay ray{{pose.pos[0], pose.pos[1], pose.pos[2]}, {}};
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) {
      ray.origin[k] += pose.align[3 * k + j] * pattern_.offsets[i][j];
      ray.direction[k] += pose.align[3 * k + j] * pattern_.directions[i][j];
    }
  }
  return ray;
}

void RayCastSensor::packet_to_world(const rays::RayScene& rays, int world, int frame, int p,
                                    rays::RayPacket& out) const {
  const FramePose& pose = frame_pose(world, frame);
  std::copy_n(pose.pos, 3, out.origin);
  // The tolerance avoids that rounding turns a hit at max_distance into a miss.
  const float reach = static_cast<float>(cfg_.max_distance) * (1 + 4e-7f);
  if (history_.empty())
    rays.to_world(bundles_[parts_[world]].packet(p), pose.align, reach, out);
  else
    place_timed(world, frame, p, reach, out);
}

void RayCastSensor::trace_packets(const rays::RayScene& rays, int world, int frame, int begin,
                                  int end, rays::RayScratch& scratch) {
  const RayBundle& bundle = bundles_[parts_[world]];
  const rays::RayFilter seen_by = filter(frame);
  const float nearest = static_cast<float>(cfg_.min_distance),
              farthest = static_cast<float>(cfg_.max_distance);
  rays::RayPacket packets[kChunk];
  for (int p = begin; p < end; ++p) packet_to_world(rays, world, frame, p, packets[p - begin]);
  rays.cull(world, seen_by, {packets, static_cast<std::size_t>(end - begin)}, scratch);
  const Outputs out = outputs(world, frame);
  rays::HitPacket hits;
  rays::RayOutputs rows;
  for (int p = begin; p < end; ++p) {
    const rays::RayPacket& packet = packets[p - begin];
    rays.trace_culled(world, seen_by, packet, hits, scratch);
    rays.rows(world, packet, nearest, farthest, out.geoms != nullptr, hits, rows);
    write(bundle, p, hits, rows, out);
    traced(rays, world, frame, bundle, p, packet, hits);
  }
}

void RayCastSensor::traced(const rays::RayScene& /*rays*/, int /*world*/, int /*frame*/,
                           const RayBundle& /*bundle*/, int /*p*/,
                           const rays::RayPacket& /*packet*/, const rays::HitPacket& /*hits*/) {}

RayCastSensor::Outputs RayCastSensor::outputs(int world, int frame) {
  const int first = frame * num_rays_per_frame();
  const auto ids = [&](Field* field) {
    return field == nullptr ? nullptr : field->data.row<int>(world).data() + first;
  };
  return {distances_->data.row<float>(world).data() + first,
          hit_pos_->data.row<float>(world).data() + 3 * first,
          normals_->data.row<float>(world).data() + 3 * first,
          ids(geom_id_),
          ids(body_id_),
          ids(material_id_)};
}

void RayCastSensor::write(const RayBundle& bundle, int p, const rays::HitPacket& hits,
                          const rays::RayOutputs& rows, const Outputs& out) {
  bundle.each_run(p, [&](auto n, int lane, int ray) {
    copy_some<n()>(rows.distance + lane, out.distances + ray);
    copy_some<3 * n()>(rows.pos + 3 * lane, out.hit_pos + 3 * ray);
    copy_some<3 * n()>(rows.normal + 3 * lane, out.normals + 3 * ray);
  });
  if (out.geoms == nullptr) return;
  bundle.each_run(p, [&](auto n, int lane, int ray) {
    copy_some<n()>(hits.geom + lane, out.geoms + ray);
    copy_some<n()>(rows.body + lane, out.bodies + ray);
    copy_some<n()>(rows.material + lane, out.materials + ray);
  });
}

}  // namespace mjsense::sensors
