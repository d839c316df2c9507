// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/model_indices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "mjsense/core/element_count.h"
#include "mjsense/core/error.h"

namespace mjsense {
namespace {

[[noreturn]] void refuse(std::string_view field, std::int64_t place, std::int64_t value,
                         std::int64_t lowest, std::int64_t end) {
  throw ValueError(
      fmt::format("the model's {}[{}] is {}, expected {}", field, place, value,
                  lowest < end ? fmt::format("{} to {}", lowest, end - 1) : "no element"));
}

template <class T>
void check_range(std::string_view field, const T* values, std::int64_t first, std::int64_t count,
                 std::int64_t lowest, std::int64_t end) {
  if (values == nullptr) return;
  for (std::int64_t i = first; i < first + count; ++i)
    if (values[i] < lowest || values[i] >= end) refuse(field, i, values[i], lowest, end);
}

// An array whose elements have a part of another array each: its start, and its length.
template <class T>
void check_parts(std::string_view start_name, std::string_view number_name, const T* starts,
                 const int* numbers, std::int64_t count, std::int64_t total) {
  if (starts == nullptr || numbers == nullptr) return;
  for (std::int64_t i = 0; i < count; ++i) {
    if (numbers[i] < 0 || numbers[i] > total) refuse(number_name, i, numbers[i], 0, total + 1);
    if (numbers[i] > 0 && (starts[i] < 0 || starts[i] > total - numbers[i]))
      refuse(start_name, i, starts[i], 0, total - numbers[i] + 1);
  }
}

#define ID(field, rows, columns, lowest, count) \
  {#field, lowest, &mjModel::field, &mjModel::rows, columns, &mjModel::count, #count},

const std::vector<IdField>& physics_id_fields() {
  static const std::vector<IdField> fields = {
      // clang-format off
      ID(body_mocapid, nbody, 1, -1, nmocap)
      ID(body_plugin, nbody, 1, -1, nplugin)
      ID(jnt_qposadr, njnt, 1, 0, nq)
      ID(jnt_dofadr, njnt, 1, 0, nv)
      ID(jnt_actuatorid, njnt, 1, -1, nactuator)
      ID(dof_bodyid, nv, 1, 0, nbody)
      ID(dof_jntid, nv, 1, 0, njnt)
      ID(dof_parentid, nv, 1, -1, nv)
      ID(dof_Madr, nv, 1, 0, nM)
      ID(dof_treeid, nv, 1, 0, ntree)
      ID(geom_plugin, ngeom, 1, -1, nplugin)
      ID(pair_geom1, npair, 1, 0, ngeom)
      ID(pair_geom2, npair, 1, 0, ngeom)
      ID(tendon_actuatorid, ntendon, 1, -1, nactuator)
      ID(actuator_plugin, nactuator, 1, -1, nplugin)
      ID(sensor_plugin, nsensor, 1, -1, nplugin)
      ID(M_colind, nC, 1, 0, nv)
      ID(D_colind, nD, 1, 0, nv)
      ID(B_colind, nB, 1, 0, nv)
      ID(ten_J_colind, nJten, 1, 0, nv)
      ID(flex_vertbodyid, nflexvert, 1, -1, nbody)
      ID(flex_nodebodyid, nflexnode, 1, -1, nbody)
      ID(name_bodyadr, nbody, 1, 0, nnames)
      ID(name_jntadr, njnt, 1, 0, nnames)
      ID(name_geomadr, ngeom, 1, 0, nnames)
      ID(name_siteadr, nsite, 1, 0, nnames)
      ID(name_camadr, ncam, 1, 0, nnames)
      ID(name_lightadr, nlight, 1, 0, nnames)
      ID(name_meshadr, nmesh, 1, 0, nnames)
      ID(name_tendonadr, ntendon, 1, 0, nnames)
      ID(name_actuatoradr, nactuator, 1, 0, nnames)
      ID(name_sensoradr, nsensor, 1, 0, nnames)
      // clang-format on
  };
  return fields;
}

void check_ids(const mjModel& m, const std::vector<IdField>& fields) {
  for (const IdField& f : fields)
    check_range(f.name, m.*f.ids, 0, m.*f.rows * f.columns, f.lowest, m.*f.count);
}

// Ids whose meaning depends on a type.
void check_typed_ids(const mjModel& m) {
  for (int i = 0; m.geom_type && m.geom_dataid && i < m.ngeom; ++i) {
    const bool mesh = m.geom_type[i] == mjGEOM_MESH || m.geom_type[i] == mjGEOM_SDF;
    const std::int64_t end = mesh                              ? m.nmesh
                             : m.geom_type[i] == mjGEOM_HFIELD ? m.nhfield
                                                               : std::max(m.nmesh, m.nhfield);
    check_range("geom_dataid", m.geom_dataid, i, 1, mesh ? 0 : -1, end);
  }
  for (int i = 0; m.body_parentid && i < m.nbody; ++i)
    if (m.body_parentid[i] < 0 || m.body_parentid[i] > std::max(0, i - 1))
      refuse("body_parentid", i, m.body_parentid[i], 0, std::max(1, i));
  for (int i = 0; m.eq_type && m.eq_obj1id && i < m.neq; ++i) {
    const bool joints = m.eq_type[i] == mjEQ_JOINT;
    const std::int64_t end = joints                        ? m.njnt
                             : m.eq_type[i] == mjEQ_TENDON ? m.ntendon
                             : m.eq_type[i] <= mjEQ_WELD   ? count_of(&m, m.eq_objtype[i])
                                                           : m.nflex;
    check_range("eq_obj1id", m.eq_obj1id, i, 1, 0, end);
    if (m.eq_type[i] <= mjEQ_TENDON) check_range("eq_obj2id", m.eq_obj2id, i, 1, -1, end);
  }
  for (int i = 0; m.wrap_type && m.wrap_objid && i < m.nwrap; ++i) {
    const int type = m.wrap_type[i];
    const std::int64_t end = type == mjWRAP_JOINT                               ? m.njnt
                             : type == mjWRAP_SITE                              ? m.nsite
                             : type == mjWRAP_SPHERE || type == mjWRAP_CYLINDER ? m.ngeom
                                                                                : 0;
    if (end) check_range("wrap_objid", m.wrap_objid, i, 1, 0, end);
  }
  for (int i = 0; m.actuator_trntype && m.actuator_trnid && i < m.nactuator; ++i) {
    const int type = m.actuator_trntype[i];
    const std::int64_t end = type == mjTRN_TENDON                                 ? m.ntendon
                             : type == mjTRN_BODY                                 ? m.nbody
                             : type == mjTRN_SITE || type == mjTRN_SLIDERCRANK    ? m.nsite
                             : type == mjTRN_JOINT || type == mjTRN_JOINTINPARENT ? m.njnt
                                                                                  : 0;
    if (end == 0) continue;
    check_range("actuator_trnid", m.actuator_trnid, 2 * i, 1, 0, end);
    if (type == mjTRN_SITE || type == mjTRN_SLIDERCRANK)
      check_range("actuator_trnid", m.actuator_trnid, 2 * i + 1, 1, -1, end);
  }
  for (int i = 0; m.sensor_objtype && m.sensor_objid && i < m.nsensor; ++i) {
    if (const int end = count_of(&m, m.sensor_objtype[i]))
      check_range("sensor_objid", m.sensor_objid, i, 1, -1, end);
    if (const int end = count_of(&m, m.sensor_reftype[i]))
      check_range("sensor_refid", m.sensor_refid, i, 1, -1, end);
  }
}

// Joints of the same element have these numbers of values.
void check_joints(const mjModel& m) {
  if (!m.jnt_type || !m.jnt_qposadr || !m.jnt_dofadr) return;
  for (int i = 0; i < m.njnt; ++i) {
    const int type = m.jnt_type[i];
    const int positions = type == mjJNT_FREE ? 7 : type == mjJNT_BALL ? 4 : 1;
    const int dofs = type == mjJNT_FREE ? 6 : type == mjJNT_BALL ? 3 : 1;
    check_range("jnt_qposadr", m.jnt_qposadr, i, 1, 0, m.nq - positions + 1);
    check_range("jnt_dofadr", m.jnt_dofadr, i, 1, 0, m.nv - dofs + 1);
  }
}

}  // namespace

const std::vector<IdField>& drawn_id_fields() {
  static const std::vector<IdField> fields = {
      // clang-format off
      ID(body_parentid, nbody, 1, 0, nbody)
      ID(body_rootid, nbody, 1, 0, nbody)
      ID(body_weldid, nbody, 1, 0, nbody)
      ID(jnt_bodyid, njnt, 1, 0, nbody)
      ID(geom_bodyid, ngeom, 1, 0, nbody)
      ID(geom_matid, ngeom, 1, -1, nmat)
      ID(site_bodyid, nsite, 1, 0, nbody)
      ID(site_matid, nsite, 1, -1, nmat)
      ID(site_dataid, nsite, 1, -1, nmesh)
      ID(cam_bodyid, ncam, 1, 0, nbody)
      ID(cam_targetbodyid, ncam, 1, -1, nbody)
      ID(light_bodyid, nlight, 1, 0, nbody)
      ID(light_targetbodyid, nlight, 1, -1, nbody)
      ID(light_texid, nlight, 1, -1, ntex)
      ID(mat_texid, nmat, mjNTEXROLE, -1, ntex)
      ID(skin_matid, nskin, 1, -1, nmat)
      ID(skin_bonebodyid, nskinbone, 1, 0, nbody)
      ID(tendon_matid, ntendon, 1, -1, nmat)
      // clang-format on
  };
  return fields;
}

#undef ID
#define RANGE(field, rows, lowest, end) check_range(#field, m.field, 0, m.rows, lowest, end)
#define PARTS(start, number, rows, total) \
  check_parts(#start, #number, m.start, m.number, m.rows, m.total)

void check_element_indices(const mjModel& m) {
  check_ids(m, drawn_id_fields());
  RANGE(geom_type, ngeom, 0, mjNGEOMTYPES);
  RANGE(site_type, nsite, 0, mjNGEOMTYPES);
  RANGE(jnt_type, njnt, 0, mjJNT_HINGE + 1);
  RANGE(cam_mode, ncam, 0, mjCAMLIGHT_TARGETBODYCOM + 1);
  RANGE(light_mode, nlight, 0, mjCAMLIGHT_TARGETBODYCOM + 1);
  RANGE(light_type, nlight, 0, mjLIGHT_IMAGE + 1);
  RANGE(tex_type, ntex, 0, mjTEXTURE_SKYBOX + 1);
  RANGE(tex_nchannel, ntex, 1, 5);
  PARTS(body_jntadr, body_jntnum, nbody, njnt);
  PARTS(body_dofadr, body_dofnum, nbody, nv);
  PARTS(body_geomadr, body_geomnum, nbody, ngeom);
  PARTS(mesh_vertadr, mesh_vertnum, nmesh, nmeshvert);
  PARTS(mesh_faceadr, mesh_facenum, nmesh, nmeshface);
  PARTS(mesh_normaladr, mesh_normalnum, nmesh, nmeshnormal);
  PARTS(skin_vertadr, skin_vertnum, nskin, nskinvert);
  PARTS(skin_faceadr, skin_facenum, nskin, nskinface);
  PARTS(skin_boneadr, skin_bonenum, nskin, nskinbone);
  PARTS(skin_bonevertadr, skin_bonevertnum, nskinbone, nskinbonevert);
  PARTS(tendon_adr, tendon_num, ntendon, nwrap);
  RANGE(mesh_graphadr, nmesh, -1, m.nmeshgraph);
  for (int i = 0; m.mesh_texcoordadr && m.mesh_texcoordnum && i < m.nmesh; ++i) {
    if (m.mesh_texcoordadr[i] < 0) continue;  // none
    check_range("mesh_texcoordnum", m.mesh_texcoordnum, i, 1, 0, m.nmeshtexcoord + 1);
    check_range("mesh_texcoordadr", m.mesh_texcoordadr, i, 1, 0,
                m.nmeshtexcoord - m.mesh_texcoordnum[i] + 1);
  }
  for (int i = 0; m.skin_texcoordadr && m.skin_vertnum && i < m.nskin; ++i) {
    if (m.skin_texcoordadr[i] >= 0)
      check_range("skin_texcoordadr", m.skin_texcoordadr, i, 1, 0,
                  m.nskintexvert - m.skin_vertnum[i] + 1);
  }
  for (int i = 0; m.hfield_adr && i < m.nhfield; ++i) {
    check_range("hfield_nrow", m.hfield_nrow, i, 1, 1, m.nhfielddata + 1);
    check_range("hfield_ncol", m.hfield_ncol, i, 1, 1, m.nhfielddata / m.hfield_nrow[i] + 1);
    check_range("hfield_adr", m.hfield_adr, i, 1, 0,
                m.nhfielddata - std::int64_t{m.hfield_nrow[i]} * m.hfield_ncol[i] + 1);
  }
  for (int i = 0; m.tex_adr && i < m.ntex; ++i) {
    const std::int64_t texels = m.ntexdata / m.tex_nchannel[i];
    check_range("tex_width", m.tex_width, i, 1, 1, texels + 1);
    check_range("tex_height", m.tex_height, i, 1, 1, texels / m.tex_width[i] + 1);
    check_range(
        "tex_adr", m.tex_adr, i, 1, 0,
        m.ntexdata - std::int64_t{m.tex_width[i]} * m.tex_height[i] * m.tex_nchannel[i] + 1);
  }
  check_typed_ids(m);
}

void check_mesh_indices(const mjModel& m, int mesh) {
  const std::int64_t corners = 3 * std::int64_t{m.mesh_facenum[mesh]},
                     first = 3 * std::int64_t{m.mesh_faceadr[mesh]};
  const int vertices = m.mesh_vertnum[mesh];
  check_range("mesh_face", m.mesh_face, first, corners, 0, vertices);
  if (m.mesh_normalnum[mesh] > 0)
    check_range("mesh_facenormal", m.mesh_facenormal, first, corners, 0, m.mesh_normalnum[mesh]);
  if (m.mesh_texcoordadr[mesh] >= 0)
    check_range("mesh_facetexcoord", m.mesh_facetexcoord, first, corners, 0,
                m.mesh_texcoordnum[mesh]);
  const std::int64_t start = m.mesh_graphadr[mesh];
  if (start < 0) return;
  // The numbers of vertices and faces, then arrays of nv, nv, nv + 3 nf and 3 nf ids.
  const std::int64_t room = m.nmeshgraph - start;
  if (room < 2) refuse("mesh_graphadr", mesh, start, 0, m.nmeshgraph - 1);
  const int* graph = m.mesh_graph + start;
  check_range("mesh_graph", m.mesh_graph, start, 1, 0,
              std::min<std::int64_t>(vertices, (room - 2) / 3) + 1);
  const std::int64_t hull = graph[0];
  check_range("mesh_graph", m.mesh_graph, start + 1, 1, 0, (room - 2 - 3 * hull) / 6 + 1);
  const std::int64_t faces = graph[1], edges = start + 2, ids = edges + hull,
                     neighbours = ids + hull, corner_ids = neighbours + hull + 3 * faces;
  check_range("mesh_graph", m.mesh_graph, edges, hull, 0, hull + 3 * faces);
  check_range("mesh_graph", m.mesh_graph, ids, hull, 0, vertices);
  check_range("mesh_graph", m.mesh_graph, neighbours, hull + 3 * faces, -1, hull);
  check_range("mesh_graph", m.mesh_graph, corner_ids, 3 * faces, 0, vertices);
}

void check_skin_indices(const mjModel& m, int skin) {
  check_range("skin_face", m.skin_face, 3 * std::int64_t{m.skin_faceadr[skin]},
              3 * std::int64_t{m.skin_facenum[skin]}, 0, m.skin_vertnum[skin]);
}

void check_model_indices(const mjModel& m) {
  check_element_indices(m);
  check_ids(m, physics_id_fields());
  check_joints(m);
  RANGE(geom_condim, ngeom, 1, 7);
  RANGE(flex_condim, nflex, 1, 7);
  RANGE(pair_dim, npair, 1, 7);
  RANGE(actuator_trntype, nactuator, 0, mjTRN_UNDEFINED + 1);
  PARTS(body_bvhadr, body_bvhnum, nbody, nbvh);
  PARTS(mesh_bvhadr, mesh_bvhnum, nmesh, nbvh);
  PARTS(mesh_octadr, mesh_octnum, nmesh, noct);
  PARTS(mesh_polyadr, mesh_polynum, nmesh, nmeshpoly);
  PARTS(mesh_polyvertadr, mesh_polyvertnum, nmeshpoly, nmeshpolyvert);
  PARTS(mesh_polymapadr, mesh_polymapnum, nmeshvert, nmeshpolymap);
  PARTS(tree_bodyadr, tree_bodynum, ntree, nbody);
  PARTS(tree_dofadr, tree_dofnum, ntree, nv);
  PARTS(sensor_adr, sensor_dim, nsensor, nsensordata);
  PARTS(actuator_ctrladr, actuator_ctrlnum, nactuator, nu);
  PARTS(actuator_actadr, actuator_actnum, nactuator, na);
  PARTS(M_rowadr, M_rownnz, nv, nC);
  PARTS(D_rowadr, D_rownnz, nv, nD);
  PARTS(B_rowadr, B_rownnz, nbody, nB);
  PARTS(ten_J_rowadr, ten_J_rownnz, ntendon, nJten);
  PARTS(flex_vertadr, flex_vertnum, nflex, nflexvert);
  PARTS(flex_edgeadr, flex_edgenum, nflex, nflexedge);
  PARTS(flex_elemadr, flex_elemnum, nflex, nflexelem);
  PARTS(flex_bvhadr, flex_bvhnum, nflex, nbvh);
  check_range("bvh_child", m.bvh_child, 0, 2 * m.nbvh, -1, m.nbvh);
  check_range("oct_child", m.oct_child, 0, 8 * m.noct, -1, m.noct);
  check_range("flex_edge", m.flex_edge, 0, 2 * m.nflexedge, 0, m.nflexvert);
  check_range("flex_elem", m.flex_elem, 0, m.nflexelemdata, 0, m.nflexvert);
  for (int i = 0; i < m.nmesh; ++i) check_mesh_indices(m, i);
  for (int i = 0; i < m.nskin; ++i) check_skin_indices(m, i);
}

}  // namespace mjsense
