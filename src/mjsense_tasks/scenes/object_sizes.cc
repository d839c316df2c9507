// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_sizes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/pose.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/object_meshes.h"

namespace mjsense::tasks::scenes {
namespace {

void scale(const double* from, double factor, int n, double* to) {
  for (int i = 0; i < n; ++i) to[i] = factor * from[i];
}

}  // namespace

std::vector<double> ObjectSizes::steps(const std::array<double, 2>& range) {
  if (range[0] == range[1]) return {range[0]};
  std::vector<double> all;
  for (int k = 0; k < kSteps; ++k)
    all.push_back(range[0] + (range[1] - range[0]) * k / (kSteps - 1));
  return all;
}

ObjectSizes::ObjectSizes(sim::Simulation& simulation, std::span<const int> bodies,
                         std::vector<std::vector<double>> sizes, std::string_view context)
    : m_(simulation.scene().model()), sizes_(std::move(sizes)) {
  mjBatch* batch = simulation.worlds().batch();
  geom_size_.expand(batch, "geom_size", m_->geom_size);
  geom_pos_.expand(batch, "geom_pos", m_->geom_pos);
  geom_quat_.expand(batch, "geom_quat", m_->geom_quat);
  geom_rbound_.expand(batch, "geom_rbound", m_->geom_rbound);
  geom_aabb_.expand(batch, "geom_aabb", m_->geom_aabb);
  geom_dataid_.expand(batch, "geom_dataid", m_->geom_dataid);
  body_mass_.expand(batch, "body_mass", m_->body_mass);
  body_inertia_.expand(batch, "body_inertia", m_->body_inertia);
  body_ipos_.expand(batch, "body_ipos", m_->body_ipos);
  body_pos_.expand(batch, "body_pos", m_->body_pos);
  subtree_mass_.expand(batch, "body_subtreemass", m_->body_subtreemass);
  body_invweight_.expand(batch, "body_invweight0", m_->body_invweight0);
  dof_invweight_.expand(batch, "dof_invweight0", m_->dof_invweight0);
  dof_m0_.expand(batch, "dof_M0", m_->dof_M0);
  if (m_->nsite > 0) {
    site_pos_.expand(batch, "site_pos", m_->site_pos);
    site_size_.expand(batch, "site_size", m_->site_size);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    Object& object = objects_.emplace_back();
    object.body = bodies[i];
    object.dof = m_->body_dofadr[bodies[i]];
    for (int b = bodies[i]; b < m_->nbody; ++b) {
      if (!observe::is_descendant_or_self(m_, b, bodies[i])) continue;
      if (b != bodies[i] && m_->body_jntnum[b] > 0)
        throw ValueError(fmt::format(
            "{}: object '{}' has a moving part, '{}', so it cannot be scaled: sizes must be [1, 1]",
            context, scene::name_of(m_, mjOBJ_BODY, bodies[i]), scene::name_of(m_, mjOBJ_BODY, b)));
      object.bodies.push_back(b);
    }
    for (int s = 0; s < m_->nsite; ++s) {
      if (observe::is_descendant_or_self(m_, m_->site_bodyid[s], bodies[i]))
        object.sites.push_back(s);
    }
    for (int g = 0; g < m_->ngeom; ++g) {
      if (!observe::is_descendant_or_self(m_, m_->geom_bodyid[g], bodies[i])) continue;
      object.geoms.push_back(g);
      if (m_->geom_type[g] != mjGEOM_MESH || sizes_[i].size() < 2) continue;
      MeshGeom& mesh = object.meshes.emplace_back();
      mesh.geom = g;
      for (std::size_t k = 0; k < sizes_[i].size(); ++k)
        mesh.shown.push_back(shown(
            g, ObjectMeshes::find(m_, m_->geom_dataid[g], static_cast<int>(k)), sizes_[i][k]));
    }
    for (int b : object.bodies) widen(batch, b, sizes_[i]);
  }
}

// Collision detection uses a bounding volume tree over a body's geoms, of which worlds do not have
// their own copy. Its boxes are enlarged to cover all sizes. They are in the body's inertial frame,
// which scales with the body.
void ObjectSizes::widen(mjBatch* batch, int body, const std::vector<double>& sizes) const {
  // The batch's own copy of the model, which is not shared yet.
  double* boxes = const_cast<double*>(mjb_model(batch)->bvh_aabb);
  const double *from = m_->bvh_aabb, minimum = sizes.front(), maximum = sizes.back();
  for (int n = m_->body_bvhadr[body]; n < m_->body_bvhadr[body] + m_->body_bvhnum[body]; ++n) {
    for (int i = 0; i < 3; ++i) {
      const double a = from[6 * n + i] - from[6 * n + 3 + i];
      const double b = from[6 * n + i] + from[6 * n + 3 + i];
      const double low = std::min(minimum * a, maximum * a),
                   high = std::max(minimum * b, maximum * b);
      boxes[6 * n + i] = 0.5 * (low + high);
      boxes[6 * n + 3 + i] = 0.5 * (high - low);
    }
  }
}

// MuJoCo's compiler moves a mesh into the frame of its own inertia, and its geom accordingly.
ObjectSizes::Shown ObjectSizes::shown(int geom, int mesh, double size) const {
  Shown out{};
  out.mesh = mesh;
  Pose pose = geom_frame(m_, geom);
  pose.p = size * pose.p;
  pose = pose * Pose{vec3(m_->mesh_pos + 3 * mesh), quat(m_->mesh_quat + 4 * mesh)};
  write_vec(pose.p, out.pos);
  write_quat(pose.q, out.quat);
  double low[3], high[3];
  for (int i = 0; i < 3; ++i) {
    low[i] = high[i] = m_->mesh_vert[3 * m_->mesh_vertadr[mesh] + i];
    for (int v = 1; v < m_->mesh_vertnum[mesh]; ++v) {
      const double x = m_->mesh_vert[3 * (m_->mesh_vertadr[mesh] + v) + i];
      low[i] = std::min(low[i], x);
      high[i] = std::max(high[i], x);
    }
    out.size[i] = std::max(std::abs(low[i]), std::abs(high[i]));
    out.aabb[i] = 0.5 * (low[i] + high[i]);
    out.aabb[3 + i] = 0.5 * (high[i] - low[i]);
  }
  out.bound = std::hypot(out.size[0], out.size[1], out.size[2]);
  return out;
}

void ObjectSizes::set(int world, std::span<const int> steps) const {
  double removed = 0, added = 0;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const double size = sizes_[i][steps[i]];
    set_object(world, objects_[i], steps[i], size);
    removed += m_->body_subtreemass[objects_[i].body];
    added += subtree_mass_.of(world)[objects_[i].body];
  }
  subtree_mass_.of(world)[0] = m_->body_subtreemass[0] - removed + added;
}

void ObjectSizes::set_object(int world, const Object& object, int step, double s) const {
  const double s3 = s * s * s, s5 = s3 * s * s;
  for (int b : object.bodies) {
    body_mass_.of(world)[b] = s3 * m_->body_mass[b];
    subtree_mass_.of(world)[b] = s3 * m_->body_subtreemass[b];
    scale(m_->body_inertia + 3 * b, s5, 3, body_inertia_.of(world) + 3 * b);
    scale(m_->body_ipos + 3 * b, s, 3, body_ipos_.of(world) + 3 * b);
    if (b != object.body) scale(m_->body_pos + 3 * b, s, 3, body_pos_.of(world) + 3 * b);
    body_invweight_.of(world)[2 * b] = m_->body_invweight0[2 * b] / s3;
    body_invweight_.of(world)[2 * b + 1] = m_->body_invweight0[2 * b + 1] / s5;
  }
  for (int i = 0; i < 6; ++i) {  // three translations, three rotations
    const double factor = i < 3 ? s3 : s5;
    dof_m0_.of(world)[object.dof + i] = factor * m_->dof_M0[object.dof + i];
    dof_invweight_.of(world)[object.dof + i] = m_->dof_invweight0[object.dof + i] / factor;
  }
  for (int site : object.sites) {
    scale(m_->site_pos + 3 * site, s, 3, site_pos_.of(world) + 3 * site);
    scale(m_->site_size + 3 * site, s, 3, site_size_.of(world) + 3 * site);
  }
  for (int g : object.geoms) {
    scale(m_->geom_size + 3 * g, s, 3, geom_size_.of(world) + 3 * g);
    scale(m_->geom_pos + 3 * g, s, 3, geom_pos_.of(world) + 3 * g);
    scale(m_->geom_aabb + 6 * g, s, 6, geom_aabb_.of(world) + 6 * g);
    geom_rbound_.of(world)[g] = s * m_->geom_rbound[g];
  }
  for (const MeshGeom& mesh : object.meshes) {
    const Shown& shown = mesh.shown[step];
    geom_dataid_.of(world)[mesh.geom] = shown.mesh;
    std::ranges::copy(shown.pos, geom_pos_.of(world) + 3 * mesh.geom);
    std::ranges::copy(shown.quat, geom_quat_.of(world) + 4 * mesh.geom);
    std::ranges::copy(shown.size, geom_size_.of(world) + 3 * mesh.geom);
    std::ranges::copy(shown.aabb, geom_aabb_.of(world) + 6 * mesh.geom);
    geom_rbound_.of(world)[mesh.geom] = shown.bound;
  }
}

}  // namespace mjsense::tasks::scenes
