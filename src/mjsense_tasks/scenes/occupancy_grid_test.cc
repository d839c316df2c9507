// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/occupancy_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mjsense/core/testing/test_model.h"
#include "mjsense_tasks/scenes/base_planner.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

// A room of 4 x 4 m, divided by a wall with a gap, with a lamp above and a rug below the height
// range.
std::string room(double gap) {
  const double half = (4 - gap) / 4;
  return "<mujoco><worldbody><geom type='plane' size='5 5 .1'/>"
         "<geom type='box' pos='0 2.05 1' size='2 .05 1'/><geom type='box' pos='0 -2.05 1' size='2 "
         ".05 1'/>"
         "<geom type='box' pos='2.05 0 1' size='.05 2 1'/><geom type='box' pos='-2.05 0 1' "
         "size='.05 2 1'/>"
         "<geom type='box' pos='0 " +
         std::to_string(gap / 2 + half) + " 1' size='.05 " + std::to_string(half) +
         " 1'/>"
         "<geom type='box' pos='0 " +
         std::to_string(-gap / 2 - half) + " 1' size='.05 " + std::to_string(half) +
         " 1'/>"
         "<geom type='box' pos='1 1 2.3' size='.3 .3 .1'/><geom type='box' pos='1 -1 .01' size='.3 "
         ".3 .01'/>"
         "<geom type='cylinder' pos='-1 1 .4' size='.2 .4'/><geom type='sphere' pos='-1 -1 .4' "
         "size='.2' contype='0' conaffinity='0'/>"
         "</worldbody></mujoco>";
}

struct Floor {
  explicit Floor(double gap) : Floor(room(gap)) {}
  explicit Floor(const std::string& xml)
      : model(compile_mjcf(xml)), data(mj_makeData(model.get())) {
    mj_kinematics(model.get(), data.get());
  }
  OccupancyGrid occupancy() const {
    return {model.get(), data.get(), [](int) { return true; }, {}};
  }
  ModelPtr model;
  DataPtr data;
};

TEST(OccupancyGrid, MarksObstaclesOnly) {
  const Floor floor(1.0);
  const OccupancyGrid o = floor.occupancy();
  const auto free = [&](double x, double y) { return o.clearance(x, y) > 0; };
  EXPECT_FALSE(free(0, 1.5)) << "the wall";
  EXPECT_TRUE(free(0, 0)) << "the gap";
  EXPECT_FALSE(free(-1, 1)) << "the cylinder";
  EXPECT_TRUE(free(1, 1)) << "under the lamp";
  EXPECT_TRUE(free(1, -1)) << "on the rug";
  EXPECT_TRUE(free(-1, -1)) << "geoms without collisions";
  EXPECT_EQ(o.clearance(50, 0), 0) << "off the grid";
  // Analytic distances, within one cell.
  EXPECT_NEAR(o.clearance(1, 0), 0.95, 0.06)
      << "the middle wall's end is at (0.05, 0.5): " << std::hypot(0.95, 0.5);
  EXPECT_NEAR(o.clearance(-1, 0.4), 0.4, 0.06) << "the cylinder's rim";
}

// A pillar with vertices at its ends only must be an obstacle in between. It has too many vertices
// to compare all pairs.
TEST(OccupancyGrid, MarksMeshesBetweenTheirVertices) {
  std::string points;
  for (int i = 0; i < 128; ++i) {
    const double a = 2 * std::numbers::pi * i / 128;
    for (const double z : {0.0, 2.5})
      points += std::to_string(0.3 * std::cos(a)) + " " + std::to_string(0.3 * std::sin(a)) + " " +
                std::to_string(z) + " ";
  }
  const ModelPtr model =
      compile_mjcf("<mujoco><asset><mesh name='pillar' vertex='" + points +
                   "'/></asset><worldbody><geom type='plane' size='2 2 .1'/>"
                   "<geom type='mesh' mesh='pillar' pos='0 0 1.25'/></worldbody></mujoco>");
  const DataPtr data = make_data(model.get());
  mj_kinematics(model.get(), data.get());
  const OccupancyGrid o(model.get(), data.get(), [](int) { return true; }, {});
  EXPECT_EQ(o.clearance(0, 0), 0);
  EXPECT_NEAR(o.clearance(0.6, 0), 0.3, 0.06);
}

// The cylinder of radius 0.2 m at x = -1, y = 1 can move by 0.5 m in both directions along x.
TEST(OccupancyGrid, MarksDisplacedFurniture) {
  const Floor floor(1.0);
  const int cylinder = floor.model->ngeom - 2;
  ASSERT_EQ(floor.model->geom_type[cylinder], mjGEOM_CYLINDER);
  OccupancyCfg cfg;
  cfg.elsewhere = [&](int geom) {
    return geom == cylinder ? std::vector<Pose>{{{-0.5, 0, 0}, {}}, {{0.5, 0, 0}, {}}}
                            : std::vector<Pose>{};
  };
  const OccupancyGrid still = floor.occupancy();
  const OccupancyGrid moves(
      floor.model.get(), floor.data.get(), [](int) { return true; }, cfg);
  ASSERT_EQ(moves.columns(), still.columns());
  for (int row = 0; row < still.rows(); ++row) {
    for (int column = 0; column < still.columns(); ++column) {
      const double x = moves.x(column), y = moves.y(row);
      const double along = std::max(0.0, std::abs(x + 1) - 0.5), far = std::hypot(along, y - 1);
      if (still.taken(column, row) || far < 0.2) {
        EXPECT_TRUE(moves.taken(column, row)) << x << " " << y;
      } else if (far > 0.25) {
        EXPECT_FALSE(moves.taken(column, row)) << x << " " << y;
      }
    }
  }
}

// A disc of 0.2 m radius.
Footprint disc(const Floor& floor) {
  return {floor.model.get(), floor.data.get(),
          [&](int g) { return floor.model->geom_type[g] == mjGEOM_CYLINDER; }, Pose{{-1, 1, 0}, {}},
          10};
}

TEST(OccupancyGrid, FootprintCoversTheRobotGeoms) {
  const Floor floor(1.0);
  const Footprint print = disc(floor);
  EXPECT_NEAR(print.radius(), 0.2, 0.005);
  EXPECT_NEAR(print.height(), 0.8, 1e-9);
  const OccupancyGrid o = floor.occupancy();
  EXPECT_TRUE(print.fits(o, 0, 0, 0, 0.1));
  EXPECT_FALSE(print.fits(o, 0, 0, 0, 0.35));
}

TEST(BaseRoute, PassesTheGapWithoutCollision) {
  const Floor floor(1.0);
  const OccupancyGrid o = floor.occupancy();
  const BasePlanner routes(o, disc(floor));
  const BasePose from{-1, 0.3, pi}, to{1.2, -1.2, 0};
  const auto path = routes.find(from, to);
  ASSERT_GE(path.size(), 2u);
  EXPECT_EQ(path.front().x, from.x);
  EXPECT_NEAR(path.back().x, to.x, 1e-12);
  EXPECT_NEAR(path.back().yaw, to.yaw, 1e-12);
  for (std::size_t i = 1; i < path.size(); ++i)
    EXPECT_TRUE(routes.free_between(path[i - 1], path[i])) << i;
  // The path may be longer than necessary only because of the gap.
  double length = 0;
  for (std::size_t i = 1; i < path.size(); ++i)
    length += std::hypot(path[i].x - path[i - 1].x, path[i].y - path[i - 1].y);
  EXPECT_LT(length, 1.3 * (std::hypot(1, 0.3) + std::hypot(1.2, 1.2)));
}

TEST(BaseRoute, NarrowGapHasNoPath) {
  const Floor floor(0.45);  // a width of 0.4 m plus twice the margin is needed
  const BasePlanner routes(floor.occupancy(), disc(floor));
  EXPECT_TRUE(routes.find({-1, 0.3, 0}, {1.2, -1.2, 0}).empty());
  EXPECT_FALSE(routes.find({-1, 0.3, 0}, {-1.2, -1.2, 0}).empty());
}

TEST(BaseRoute, DifferentialBaseMovesAlongItsHeading) {
  const Floor floor(1.0);
  BaseRouteCfg cfg;
  cfg.sideways = false;
  const BasePlanner routes(floor.occupancy(), disc(floor), cfg);
  const auto path = routes.find(
      {-1, 0.3, 0}, [](const BasePose& p) { return std::hypot(p.x - 1.2, p.y + 1.2) < 0.2; },
      [](double, double) { return 0.0; });
  ASSERT_GE(path.size(), 2u);
  for (std::size_t i = 2; i < path.size(); ++i) {
    const double dx = path[i].x - path[i - 1].x, dy = path[i].y - path[i - 1].y;
    if (std::hypot(dx, dy) < 1e-9) continue;
    EXPECT_NEAR(std::remainder(std::atan2(dy, dx) - path[i].yaw, pi), 0, 1e-6) << i;
  }
}

// A corridor 1.2 m wide. The base consists of five discs in a row, 1.8 m long, and has no space to
// turn by 45 degrees:
//
//   ---------------------
//      o o o o o           goal
//      o o o o o           start
//   ---------------------
TEST(BaseRoute, ADifferentialBaseDoesNotSlide) {
  std::string discs;
  for (const double x : {-0.8, -0.4, 0.0, 0.4, 0.8})
    discs += "<geom type='cylinder' pos='" + std::to_string(x) + " 3 .2' size='.1 .2'/>";
  const Floor floor(
      "<mujoco><worldbody><geom type='box' pos='0 .65 1' size='4 .05 1'/>"
      "<geom type='box' pos='0 -.65 1' size='4 .05 1'/>" +
      discs + "</worldbody></mujoco>");
  const auto is_base = [&](int g) { return floor.model->geom_type[g] == mjGEOM_CYLINDER; };
  const OccupancyGrid occupancy(floor.model.get(), floor.data.get(),
                                [&](int g) { return !is_base(g); });
  const Footprint footprint(floor.model.get(), floor.data.get(), is_base, Pose{{0, 3, 0}, {}}, 1);
  BaseRouteCfg cfg;
  for (const bool sideways : {true, false}) {
    cfg.sideways = sideways;
    const auto path = BasePlanner(occupancy, footprint, cfg)
                          .find(
                              {0, -0.25, 0}, [](const BasePose& p) { return p.y > 0.2; },
                              [](double, double) { return 0.0; });
    EXPECT_EQ(path.empty(), !sideways);
  }
}

// There are two passages 1.5 m long, 0.7 and 1.2 m wide. A disc of 0.4 m takes the wide one,
// although the narrow one is nearer.
TEST(BaseRoute, KeepsClearWhereThereIsRoom) {
  for (const int side : {1, -1}) {  // of the wide passage
    const auto wall = [&](double from, double to) {
      return "<geom type='box' pos='0 " + std::to_string(side * 0.5 * (from + to)) +
             " 1' size='.75 " + std::to_string(0.5 * (to - from)) + " 1'/>";
    };
    const Floor floor("<mujoco><worldbody>" + wall(-2, -0.9) + wall(-0.2, 0.35) + wall(1.55, 2) +
                      "<geom type='box' pos='2 2 1' size='.05 .05 1'/>"
                      "<geom type='box' pos='-2 -2 1' size='.05 .05 1'/>"
                      "<geom type='cylinder' pos='-1 1 .4' size='.2 .4'/></worldbody></mujoco>");
    const OccupancyGrid occupancy(floor.model.get(), floor.data.get(), [&](int g) {
      return floor.model->geom_type[g] != mjGEOM_CYLINDER;
    });
    const auto path = BasePlanner(occupancy, disc(floor)).find({-1.4, 0, 0}, {1.4, 0, 0});
    ASSERT_GE(path.size(), 2u);
    for (std::size_t i = 1; i < path.size(); ++i) {
      const BasePose &a = path[i - 1], &b = path[i];
      if ((a.x < 0) == (b.x < 0)) continue;
      EXPECT_GT(side * std::lerp(a.y, b.y, a.x / (a.x - b.x)), 0)
          << "the wide passage is at " << side;
    }
  }
}

TEST(BaseRoute, TimesRespectSpeedAndAccelerationLimits) {
  const BasePose path[] = {{0, 0, 0}, {1.5, 0, 0}, {1.5, 0, 0.5 * pi}, {1.5, 0.1, 0.5 * pi}};
  const BaseSpeeds speeds;
  const auto points = timed(path, speeds, 0.02);
  EXPECT_EQ(points.front().time, 0);
  EXPECT_NEAR(points.back().pose.y, 0.1, 1e-12);
  EXPECT_NEAR(points.back().pose.yaw, 0.5 * pi, 1e-12);
  double last = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double dt = points[i].time - points[i - 1].time;
    const double v = std::hypot(points[i].pose.x - points[i - 1].pose.x,
                                points[i].pose.y - points[i - 1].pose.y) /
                     dt;
    EXPECT_LE(v, speeds.speed + 1e-9);
    EXPECT_LE(std::abs(points[i].pose.yaw - points[i - 1].pose.yaw) / dt, speeds.turn + 1e-9);
    EXPECT_LE(std::abs(v - last) / dt, 1.05 * speeds.acceleration);
    last = v;
  }
}

}  // namespace
}  // namespace mjsense::tasks::scenes
