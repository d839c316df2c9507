// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/skin_shapes.h"

#include <algorithm>
#include <cmath>

namespace mjsense::rays {

SkinShapes::SkinShapes(RTCDevice device, const mjModel* m) : model_(m), skins_(m->nskin) {
  for (int i = 0; i < m->nskin; ++i) {
    Skin& skin = skins_[i];
    const std::size_t vertices = m->skin_vertnum[i], faces = m->skin_facenum[i];
    skin.bones.resize(7 * m->skin_bonenum[i]);
    skin.mesh = DeformableMesh(device, {m->skin_face + 3 * m->skin_faceadr[i], 3 * faces},
                               {m->skin_vert + 3 * m->skin_vertadr[i], 3 * vertices});
    skin.smooth.resize(3 * vertices);
    skin.normals.resize(9 * faces);
    skin.geom = {.mat = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                 .rot = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                 .type = kSkinType,
                 .data = i};
  }
}

void SkinShapes::update(const mjModel* m, const mjData* d) {
  for (int i = 0; i < size(); ++i) {
    Skin& skin = skins_[i];
    skin.group = 1u << std::clamp(m->skin_group[i], 0, mjNGROUP - 1);
    skin.material = m->skin_matid[i];
    skin.stale |= skin.inflate != m->skin_inflate[i];
    skin.inflate = m->skin_inflate[i];
    for (int b = 0; b < m->skin_bonenum[i]; ++b) {
      const int body = m->skin_bonebodyid[m->skin_boneadr[i] + b];
      double* bone = &skin.bones[7 * b];
      skin.stale |= !std::equal(bone, bone + 3, d->xpos + 3 * body) ||
                    !std::equal(bone + 3, bone + 7, d->xquat + 4 * body);
      std::copy_n(d->xpos + 3 * body, 3, bone);
      std::copy_n(d->xquat + 4 * body, 4, bone + 3);
    }
  }
}

void SkinShapes::bend(std::uint32_t groups) {
  for (int i = 0; i < size(); ++i)
    if (skins_[i].stale && (skins_[i].group & groups)) bend(i);
}

// A vertex normal is the area-weighted mean of the normals of its faces, taken before the skin is
// inflated along it.
void SkinShapes::bend(int id) {
  Skin& skin = skins_[id];
  carry(id);
  const std::span<float> x = skin.mesh.vertices();
  const int* faces = model_->skin_face + 3 * model_->skin_faceadr[id];
  const int num_faces = model_->skin_facenum[id];
  std::fill(skin.smooth.begin(), skin.smooth.end(), 0.0f);
  for (int f = 0; f < num_faces; ++f) {
    const int* v = faces + 3 * f;
    float ab[3], ac[3];
    for (int k = 0; k < 3; ++k) {
      ab[k] = x[3 * v[1] + k] - x[3 * v[0] + k];
      ac[k] = x[3 * v[2] + k] - x[3 * v[0] + k];
    }
    const float n[3] = {ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2],
                        ab[0] * ac[1] - ab[1] * ac[0]};
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) skin.smooth[3 * v[c] + k] += n[k];
  }
  for (std::size_t i = 0; i < skin.smooth.size(); i += 3) {
    float* n = &skin.smooth[i];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; ++k) {
      n[k] = length > 0 ? n[k] / length : 0;
      x[i + k] += skin.inflate * n[k];
    }
  }
  for (int i = 0; i < 3 * num_faces; ++i)
    std::copy_n(&skin.smooth[3 * faces[i]], 3, &skin.normals[3 * i]);
  float box[6];
  box_around(x, box);
  std::copy_n(box, 3, skin.geom.center);
  std::copy_n(box + 3, 3, skin.geom.half);
  std::copy_n(skin.bones.data(), 3, skin.geom.pos);
  skin.mesh.refit();
  skin.stale = false;
}

// Linear blend skinning: each vertex moves with its bones, by their weights, from the bind pose.
void SkinShapes::carry(int id) {
  const mjModel* m = model_;
  Skin& skin = skins_[id];
  const std::span<float> x = skin.mesh.vertices();
  const float* rest = m->skin_vert + 3 * m->skin_vertadr[id];
  std::fill(x.begin(), x.end(), 0.0f);
  for (int b = 0; b < m->skin_bonenum[id]; ++b) {
    const int bone = m->skin_boneadr[id] + b;
    const double* now = &skin.bones[7 * b];
    double bound[4], quat[4], r[9], shift[3];
    for (int k = 0; k < 4; ++k) bound[k] = (k == 0 ? 1 : -1) * m->skin_bonebindquat[4 * bone + k];
    mju_mulQuat(quat, now + 3, bound);
    mju_quat2Mat(r, quat);
    const float* from = m->skin_bonebindpos + 3 * bone;
    for (int k = 0; k < 3; ++k)
      shift[k] = now[k] - skin.bones[k] -
                 (r[3 * k] * from[0] + r[3 * k + 1] * from[1] + r[3 * k + 2] * from[2]);
    const int first = m->skin_bonevertadr[bone];
    for (int i = first; i < first + m->skin_bonevertnum[bone]; ++i) {
      const int v = m->skin_bonevertid[i];
      const float* p = rest + 3 * v;
      const double weight = m->skin_bonevertweight[i];
      for (int k = 0; k < 3; ++k)
        x[3 * v + k] += static_cast<float>(
            weight * (r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2] + shift[k]));
    }
  }
}

}  // namespace mjsense::rays
