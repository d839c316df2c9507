// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/model_indices.h"

#include <gtest/gtest.h>

#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/test_model.h"

namespace mjsense {
namespace {

constexpr const char* kModel = R"(<mujoco>
  <asset><texture name="t" type="2d" builtin="checker" width="8" height="8"/><material name="m" texture="t"/>
    <mesh name="tet" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3"/><hfield name="h" nrow="4" ncol="5" size="1 1 .2 .1"/></asset>
  <worldbody><light name="l"/><geom type="plane" size="1 1 .1" material="m"/><geom type="hfield" hfield="h"/>
    <body name="b"><freejoint/><geom type="mesh" mesh="tet"/><site name="s"/><camera name="c"/>
      <body pos="1 0 0"><joint name="j"/><geom name="g" size=".1"/><site name="e"/></body></body></worldbody>
  <tendon><spatial name="t"><site site="s"/><site site="e"/></spatial></tendon>
  <actuator><motor name="a" joint="j"/></actuator><sensor><jointpos joint="j"/></sensor>
  <equality><connect body1="b" anchor="0 0 0"/></equality></mujoco>)";

std::string message_of(const mjModel& m) {
  return error_of<ValueError>([&] { check_model_indices(m); });
}

TEST(ModelIndices, CompiledModelsAreValid) { check_model_indices(*TestModel(kModel).model); }

// Each array of ids, one place too far and one too low: the message names the array and its range.
TEST(ModelIndices, EveryIdIsChecked) {
  TestModel made(kModel);
  mjModel& m = *const_cast<mjModel*>(made.model);
  for (const IdField& f : drawn_id_fields()) {
    if (m.*f.rows == 0) continue;
    int& id = (m.*f.ids)[0];
    const int before = id;
    for (const int wrong : {static_cast<int>(m.*f.count), f.lowest - 1, 9999999}) {
      id = wrong;
      EXPECT_TRUE(message_of(m).starts_with("the model's " + f.name + "[0] is " +
                                            std::to_string(wrong) + ", expected "))
          << f.name;
    }
    id = before;
  }
  check_model_indices(m);
}

TEST(ModelIndices, PartsLieInsideOfTheirArrays) {
  TestModel made(kModel);
  mjModel& m = *const_cast<mjModel*>(made.model);
  const auto refused = [&](int& value, int wrong, const std::string& message) {
    const int before = value;
    value = wrong;
    EXPECT_EQ(message_of(m), message);
    value = before;
  };
  refused(m.geom_matid[0], 9999, "the model's geom_matid[0] is 9999, expected -1 to 0");
  refused(m.mesh_vertadr[0], 1, "the model's mesh_vertadr[0] is 1, expected 0 to 0");
  refused(m.mesh_facenum[0], 5, "the model's mesh_facenum[0] is 5, expected 0 to 4");
  refused(m.mesh_face[4], 4, "the model's mesh_face[4] is 4, expected 0 to 3");
  refused(m.mesh_face[4], -1, "the model's mesh_face[4] is -1, expected 0 to 3");
  refused(m.mesh_graph[0], 1000, "the model's mesh_graph[0] is 1000, expected 0 to 4");
  refused(m.hfield_ncol[0], 6, "the model's hfield_ncol[0] is 6, expected 1 to 5");
  refused(m.tex_width[0], 9, "the model's tex_height[0] is 8, expected 1 to 7");
  refused(m.geom_dataid[2], -1, "the model's geom_dataid[2] is -1, expected 0 to 0");
  refused(m.geom_type[0], mjNGEOMTYPES, "the model's geom_type[0] is 9, expected 0 to 8");
  refused(m.body_parentid[1], 2, "the model's body_parentid[1] is 2, expected 0 to 0");
  refused(m.jnt_dofadr[0], 2, "the model's jnt_dofadr[0] is 2, expected 0 to 1");
  refused(m.actuator_trnid[0], 2, "the model's actuator_trnid[0] is 2, expected 0 to 1");
  refused(m.sensor_objid[0], 7, "the model's sensor_objid[0] is 7, expected -1 to 1");
  refused(m.wrap_objid[1], 2, "the model's wrap_objid[1] is 2, expected 0 to 1");
  refused(m.geom_condim[0], 7, "the model's geom_condim[0] is 7, expected 1 to 6");
}

}  // namespace
}  // namespace mjsense
