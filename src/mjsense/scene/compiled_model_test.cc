// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/compiled_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mjxmacro.h>

#include <cstring>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

constexpr const char* kModel = R"(
  <mujoco model="m">
    <worldbody>
      <light name="l" pos="0 0 3"/>
      <geom name="floor" type="plane" size="5 5 .1"/>
      <camera name="front" pos="0 -2 1"/>
      <body name="a" pos="0 0 .3">
        <freejoint name="free"/><geom name="box" type="box" size=".1 .1 .1"/><site name="imu"/><camera name="own"/>
        <body name="b"><joint name="hinge" range="0 1"/><geom name="tip" size=".1"/><site name="end" pos="1 0 0"/></body>
      </body>
    </worldbody>
    <tendon><spatial name="t"><site site="imu"/><site site="end"/></spatial></tendon>
    <actuator><motor name="m" joint="hinge"/></actuator>
    <sensor><gyro name="gyro" site="imu"/></sensor>
    <keyframe><key name="k"/></keyframe>
  </mujoco>)";

ModelPtr compiled(const char* xml) {
  const SpecPtr spec = parse_model({.xml = xml}, "test");
  return compile(spec.get(), Vfs());
}

// The model of a scene whose spec was edited by `edit`.
template <class Edit>
ModelPtr extended(const mjModel* model, Edit&& edit) {
  const SpecPtr spec(mj_makeSpec());
  const CompiledModel outline(model, spec.get());
  edit(spec.get());
  const ModelPtr small = compile(spec.get(), Vfs());
  if (!small) throw ValueError(mjs_getError(spec.get()));
  return outline.extended(small.get());
}

TEST(CompiledModel, WithoutAdditionsEqualsTheModel) {
  const ModelPtr model = compiled(kModel);
  const ModelPtr copy = extended(model.get(), [](mjSpec*) {});
#define X(name) EXPECT_EQ(copy->name, model->name) << #name;
  MJMODEL_SIZES
#undef X
  const mjModel* m = model.get();
  MJMODEL_POINTERS_PREAMBLE(m)
#define X(type, name, nr, nc) \
  EXPECT_EQ(std::memcmp(copy->name, m->name, sizeof(type) * m->nr * (nc)), 0) << #name;
  MJMODEL_POINTERS
#undef X
}

TEST(CompiledModel, AddedSensorsAndCamerasFollowThoseOfTheModel) {
  const ModelPtr model = compiled(kModel);
  const ModelPtr more = extended(model.get(), [](mjSpec* spec) {
    mjsCamera* camera = mjs_addCamera(mjs_findBody(spec, "world"), nullptr);
    mjs_setName(camera->element, "added");
    camera->fovy = 20;
    mjsSensor* sensor = mjs_addSensor(spec);
    mjs_setName(sensor->element, "where");
    sensor->type = mjSENS_FRAMEPOS;
    sensor->objtype = mjOBJ_CAMERA;
    mjs_setString(sensor->objname, "added");
  });
  EXPECT_EQ(mj_name2id(more.get(), mjOBJ_CAMERA, "own"), 1);
  ASSERT_EQ(mj_name2id(more.get(), mjOBJ_CAMERA, "added"), 2);
  EXPECT_EQ(more->cam_bodyid[2], 0);
  EXPECT_EQ(more->cam_fovy[2], 20);
  ASSERT_EQ(mj_name2id(more.get(), mjOBJ_SENSOR, "where"), 1);
  EXPECT_EQ(more->sensor_objid[1], 2);
  EXPECT_EQ(more->sensor_adr[1], model->nsensordata);
  EXPECT_EQ(more->nsensordata, model->nsensordata + 3);
  EXPECT_EQ(mj_name2id(more.get(), mjOBJ_KEY, "k"), 0);
  mjData* data = mj_makeData(more.get());
  mj_step(more.get(), data);
  mj_deleteData(data);
}

TEST(CompiledModel, OtherAdditionsAreRefusedWithTheirXml) {
  const ModelPtr model = compiled(kModel);
  EXPECT_THAT(error_of<ValueError>([&] {
                extended(model.get(), [](mjSpec* spec) {
                  mjs_setName(mjs_addSite(mjs_findBody(spec, "b"), nullptr)->element, "mark");
                });
              }),
              ::testing::StartsWith("the model has no site 'mark', which a sensor "
                                    "needs: add <site name=\"mark\""));
}

TEST(CompiledModel, UnnamedElementsGetTheNamesOfABase) {
  std::string xml = kModel;
  for (const char* name : {" name=\"box\"", " name=\"own\""})
    xml.erase(xml.find(name), strlen(name));
  const ModelPtr model = compiled(xml.c_str());
  const ModelPtr copy = extended(model.get(), [](mjSpec*) {});
  EXPECT_EQ(mj_name2id(copy.get(), mjOBJ_GEOM, "geom_1"), 1);
  EXPECT_EQ(mj_name2id(copy.get(), mjOBJ_CAMERA, "camera_1"), 1);
}

}  // namespace
}  // namespace mjsense::scene
