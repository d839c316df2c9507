// SPDX-License-Identifier: Apache-2.0
// Random heaps of bodies. Every field, mode and reduction is compared with MuJoCo's own contact
// sensors, and what MuJoCo does not have is compared with a brute-force search of mjData.contact.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "mjsense/core/system/cpu.h"
#include "mjsense/core/testing/test_model.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {
namespace {

using Random = std::mt19937;
double uniform(Random& r, double a, double b) {
  return std::uniform_real_distribution<double>(a, b)(r);
}
int below(Random& r, int n) { return std::uniform_int_distribution<int>(0, n - 1)(r); }

const std::vector<std::string> kAll = {"found", "force",  "torque", "dist",
                                       "pos",   "normal", "tangent"};
constexpr ContactMode kModes[] = {ContactMode::kGeom, ContactMode::kBody, ContactMode::kSubtree};
constexpr ContactReduce kReduces[] = {ContactReduce::kNone, ContactReduce::kMinDist,
                                      ContactReduce::kMaxForce, ContactReduce::kNetForce};

struct Heap {
  std::string xml;
  std::vector<std::string> geoms, bodies;
  std::string prefix;  // prefix of the names of bodies and their geoms
};

std::string random_geom(Random& r, Heap& heap) {
  const char* types[] = {"sphere", "box", "capsule", "ellipsoid"};
  const std::string name = fmt::format("{}g{}", heap.prefix, heap.geoms.size());
  heap.geoms.push_back(name);
  const int condims[] = {1, 3, 4, 6};
  return fmt::format(
      R"(<geom name="{}" type="{}" size="{:.3f} {:.3f} {:.3f}" pos="{:.3f} {:.3f} {:.3f}" condim="{}" margin="{:.3f}" gap="{:.3f}" friction="{:.2f} .02 .01"/>)",
      name, types[below(r, 4)], uniform(r, .03, .08), uniform(r, .03, .08), uniform(r, .03, .08),
      uniform(r, -.05, .05), uniform(r, -.05, .05), uniform(r, -.05, .05), condims[below(r, 4)],
      below(r, 2) * .01, below(r, 2) * .02, uniform(r, .2, 1.2));
}

void add_body(Random& r, Heap& heap, int depth) {
  const std::string name = fmt::format("{}b{}", heap.prefix, heap.bodies.size());
  heap.bodies.push_back(name);
  const double reach = depth ? .15 : .25;
  heap.xml +=
      fmt::format(R"(<body name="{}" pos="{:.3f} {:.3f} {:.3f}">)", name, uniform(r, -reach, reach),
                  uniform(r, -reach, reach), depth ? 0.0 : uniform(r, .02, .3));
  heap.xml += depth ? R"(<joint type="hinge" axis="0 1 0"/>)" : "<freejoint/>";
  for (int k = 1 + below(r, 3); k > 0; --k) heap.xml += random_geom(r, heap);
  if (depth < 3) {
    for (int k = below(r, 3 - depth); k > 0; --k) add_body(r, heap, depth + 1);
  }
  heap.xml += "</body>";
}

Heap random_heap(Random& r, std::string prefix = "") {
  Heap heap;
  heap.prefix = std::move(prefix);
  heap.xml = fmt::format(
      R"(<mujoco><option cone="{}"/><size memory="20M"/><worldbody><geom name="floor" type="plane" size="3 3 .1"/>)",
      below(r, 2) ? "elliptic" : "pyramidal");
  heap.geoms.push_back("floor");
  heap.bodies.push_back("world");
  for (int k = 2 + below(r, 5); k > 0; --k) add_body(r, heap, 0);
  heap.xml += "</worldbody><sensor>";
  return heap;
}

ContactMatch random_match(Random& r, const Heap& heap, int count) {
  ContactMatch match;
  match.mode = kModes[below(r, 3)];
  std::vector<std::string> names = match.mode == "geom" ? heap.geoms : heap.bodies;
  std::shuffle(names.begin(), names.end(), r);
  names.resize(std::min<std::size_t>(names.size(), count));
  match.pattern = names;
  return match;
}

ContactSensorCfg random_cfg(Random& r, const Heap& heap, int index) {
  ContactSensorCfg cfg;
  cfg.name = fmt::format("c{}", index);
  cfg.primary = random_match(r, heap, 1 + below(r, 4));
  if (below(r, 2)) cfg.secondary = random_match(r, heap, 1);
  cfg.fields = kAll;
  cfg.reduce = kReduces[below(r, 4)];
  cfg.num_slots = 1 + below(r, 4);
  return cfg;
}

// MuJoCo's sensors for the same content, one per primary.
std::string mujoco_sensors(const ContactSensorCfg& cfg) {
  std::string xml;
  for (std::size_t p = 0; p < cfg.primary.pattern.size(); ++p) {
    xml += fmt::format(R"(<contact name="{}_{}" {}1="{}" )", cfg.name, p, cfg.primary.mode.text(),
                       cfg.primary.pattern[p]);
    if (cfg.secondary)
      xml += fmt::format(R"({}2="{}" )", cfg.secondary->mode.text(), cfg.secondary->pattern[0]);
    xml +=
        fmt::format(R"(num="{}" reduce="{}" data="found force torque dist pos normal tangent"/>)",
                    cfg.num_slots, cfg.reduce.text());
  }
  return xml;
}

struct Model {
  explicit Model(const std::string& xml) : model(compile_mjcf(xml)), data(make_data(model.get())) {}
  ModelPtr model;
  DataPtr data;
  mjModel* m = model.get();
  mjData* d = data.get();
};

std::unique_ptr<ContactSensor> make_sensor(const ContactSensorCfg& cfg, const mjModel* m,
                                           int decimation = 1) {
  std::unique_ptr<Sensor> s = cfg.build();
  SensorInit init;
  init.model = m;
  init.decimation = decimation;
  s->initialize(init);
  return std::unique_ptr<ContactSensor>(static_cast<ContactSensor*>(s.release()));
}

// Contacts whose forces are equal but for rounding are in another order where MuJoCo's library
// rounds differently from this one: on AArch64 it fuses products and sums.
bool order_is_undefined(const ContactSensor& sensor, const Model& model, const mjtNum* force) {
  if (kHasAvx || sensor.cfg().reduce != ContactReduce::kMaxForce) return false;
  int same = 0;
  for (int c = 0; c < model.d->ncon; ++c) {
    mjtNum other[6];
    mj_contactForce(model.m, model.d, c, other);
    same += std::abs(mju_norm3(other) - mju_norm3(force)) <= 1e-9 * std::max(1.0, mju_norm3(force));
  }
  return same > 1;
}

void expect_equal_to_mujoco(ContactSensor& sensor, const Model& model) {
  const int P = static_cast<int>(sensor.primary_names().size()), K = sensor.cfg().num_slots;
  for (int p = 0; p < P; ++p) {
    const std::string name = fmt::format("{}_{}", sensor.name(), p);
    const int id = mj_name2id(model.m, mjOBJ_SENSOR, name.c_str());
    const mjtNum* native = model.d->sensordata + model.m->sensor_adr[id];
    for (int k = 0; k < K; ++k) {
      const bool any_order = order_is_undefined(sensor, model, native + 1);  // after `found`
      for (const std::string& field : kAll) {
        const auto row = sensor.field(field).data.row<float>(0);
        const int dim = static_cast<int>(row.size()) / (P * K);
        if (any_order && field != "found") {
          native += dim;
          continue;
        }
        for (int i = 0; i < dim; ++i, ++native) {
          ASSERT_NEAR(row[(p * K + k) * dim + i], *native, 1e-6 * std::max(1.0, std::abs(*native)))
              << name << " " << sensor.cfg().reduce.text() << " "
              << sensor.cfg().primary.mode.text() << " slot " << k << " " << field << "[" << i
              << "] of " << model.d->ncon << " contacts";
        }
      }
    }
  }
}

TEST(ContactRandom, EveryFieldModeAndReductionEqualsMuJoCos) {
  int contacts = 0;
  for (int seed = 0; seed < 150; ++seed) {
    Random r(seed);
    Heap heap = random_heap(r);
    std::vector<ContactSensorCfg> cfgs;
    for (int i = 0; i < 8; ++i) {
      cfgs.push_back(random_cfg(r, heap, i));
      heap.xml += mujoco_sensors(cfgs.back());
    }
    Model model(heap.xml + "</sensor></mujoco>");
    std::vector<std::unique_ptr<ContactSensor>> sensors;
    for (const ContactSensorCfg& cfg : cfgs) sensors.push_back(make_sensor(cfg, model.m));
    for (int step = 0; step < 12; ++step) {
      mj_forward(model.m, model.d);
      contacts += model.d->ncon;
      World world{0, model.m, model.d};
      world.moment = step + 1;
      for (auto& sensor : sensors) {
        sensor->compute(world);
        expect_equal_to_mujoco(*sensor, model);
        if (HasFatalFailure()) return;
      }
      mj_step(model.m, model.d);
      mj_step(model.m, model.d);
    }
  }
  EXPECT_GT(contacts, 5000);  // the bodies were in contact
}

// ---- what MuJoCo does not have

bool belongs(const mjModel* m, int geom, ContactMode mode, const std::string& name) {
  if (geom < 0) return false;
  if (mode == ContactMode::kGeom) return geom == mj_name2id(m, mjOBJ_GEOM, name.c_str());
  const int object = mj_name2id(m, mjOBJ_BODY, name.c_str());
  for (int body = m->geom_bodyid[geom];; body = m->body_parentid[body]) {
    if (body == object) return true;
    if (mode == ContactMode::kBody || body == 0) return false;
  }
}

// One element of the pair matrix, by its definition: +1 if the primary has geom 1 and the secondary
// geom 2, -1 the other way round, +1 if both are true, 0 if none is.
int direction(const mjModel* m, const mjContact& c, ContactMode primary_mode,
              const std::string& primary, ContactMode secondary_mode,
              const std::string& secondary) {
  for (int side : {0, 1}) {
    if (belongs(m, c.geom[side], primary_mode, primary) &&
        belongs(m, c.geom[1 - side], secondary_mode, secondary)) {
      return side == 0 ? 1 : -1;
    }
  }
  return 0;
}

struct PairCounts {
  // both_directions: contacts of a primary that count for secondaries on both sides.
  int pairs = 0, both_directions = 0;
};

// Compares pair_found and pair_force with a search of mjData.contact. Names are full names.
void expect_pairs_of_brute_force(ContactSensor& sensor, const Model& model,
                                 const std::vector<std::string>& primaries,
                                 const std::vector<std::string>& secondaries, PairCounts& counts) {
  const ContactMode mode = sensor.cfg().primary.mode;
  const ContactMode other_mode = sensor.cfg().secondary->mode;
  const auto found = sensor.field("pair_found").data.row<float>(0);
  const auto force = sensor.field("pair_force").data.row<float>(0);
  const std::size_t S = secondaries.size();
  ASSERT_EQ(found.size(), primaries.size() * S);
  for (std::size_t p = 0; p < primaries.size(); ++p) {
    std::vector<int> seen(2 * model.d->ncon);
    for (std::size_t s = 0; s < S; ++s) {
      int count = 0;
      double sum[3] = {0, 0, 0}, size = 1;
      for (int i = 0; i < model.d->ncon; ++i) {
        const mjContact& c = model.d->contact[i];
        const int sign = direction(model.m, c, mode, primaries[p], other_mode, secondaries[s]);
        if (sign == 0) continue;
        seen[2 * i + (sign > 0)] = 1;
        mjtNum f[6], w[3];
        mj_contactForce(model.m, model.d, i, f);
        mju_mulMatTVec3(w, c.frame, f);
        for (int k = 0; k < 3; ++k) sum[k] += sign * w[k];
        size += mju_norm3(f);
        ++count;
      }
      ASSERT_EQ(found[p * S + s], count) << primaries[p] << " with " << secondaries[s];
      counts.pairs += count > 0;
      for (int k = 0; k < 3; ++k) {
        ASSERT_NEAR(force[(p * S + s) * 3 + k], sum[k], 1e-6 * size)
            << primaries[p] << " on " << secondaries[s];
      }
    }
    for (int i = 0; i < model.d->ncon; ++i)
      counts.both_directions += seen[2 * i] && seen[2 * i + 1];
  }
}

TEST(ContactRandom, PairsOthersAndFrictionSplitMatchBruteForce) {
  PairCounts counts;
  for (int seed = 1000; seed < 1100; ++seed) {
    Random r(seed);
    Heap heap = random_heap(r);
    Model model(heap.xml + "</sensor></mujoco>");
    ContactSensorCfg cfg = random_cfg(r, heap, 0);
    cfg.secondary = random_match(r, heap, 1 + below(r, 4));
    cfg.secondary_policy = "each";
    cfg.friction_split = cfg.other_ids = true;
    cfg.global_frame = true;
    auto sensor = make_sensor(cfg, model.m);
    const int P = static_cast<int>(cfg.primary.pattern.size());
    for (int step = 0; step < 10; ++step) {
      mj_forward(model.m, model.d);
      sensor->compute({0, model.m, model.d});
      expect_pairs_of_brute_force(*sensor, model, cfg.primary.pattern, cfg.secondary->pattern,
                                  counts);
      if (HasFatalFailure()) FAIL() << "seed " << seed << ", step " << step;
      for (int p = 0; p < P; ++p) {
        std::vector<int> others;
        for (int i = 0; i < model.d->ncon; ++i) {
          const mjContact& c = model.d->contact[i];
          bool regular = false, reverse = false;
          for (const std::string& secondary : cfg.secondary->pattern) {
            const int sign = direction(model.m, c, cfg.primary.mode, cfg.primary.pattern[p],
                                       cfg.secondary->mode, secondary);
            regular |= sign > 0;
            reverse |= sign < 0;
          }
          if (regular || reverse) others.push_back(c.geom[regular ? 1 : 0]);
        }
        for (int k = 0; k < cfg.num_slots; ++k) {
          const int n = p * cfg.num_slots + k;
          const int other = sensor->field("other_geom").data.row<std::int32_t>(0)[n];
          const float found = sensor->field("found").data.row<float>(0)[n];
          if (found == 0) {
            ASSERT_EQ(other, -1);
          } else {
            ASSERT_EQ(found, others.size());
            ASSERT_NE(std::find(others.begin(), others.end(), other), others.end());
            ASSERT_EQ(sensor->field("other_body").data.row<std::int32_t>(0)[n],
                      model.m->geom_bodyid[other]);
          }
          const float* whole = &sensor->field("force").data.row<float>(0)[n * 3];
          const float* normal = &sensor->field("normal_force").data.row<float>(0)[n * 3];
          const float* friction = &sensor->field("friction_force").data.row<float>(0)[n * 3];
          const float* axis = &sensor->field("normal").data.row<float>(0)[n * 3];
          const double tol =
              1e-6 * (1 + std::abs(whole[0]) + std::abs(whole[1]) + std::abs(whole[2]));
          double along = 0;
          for (int i = 0; i < 3; ++i) {
            ASSERT_NEAR(normal[i] + friction[i], whole[i], tol);
            along += friction[i] * axis[i];
          }
          if (cfg.reduce == "netforce") continue;  // a sum has no single normal
          ASSERT_NEAR(along, 0, tol);
        }
      }
      for (int k = 0; k < 3; ++k) mj_step(model.m, model.d);
    }
  }
  EXPECT_GT(counts.pairs, 300);
  EXPECT_GT(counts.both_directions, 100);
}

// Primaries and secondaries of an entity, given by regular expressions and with excludes.
TEST(ContactRandom, SecondariesWithExcludesMatchBruteForce) {
  PairCounts counts;
  int excluded = 0;
  for (int seed = 2000; seed < 2100; ++seed) {
    Random r(seed);
    Heap heap = random_heap(r, "e/");
    Model model(heap.xml + "</sensor></mujoco>");
    ContactSensorCfg cfg = random_cfg(r, heap, 0);
    cfg.primary.pattern = {".*"};
    cfg.primary.entity = "e";
    cfg.secondary = ContactMatch{kModes[below(r, 3)], {".*"}, "e", {}};
    cfg.secondary_policy = "each";
    const bool geoms = cfg.secondary->mode == "geom";
    // One literal name, and every name that ends in a random digit.
    const std::string one = geoms ? "g1" : "b1", digit = std::to_string(below(r, 10));
    cfg.secondary->exclude = {one, digit + "$"};
    const auto names = [&](ContactMode mode, bool with_excludes) {
      std::vector<std::string> result;
      const bool of_geoms = mode == ContactMode::kGeom;
      for (int id = 0; id < (of_geoms ? model.m->ngeom : model.m->nbody); ++id) {
        const std::string name = mj_id2name(model.m, of_geoms ? mjOBJ_GEOM : mjOBJ_BODY, id);
        if (!name.starts_with("e/")) continue;
        if (with_excludes && (name == "e/" + one || name.ends_with(digit))) {
          ++excluded;
        } else {
          result.push_back(name);
        }
      }
      return result;
    };
    const std::vector<std::string> secondaries = names(cfg.secondary->mode, true);
    auto sensor = make_sensor(cfg, model.m);
    for (int step = 0; step < 5; ++step) {
      mj_forward(model.m, model.d);
      sensor->compute({0, model.m, model.d});
      expect_pairs_of_brute_force(*sensor, model, names(cfg.primary.mode, false), secondaries,
                                  counts);
      if (HasFatalFailure()) FAIL() << "seed " << seed << ", step " << step;
      for (int k = 0; k < 3; ++k) mj_step(model.m, model.d);
    }
  }
  EXPECT_GT(counts.pairs, 1000);
  EXPECT_GT(counts.both_directions, 100);
  EXPECT_GT(excluded, 100);
}

// A plate of 80 balls: all matches are counted and summed, however many there are.
TEST(ContactRandom, EightyContactsOfOneBody) {
  std::string xml = R"(<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
      <body name="b" pos="0 0 .0195"><freejoint/>)";
  for (int i = 0; i < 80; ++i) {
    xml += fmt::format(R"(<geom size=".02" pos="{:.2f} {:.2f} 0" mass=".01"/>)", i % 10 * .05,
                       i / 10 * .05);
  }
  ContactSensorCfg cfg;
  cfg.name = "c0";
  cfg.primary = {"body", {"b"}, "", {}};
  cfg.fields = kAll;
  cfg.reduce = "netforce";
  Model model(xml + "</body></worldbody><sensor>" + mujoco_sensors(cfg) + "</sensor></mujoco>");
  mj_forward(model.m, model.d);
  auto sensor = make_sensor(cfg, model.m);
  sensor->compute({0, model.m, model.d});
  EXPECT_EQ(sensor->field("found").data.row<float>(0)[0], 80);
  expect_equal_to_mujoco(*sensor, model);
}

}  // namespace
}  // namespace mjsense::sensors
